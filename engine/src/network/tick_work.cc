#include "engine/src/network/tick_work.h"

#include <cstring>

#include "engine/src/network/displacement.h"
#include "engine/src/network/displacement.h"
#include "engine/src/base/arithmetic.h"
#include "engine/src/network/pose_stages.h"

namespace dcloth::engine {
namespace {

using format::LinearView;
using format::ModelView;

// Picoseconds, fitted to kernels/README.md (one Zen 3 core): products take 21 (int8) to 47 (f32) a byte of
// weights out of the cache and 68 out of memory, and a game has some of both; hidden layers of 7,964 vertices
// take 0.253 ms at F = 8 and 1.69 at F = 32, which is 20 ns a vertex and 27 ps a multiply-add, four fifths of it with
// integer products; skinning takes 0.039 ms for 7,952 vertices.
constexpr uint64_t kPerByte = 40;
constexpr uint64_t kPerLayerVertex = 20000;
constexpr uint64_t kPerMultiplyAdd = 27, kPerIntegerMultiplyAdd = 21;
constexpr uint64_t kPerSkinnedVertex = 5000;
constexpr uint64_t kPerGate = 1000;

struct PartSize {
  uint64_t items;
  uint64_t item_cost;
};

PartSize ProductSize(const LinearView& linear, size_t rows) {
  return {kernels::PanelCount(linear.columns), PanelBytes(linear, rows) * kPerByte};
}

uint64_t ProductCost(const LinearView& linear) {
  const PartSize size = ProductSize(linear, linear.rows);
  return size.items * size.item_cost;
}

// The first layer's rows are shorter; an average keeps the items of all layers alike.
uint64_t LayerBlockCost(const ModelView& model) {
  const uint64_t width = model.mesh_stage.feature_width, layers = model.mesh_stage.layer_count;
  const uint64_t inputs = 3 + (layers - 1) * width;
  const uint64_t multiply_adds = 3 * width * inputs / layers + 4 * width * width;
  const bool integers = model.mesh_stage.layers[layers - 1].integers != nullptr;
  return kernels::kGsgruBlock * (kPerLayerVertex + (integers ? kPerIntegerMultiplyAdd : kPerMultiplyAdd) * multiply_adds);
}

// No items: the part does not take place.
PartSize SizeOf(const ModelView& model, const TickPlan& plan, TickPart part) {
  const format::SkeletonStageView& skeleton = model.skeleton_stage;
  const format::MeshStageView& mesh = model.mesh_stage;
  const bool has_skeleton = RunsSkeleton(plan), has_mesh = RunsMesh(plan);
  switch (part) {
    case TickPart::kStatic:
      return {1, ProductCost(model.static_stage.hidden) + ProductCost(model.static_stage.increments)};
    case TickPart::kSkeletonInput:
      return has_skeleton ? ProductSize(skeleton.input, skeleton.input.rows) : PartSize{};
    case TickPart::kSkeletonHidden:
      return has_skeleton ? ProductSize(skeleton.hidden, skeleton.units) : PartSize{};
    case TickPart::kSkeletonGates:
      return has_skeleton ? PartSize{1, skeleton.units * kPerGate} : PartSize{};
    case TickPart::kBodyPoints:
      return has_mesh ? PartSize{MeshBlocks(model), kernels::kGsgruBlock * kPerSkinnedVertex} : PartSize{};
    case TickPart::kMeshLayers:
      return has_mesh ? PartSize{MeshBlocks(model) * mesh.layer_count, LayerBlockCost(model)} : PartSize{};
    case TickPart::kMeshHidden:
      return has_mesh ? ProductSize(mesh.hidden, mesh.hidden.rows) : PartSize{};
    case TickPart::kMeshCoefficients:
      return has_mesh ? ProductSize(mesh.coefficients, mesh.coefficients.rows) : PartSize{};
    case TickPart::kCoefficients:
      return has_skeleton ? PartSize{1, kPerGate + ProductCost(model.displacement.head)} : PartSize{};
    case TickPart::kDisplacement: {
      if (model.displacement.skeleton_rows == 0) return {};
      if (!has_skeleton) return {1, DisplacementFloats(model) * sizeof(float) * kPerByte};
      const size_t rows = model.displacement.skeleton_rows + (HasMesh(plan) ? model.displacement.mesh_rows : 0);
      return ProductSize(model.displacement.basis, rows);
    }
    case TickPart::kDone:
      break;
  }
  return {};
}

void ClearSkeletonState(Cloth* cloth) {
  const size_t units = cloth->model->skeleton_stage.units;
  if (units != 0) std::memset(cloth->coefficients, 0, units * sizeof(float));
}

// A stage that rested starts from zero: what it remembers belongs to a motion long past.
void WakeStages(Cloth* cloth, const TickPlan& plan) {
  if (RunsSkeleton(plan) && !RunsSkeleton(cloth->plan)) ClearSkeletonState(cloth);
  if (HasMesh(plan) && !HasMesh(cloth->plan)) ClearMeshState(*cloth->model, cloth->mesh);
  if (plan.mesh == MeshTurn::kRunFirst)
    std::memset(cloth->mesh_before, 0, cloth->model->mesh_stage.coefficients.columns * sizeof(float));
  cloth->plan = plan;
}

// Cut into panels: parts whose items are products of one input.
bool IsProduct(TickPart part) {
  return part == TickPart::kSkeletonInput || part == TickPart::kSkeletonHidden || part == TickPart::kMeshHidden ||
         part == TickPart::kMeshCoefficients || part == TickPart::kDisplacement;
}

LinearProduct ProductOf(const Cloth& cloth, TickPart part) {
  const ModelView& model = *cloth.model;
  float* q = cloth.coefficients + MeshCoefficientsAt(model);
  switch (part) {
    case TickPart::kSkeletonInput:
      return SkeletonInput(model.skeleton_stage, cloth.features, cloth.skeleton, cloth.quantized);
    case TickPart::kSkeletonHidden:
      return SkeletonHidden(model.skeleton_stage, cloth.coefficients, cloth.skeleton, cloth.quantized);
    case TickPart::kMeshHidden:
      return MeshHidden(model.mesh_stage, cloth.mesh, cloth.quantized);
    case TickPart::kMeshCoefficients:
      return MeshCoefficients(model.mesh_stage, cloth.mesh, cloth.quantized, q);
    default:
      return DisplacementProduct(model, cloth.plan.stages, cloth.coefficients, cloth.quantized,
                                 cloth.displacement[NextTick(cloth)]);
  }
}

void RunProduct(const kernels::KernelTable& kernels, Cloth* cloth, TickPart part, size_t begin, size_t count) {
  const LinearProduct product = ProductOf(*cloth, part);
  if (begin == 0) cloth->work.input_scale = QuantizeInput(kernels, product);
  ApplyPanels(kernels, product, cloth->work.input_scale, begin, count);
}

// Items [begin, begin + count) of a part.
void RunPart(Cloth* cloth, TickPart part, size_t begin, size_t count) {
  const kernels::KernelTable& kernels = ActiveKernels();
  const ModelView& model = *cloth->model;
  switch (part) {
    case TickPart::kStatic:
      RunStaticStage(kernels, model.static_stage, cloth->features, cloth->hidden, cloth->quantized,
                     cloth->increments[NextTick(*cloth)]);
      break;
    case TickPart::kSkeletonGates:
      RunSkeletonGates(kernels, model.skeleton_stage, cloth->skeleton, cloth->coefficients);
      break;
    case TickPart::kBodyPoints:
      PoseBodyPoints(kernels, model, cloth->mesh, begin, count);
      break;
    case TickPart::kMeshLayers:
      RunMeshLayers(kernels, model, cloth->mesh, begin, count);
      break;
    case TickPart::kCoefficients:
      if (AtHalfRate(cloth->plan)) {
        TurnMeshCoefficients(model, cloth->plan.mesh, cloth->coefficients + MeshCoefficientsAt(model),
                             cloth->mesh_before);
      }
      MixCoefficients(kernels, model, cloth->plan.stages, cloth->coefficients, cloth->quantized);
      break;
    case TickPart::kDisplacement:
      if (!RunsSkeleton(cloth->plan)) {
        std::memset(cloth->displacement[NextTick(*cloth)], 0, DisplacementFloats(model) * sizeof(float));
        break;
      }
      RunProduct(kernels, cloth, part, begin, count);
      break;
    default:
      RunProduct(kernels, cloth, part, begin, count);
      break;
  }
}

// Parts that one portion runs in turns: the GRU's product waits for memory and the layers for arithmetic, and neither needs
// the other. The layers but the last, which has its own to ask for, ask for the panels of the turn; so little at a time
// that any L2 holds it.
constexpr TickPart kFirstInTurns = TickPart::kSkeletonHidden, kLastInTurns = TickPart::kMeshLayers;
constexpr size_t kTurnBytes = size_t{64} << 10;

bool RunsInTurns(const ModelView& model, const TickPlan& plan, const TickWork& work) {
  return work.part == kFirstInTurns && work.items_done == 0 && RunsMesh(plan) && model.mesh_stage.layer_count > 1;
}

void RunInTurns(Cloth* cloth, Stopwatch* watch) {
  const kernels::KernelTable& kernels = ActiveKernels();
  const ModelView& model = *cloth->model;
  const MeshMemory& mesh = cloth->mesh;
  const size_t blocks = MeshBlocks(model), woven = (model.mesh_stage.layer_count - 1) * blocks;
  PoseBodyPoints(kernels, model, mesh, 0, blocks);
  watch->Lap(DCLOTH_STEP_MESH);
  const LinearProduct product = ProductOf(*cloth, TickPart::kSkeletonHidden);
  const float input_scale = QuantizeInput(kernels, product);
  const size_t panels = kernels::PanelCount(product.linear->columns), bytes = PanelBytes(*product.linear, product.row_count);
  const size_t turn = bytes < kTurnBytes ? kTurnBytes / bytes : 1;
  size_t blocks_done = 0;
  for (size_t first = 0; first < panels; first += turn) {
    const size_t count = turn < panels - first ? turn : panels - first;
    const size_t end = woven * (first + count) / panels;
    const ReadNext next = {static_cast<const uint8_t*>(product.linear->weights) + first * bytes, count * bytes};
    RunMeshLayers(kernels, model, mesh, blocks_done, end - blocks_done, next);
    blocks_done = end;
    watch->Lap(DCLOTH_STEP_MESH);
    ApplyPanels(kernels, product, input_scale, first, count);
    watch->Lap(DCLOTH_STEP_SKELETON);
  }
  RunSkeletonGates(kernels, model.skeleton_stage, cloth->skeleton, cloth->coefficients);
  watch->Lap(DCLOTH_STEP_SKELETON);
  RunMeshLayers(kernels, model, mesh, woven, blocks);
  watch->Lap(DCLOTH_STEP_MESH);
}

// DCLOTH_STEP_* that a part's time belongs to.
int StepOf(TickPart part) {
  if (part == TickPart::kStatic) return DCLOTH_STEP_STATIC;
  if (part <= TickPart::kSkeletonGates) return DCLOTH_STEP_SKELETON;
  return part >= TickPart::kCoefficients ? DCLOTH_STEP_DISPLACEMENT : DCLOTH_STEP_MESH;
}

TickPart After(TickPart part) { return static_cast<TickPart>(static_cast<uint32_t>(part) + 1); }

uint64_t CostOfParts(const ModelView& model, const TickPlan& plan, TickPart first, TickPart last) {
  uint64_t cost = 0;
  for (TickPart part = first; part <= last; part = After(part)) {
    const PartSize size = SizeOf(model, plan, part);
    cost += size.items * size.item_cost;
  }
  return cost;
}

void Publish(Cloth* cloth) {
  cloth->newest = NextTick(*cloth);
  if (cloth->tick_count < kTickSlots) ++cloth->tick_count;
}

}  // namespace

uint64_t TickCost(const ModelView& model, const TickPlan& plan) {
  return CostOfParts(model, plan, TickPart::kStatic, TickPart::kDisplacement);
}

void BeginTick(Cloth* cloth, const BoundPose& bound, const TickPlan& plan, double elapsed_ticks, Stopwatch* watch) {
  const ModelView& model = *cloth->model;
  double wind[3];
  VectorFromHost(cloth->binding.space, cloth->wind, wind);
  UpdateFeatures(model, bound, wind, elapsed_ticks, &cloth->root, cloth->features);
  WakeStages(cloth, plan);
  if (RunsMesh(plan)) PrepareBodyPoints(model, bound, cloth->root.heading, cloth->mesh);
  cloth->work = {TickPart::kStatic, 0, 1.0f};
  watch->Lap(DCLOTH_STEP_POSE);
}

uint64_t TickItems(const ModelView& model, const TickPlan& plan, TickPart part) {
  return SizeOf(model, plan, part).items;
}

// The integers of a product are made anew from its input, which it does not change.
void ResumeTick(Cloth* cloth, TickPart part, uint32_t items_done) {
  const FloatEnvironment arithmetic(ActiveSubnormals());
  cloth->work = {part, items_done, 1.0f};
  if (IsProduct(part) && items_done != 0)
    cloth->work.input_scale = QuantizeInput(ActiveKernels(), ProductOf(*cloth, part));
}

uint64_t ContinueTick(Cloth* cloth, uint64_t budget, Stopwatch* watch) {
  TickWork& work = cloth->work;
  uint64_t spent = 0;
  while (TickInWork(*cloth)) {
    const PartSize size = SizeOf(*cloth->model, cloth->plan, work.part);
    const uint64_t left = size.items - work.items_done;
    if (left == 0) {
      work.part = After(work.part);
      work.items_done = 0;
      if (work.part == TickPart::kDone) Publish(cloth);
      continue;
    }
    if (spent >= budget) break;
    if (RunsInTurns(*cloth->model, cloth->plan, work)) {
      const uint64_t cost = CostOfParts(*cloth->model, cloth->plan, kFirstInTurns, kLastInTurns);
      if (cost <= budget - spent) {
        RunInTurns(cloth, watch);
        work.part = After(kLastInTurns);
        spent += cost;
        continue;
      }
    }
    const uint64_t wanted = (budget - spent - 1) / size.item_cost + 1;
    const uint64_t count = wanted < left ? wanted : left;
    RunPart(cloth, work.part, work.items_done, static_cast<size_t>(count));
    watch->Lap(StepOf(work.part));
    work.items_done += static_cast<uint32_t>(count);
    spent += count * size.item_cost;
  }
  return spent;
}

}  // namespace dcloth::engine

#include "engine/src/network/schedule.h"

#include <cstring>
#include <initializer_list>

#include "engine/src/base/arithmetic.h"
#include "engine/src/network/displacement.h"
#include "engine/src/network/patch_stage.h"
#include "engine/src/network/pose_stages.h"

namespace dcloth::engine {
namespace {

using format::LinearView;
using format::ModelView;

// Picoseconds, fitted to kernels/README.md (one Zen 3 core): products take 21 (int8) to 47 (f32) a byte of
// weights out of the cache and 68 out of memory, and a game has some of both; hidden layers of 7,964 vertices
// take 0.253 ms at F = 8 and 1.69 at F = 32, which is 20 ns a vertex and 27 ps a multiply-add, four fifths of it with
// integer products; skinning takes 0.039 ms for 7,952 vertices. Products of all patches at once find their weights in
// the cache: 28 ps (f32) and 19 (int8) a weight and patch on a Xeon core with AVX2.
constexpr uint64_t kPerByte = 40;
constexpr uint64_t kPerLayerVertex = 20000;
constexpr uint64_t kPerMultiplyAdd = 27, kPerIntegerMultiplyAdd = 21;
constexpr uint64_t kPerSkinnedVertex = 5000;
constexpr uint64_t kPerGate = 1000;
constexpr uint64_t kPerPatchPoint = 80000, kPerPatchGroup = 40000;
constexpr uint64_t kPerPatchProduct = 30, kPerIntegerPatchProduct = 20;  // of one patch and one weight

// Of the hips, metres a second. Nobody runs so fast: what does was moved, and cloth left behind there would fly.
constexpr double kFastest = 12;

struct PartSize {
  uint64_t items;
  uint64_t item_cost;
};

// One part of a tick. A null function is one that the part has no use for.
struct Part {
  // None where a tick of `stages` leaves the part out.
  PartSize (*size)(const ModelView& model, uint32_t stages);
  // Items [begin, begin + count). Null: the items are the panels of `product`.
  void (*run)(Cloth* cloth, size_t begin, size_t count);
  LinearProduct (*product)(const Cloth& cloth);
  // What a tick that has come as far as `at` needs of what this part reads or makes. Called for every part, in order.
  void (*save)(const Cloth& cloth, uint32_t stages, const TickWork& at, StateSpans* spans);
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
  return kernels::kGsgruBlock *
         (kPerLayerVertex + (integers ? kPerIntegerMultiplyAdd : kPerMultiplyAdd) * multiply_adds);
}

void ClearSkeletonState(Cloth* cloth) {
  const size_t units = cloth->model->skeleton_stage.units;
  if (units != 0) std::memset(cloth->coefficients, 0, units * sizeof(float));
}

// A stage that rested starts from zero: what it remembers belongs to a motion long past.
void WakeStages(Cloth* cloth, uint32_t stages) {
  const ModelView& model = *cloth->model;
  if (RunsSkeleton(model, stages) && !RunsSkeleton(model, cloth->stages)) ClearSkeletonState(cloth);
  if (RunsMesh(model, stages) && !RunsMesh(model, cloth->stages)) ClearMeshState(model, cloth->mesh);
  if (RunsPatches(model, stages) && !RunsPatches(model, cloth->stages)) {
    ClearPatchState(model.patch_stage, cloth->patches);
  }
  cloth->stages = stages;
}

// How a tick finds what its patches remember; `root` and `stages` are of the tick before.
PatchMotion MotionOf(const Cloth& cloth, const SkinPose& skin, const double (&wind)[3], double elapsed_ticks) {
  const bool remembers = cloth.root.started && RunsPatches(*cloth.model, cloth.stages);
  const double tick_rate = static_cast<double>(cloth.model->tick_rate);
  const double farthest = kFastest / tick_rate * (elapsed_ticks > 1 ? elapsed_ticks : 1);
  PatchMotion motion = {};
  double square = 0;
  for (int r = 0; r < 3; ++r) {
    motion.hips_way[r] = remembers ? skin.origin[r] - cloth.root.position[r] : 0;
    motion.wind[r] = wind[r] / tick_rate;
    square += motion.hips_way[r] * motion.hips_way[r];
  }
  motion.elapsed_ticks = elapsed_ticks;
  motion.carried = !remembers || cloth.root.jumped || square > farthest * farthest;
  return motion;
}

// Columns of a product that are made by now, without padding.
size_t Made(const TickWork& at, TickPart part, size_t columns) {
  if (at.part < part) return 0;
  const size_t made = at.items_done * kernels::kPanelColumns;
  return at.part > part || made > columns ? columns : made;
}

void RunPanels(Cloth* cloth, const LinearProduct& product, size_t begin, size_t count) {
  const kernels::KernelTable& kernels = ActiveKernels();
  if (begin == 0) cloth->work.input_scales = QuantizeInput(kernels, product);
  ApplyPanels(kernels, product, cloth->work.input_scales, begin, count);
}

float* MeshCoefficientsOf(const Cloth& cloth) { return cloth.coefficients + MeshCoefficientsAt(*cloth.model); }

constexpr Part kStatic = {
    [](const ModelView& model, uint32_t) {
      return PartSize{1, ProductCost(model.static_stage.hidden) + ProductCost(model.static_stage.increments)};
    },
    [](Cloth* cloth, size_t, size_t) {
      RunStaticStage(ActiveKernels(), cloth->model->static_stage, cloth->features, cloth->hidden, cloth->quantized,
                     cloth->increments[NextTick(*cloth)]);
    },
    nullptr, nullptr};

constexpr Part kSkeletonInput = {
    [](const ModelView& model, uint32_t stages) {
      const LinearView& input = model.skeleton_stage.input;
      return RunsSkeleton(model, stages) ? ProductSize(input, input.rows) : PartSize{};
    },
    nullptr,
    [](const Cloth& cloth) {
      return SkeletonInput(cloth.model->skeleton_stage, cloth.features, cloth.skeleton, cloth.quantized);
    },
    [](const Cloth& cloth, uint32_t, const TickWork& at, StateSpans* spans) {
      if (at.part > TickPart::kSkeletonGates) return;
      const size_t gates = size_t{3} * cloth.model->skeleton_stage.units;
      spans->AddRow("input_gates", cloth.skeleton.gx, Made(at, TickPart::kSkeletonInput, gates));
    }};

constexpr Part kSkeletonHidden = {
    [](const ModelView& model, uint32_t stages) {
      const format::SkeletonStageView& stage = model.skeleton_stage;
      return RunsSkeleton(model, stages) ? ProductSize(stage.hidden, stage.units) : PartSize{};
    },
    nullptr,
    [](const Cloth& cloth) {
      return SkeletonHidden(cloth.model->skeleton_stage, cloth.coefficients, cloth.skeleton, cloth.quantized);
    },
    [](const Cloth& cloth, uint32_t, const TickWork& at, StateSpans* spans) {
      if (at.part > TickPart::kSkeletonGates) return;
      const size_t gates = size_t{3} * cloth.model->skeleton_stage.units;
      spans->AddRow("hidden_gates", cloth.skeleton.gh, Made(at, TickPart::kSkeletonHidden, gates));
    }};

constexpr Part kSkeletonGates = {
    [](const ModelView& model, uint32_t stages) {
      return RunsSkeleton(model, stages) ? PartSize{1, model.skeleton_stage.units * kPerGate} : PartSize{};
    },
    [](Cloth* cloth, size_t, size_t) {
      RunSkeletonGates(ActiveKernels(), cloth->model->skeleton_stage, cloth->skeleton, cloth->coefficients);
    },
    nullptr, nullptr};

constexpr Part kBodyPoints = {
    [](const ModelView& model, uint32_t stages) {
      return RunsMesh(model, stages) ? PartSize{MeshBlocks(model), kernels::kGsgruBlock * kPerSkinnedVertex}
                                     : PartSize{};
    },
    [](Cloth* cloth, size_t begin, size_t count) {
      PoseBodyPoints(ActiveKernels(), *cloth->model, cloth->mesh, begin, count);
    },
    nullptr,
    [](const Cloth& cloth, uint32_t stages, const TickWork& at, StateSpans* spans) {
      if (at.part > TickPart::kBodyPoints || !RunsMesh(*cloth.model, stages)) return;
      spans->AddRow("body_matrices", cloth.mesh.matrices, size_t{12} * cloth.model->joint_count);
      if (at.part != TickPart::kBodyPoints) return;
      const size_t n = cloth.model->vertex_count, done = at.items_done * kernels::kGsgruBlock;
      spans->Add("layer_input", MeshLayerInput(cloth.mesh, 0), done < n ? done : n, 3, kernels::GsgruInputStride(3),
                 kLargestSaved);
    }};

constexpr Part kMeshLayers = {
    [](const ModelView& model, uint32_t stages) {
      if (!RunsMesh(model, stages)) return PartSize{};
      return PartSize{MeshBlocks(model) * model.mesh_stage.layer_count, LayerBlockCost(model)};
    },
    [](Cloth* cloth, size_t begin, size_t count) {
      RunMeshLayers(ActiveKernels(), *cloth->model, cloth->mesh, begin, count);
    },
    nullptr,
    [](const Cloth& cloth, uint32_t, const TickWork& at, StateSpans* spans) {
      const ModelView& model = *cloth.model;
      const MeshMemory& mesh = cloth.mesh;
      const size_t n = model.vertex_count;
      if (at.part > TickPart::kMeshLayers && at.part <= TickPart::kMeshHidden)
        spans->AddRow("embedded", mesh.embedded, n);
      if (at.part != TickPart::kMeshLayers) return;
      const size_t width = model.mesh_stage.feature_width, layer = at.items_done / MeshBlocks(model);
      const size_t begun = at.items_done % MeshBlocks(model) * kernels::kGsgruBlock, done = begun < n ? begun : n;
      const size_t inputs = layer == 0 ? 3 : width;
      spans->Add("layer_input", MeshLayerInput(mesh, layer), n, inputs, kernels::GsgruInputStride(inputs),
                 kLargestSaved);
      if (layer + 1 == model.mesh_stage.layer_count) {
        spans->AddRow("embedded", mesh.embedded, done);
      } else {
        spans->Add("layer_output", MeshLayerInput(mesh, layer + 1), done, width, width, kLargestSaved);
      }
    }};

constexpr Part kMeshHidden = {
    [](const ModelView& model, uint32_t stages) {
      return RunsMesh(model, stages) ? ProductSize(model.mesh_stage.hidden, model.mesh_stage.hidden.rows) : PartSize{};
    },
    nullptr, [](const Cloth& cloth) { return MeshHidden(cloth.model->mesh_stage, cloth.mesh, cloth.quantized); },
    [](const Cloth& cloth, uint32_t stages, const TickWork& at, StateSpans* spans) {
      if (at.part > TickPart::kMeshCoefficients || !RunsMesh(*cloth.model, stages)) return;
      const size_t columns = cloth.model->mesh_stage.hidden.columns;
      spans->AddRow("mesh_hidden", cloth.mesh.hidden, Made(at, TickPart::kMeshHidden, columns));
    }};

constexpr Part kMeshCoefficients = {
    [](const ModelView& model, uint32_t stages) {
      const LinearView& linear = model.mesh_stage.coefficients;
      return RunsMesh(model, stages) ? ProductSize(linear, linear.rows) : PartSize{};
    },
    nullptr,
    [](const Cloth& cloth) {
      return MeshCoefficients(cloth.model->mesh_stage, cloth.mesh, cloth.quantized, MeshCoefficientsOf(cloth));
    },
    [](const Cloth& cloth, uint32_t stages, const TickWork& at, StateSpans* spans) {
      if (at.part > TickPart::kHead || !RunsMesh(*cloth.model, stages)) return;
      const size_t columns = cloth.model->mesh_stage.coefficients.columns;
      spans->AddRow("mesh_coefficients", MeshCoefficientsOf(cloth), Made(at, TickPart::kMeshCoefficients, columns));
    }};

constexpr Part kHead = {
    [](const ModelView& model, uint32_t stages) {
      return RunsSkeleton(model, stages) ? PartSize{1, kPerGate + ProductCost(model.displacement.head)} : PartSize{};
    },
    [](Cloth* cloth, size_t, size_t) {
      const ModelView& model = *cloth->model;
      MixCoefficients(ActiveKernels(), model, cloth->stages, cloth->coefficients, cloth->quantized);
    },
    nullptr,
    [](const Cloth& cloth, uint32_t stages, const TickWork& at, StateSpans* spans) {
      if (at.part <= TickPart::kHead || !RunsSkeleton(*cloth.model, stages)) return;
      // Without a head the basis multiplies Q itself; with one, what the head has mixed.
      const LinearView& head = cloth.model->displacement.head;
      if (head.rows != 0) {
        spans->AddRow("mixed_coefficients", cloth.coefficients + MixedCoefficientsAt(*cloth.model), head.columns);
      } else if (RunsMesh(*cloth.model, stages)) {
        spans->AddRow("mesh_coefficients", MeshCoefficientsOf(cloth), cloth.model->mesh_stage.coefficients.columns);
      }
    }};

LinearProduct BasisProduct(const Cloth& cloth) {
  return DisplacementProduct(*cloth.model, cloth.stages, cloth.coefficients, cloth.quantized,
                             cloth.displacement[NextTick(cloth)]);
}

constexpr Part kBasis = {
    [](const ModelView& model, uint32_t stages) {
      const format::DisplacementView& displacement = model.displacement;
      if (displacement.skeleton_rows == 0) return PartSize{};
      if (!RunsSkeleton(model, stages)) return PartSize{1, DisplacementFloats(model) * sizeof(float) * kPerByte};
      return ProductSize(displacement.basis,
                         displacement.skeleton_rows + (RunsMesh(model, stages) ? displacement.mesh_rows : 0));
    },
    [](Cloth* cloth, size_t begin, size_t count) {
      if (RunsSkeleton(*cloth->model, cloth->stages)) {
        RunPanels(cloth, BasisProduct(*cloth), begin, count);
      } else {
        std::memset(cloth->displacement[NextTick(*cloth)], 0, DisplacementFloats(*cloth->model) * sizeof(float));
      }
    },
    BasisProduct, nullptr};

constexpr Part kPatchInputs = {
    [](const ModelView& model, uint32_t stages) {
      const format::PatchStageView& stage = model.patch_stage;
      return RunsPatches(model, stages) ? PartSize{stage.patch_count, stage.point_count * kPerPatchPoint} : PartSize{};
    },
    [](Cloth* cloth, size_t begin, size_t count) { ReadPatches(*cloth->model, cloth->patches, begin, count); }, nullptr,
    [](const Cloth& cloth, uint32_t stages, const TickWork& at, StateSpans* spans) {
      const ModelView& model = *cloth.model;
      if (at.part > TickPart::kPatchLayers || !RunsPatches(model, stages)) return;
      const format::PatchStageView& stage = model.patch_stage;
      const PatchMemory& patches = cloth.patches;
      spans->AddRow("patch_pose", patches.pose, PatchPoseFloats(model));
      const size_t done = at.part < TickPart::kPatchInputs   ? 0
                          : at.part > TickPart::kPatchInputs ? stage.patch_count
                                                             : at.items_done;
      spans->AddRow("patch_frames", patches.frames, done * PatchFrameFloats(stage.point_count));
      spans->Add("patch_inputs", patches.rows + stage.width, done, stage.enter.rows, PatchRowFloats(stage),
                 kLargestSaved);
    }};

// Items are layers of all patches; an average keeps them alike.
uint64_t PatchLayerCost(const format::PatchStageView& stage) {
  uint64_t cost = 0;
  const auto add = [&](const LinearView& linear) {
    const bool integers = linear.type == format::WeightType::kI8;
    cost += uint64_t{linear.rows} * linear.columns * (integers ? kPerIntegerPatchProduct : kPerPatchProduct);
  };
  for (const LinearView* linear : {&stage.enter, &stage.input_gates, &stage.hidden_gates, &stage.out}) add(*linear);
  for (uint32_t l = 0; l < stage.layer_count; ++l) add(stage.mix[l]);
  return stage.patch_count * (stage.width * kPerGate + cost) / PatchLayerItems(stage);
}

constexpr Part kPatchLayers = {
    [](const ModelView& model, uint32_t stages) {
      const format::PatchStageView& stage = model.patch_stage;
      return RunsPatches(model, stages) ? PartSize{PatchLayerItems(stage), PatchLayerCost(stage)} : PartSize{};
    },
    [](Cloth* cloth, size_t begin, size_t count) {
      RunPatchLayers(ActiveKernels(), *cloth->model, cloth->patches, begin, count);
    },
    nullptr,
    [](const Cloth& cloth, uint32_t, const TickWork& at, StateSpans* spans) {
      const format::PatchStageView& stage = cloth.model->patch_stage;
      // After the gates nothing reads them.
      if (at.part != TickPart::kPatchLayers || at.items_done == 0 || at.items_done + 1 == PatchLayerItems(stage))
        return;
      spans->Add("patch_features", cloth.patches.features, stage.patch_count, stage.width,
                 kernels::PaddedColumns(stage.width), kLargestSaved);
    }};

// A level without moving stages has no displacement.
constexpr Part kPatchMap = {
    [](const ModelView& model, uint32_t stages) {
      const format::PatchStageView& stage = model.patch_stage;
      if (stage.patch_count == 0) return PartSize{};
      if (!RunsPatches(model, stages)) return PartSize{1, DisplacementFloats(model) * sizeof(float) * kPerByte};
      return PartSize{PatchMapItems(stage),
                      ProductCost(stage.map) / PatchMapItems(stage) + kMapPoints * kPerPatchGroup};
    },
    [](Cloth* cloth, size_t begin, size_t count) {
      const ModelView& model = *cloth->model;
      float* const displacement = cloth->displacement[NextTick(*cloth)];
      if (RunsPatches(model, cloth->stages)) {
        MapPatches(ActiveKernels(), model.patch_stage, cloth->patches, begin, count, displacement);
      } else {
        std::memset(displacement, 0, DisplacementFloats(model) * sizeof(float));
      }
    },
    nullptr, nullptr};

const Part& RowOf(TickPart part) {
#define DCLOTH_PART(part, number, name, step) &k##part,
  static constexpr const Part* kRows[] = {DCLOTH_TICK_PARTS(DCLOTH_PART)};
#undef DCLOTH_PART
  return *kRows[static_cast<size_t>(part)];
}

TickPart After(TickPart part) { return static_cast<TickPart>(static_cast<uint32_t>(part) + 1); }

void RunItems(Cloth* cloth, TickPart part, size_t begin, size_t count) {
  const Part& row = RowOf(part);
  if (row.run != nullptr) {
    row.run(cloth, begin, count);
  } else {
    RunPanels(cloth, row.product(*cloth), begin, count);
  }
}

void Publish(Cloth* cloth) {
  cloth->newest = NextTick(*cloth);
  if (cloth->tick_count < kTickSlots) ++cloth->tick_count;
}

}  // namespace

uint64_t TickCost(const ModelView& model, uint32_t stages) {
  uint64_t cost = 0;
  for (TickPart part = TickPart::kStatic; part != TickPart::kDone; part = After(part)) {
    const PartSize size = RowOf(part).size(model, stages);
    cost += size.items * size.item_cost;
  }
  return cost;
}

void BeginTick(Cloth* cloth, const SkinPose& skin, uint32_t stages, double elapsed_ticks, Stopwatch* watch) {
  const ModelView& model = *cloth->model;
  double wind[3];
  VectorFromHost(cloth->rig.space, cloth->wind, wind);
  const PatchMotion motion = MotionOf(*cloth, skin, wind, elapsed_ticks);
  UpdateFeatures(model, skin, wind, elapsed_ticks, &cloth->root, cloth->features);
  WakeStages(cloth, stages);
  if (RunsPatches(model, stages)) PreparePatches(model, skin, motion, cloth->patches);
  if (RunsMesh(model, stages)) PrepareBodyPoints(model, skin, cloth->root.heading, cloth->mesh);
  cloth->work = {TickPart::kStatic, 0, {}};
  watch->Lap(DCLOTH_STEP_POSE, "pose");
}

uint64_t TickItems(const ModelView& model, uint32_t stages, TickPart part) {
  return part == TickPart::kDone ? 0 : RowOf(part).size(model, stages).items;
}

// The integers of a product are made anew from its input, which it does not change.
void ResumeTick(Cloth* cloth, TickPart part, uint32_t items_done) {
  const FloatEnvironment arithmetic(ActiveSubnormals());
  cloth->work = {part, items_done, {}};
  if (items_done == 0 || RowOf(part).product == nullptr) return;
  cloth->work.input_scales = QuantizeInput(ActiveKernels(), RowOf(part).product(*cloth));
}

void ListTickSpans(const Cloth& cloth, uint32_t stages, const TickWork& at, StateSpans* spans) {
  for (TickPart part = TickPart::kStatic; part != TickPart::kDone; part = After(part)) {
    const Part& row = RowOf(part);
    if (row.save != nullptr) row.save(cloth, stages, at, spans);
  }
}

uint64_t ContinueTick(Cloth* cloth, uint64_t budget, Stopwatch* watch) {
  TickWork& work = cloth->work;
  uint64_t spent = 0;
  while (TickInWork(*cloth)) {
    const PartSize size = RowOf(work.part).size(*cloth->model, cloth->stages);
    const uint64_t left = size.items - work.items_done;
    if (left == 0) {
      work.part = After(work.part);
      work.items_done = 0;
      if (work.part == TickPart::kDone) Publish(cloth);
      continue;
    }
    if (spent >= budget) break;
    const uint64_t wanted = (budget - spent - 1) / size.item_cost + 1;
    const uint64_t count = wanted < left ? wanted : left;
    RunItems(cloth, work.part, work.items_done, static_cast<size_t>(count));
    const format::TickPartFacts& facts = format::FactsOf(work.part);
    watch->Lap(facts.step, facts.name);
    work.items_done += static_cast<uint32_t>(count);
    spent += count * size.item_cost;
  }
  return spent;
}

}  // namespace dcloth::engine

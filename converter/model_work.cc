#include "converter/model_work.h"

#ifndef FLATBUFFERS_MAX_ALIGNMENT
#define FLATBUFFERS_MAX_ALIGNMENT 64  // FlatBuffers' own limit is 16
#endif
#include "dcloth/dcloth.h"
#include "dcloth_generated.h"
#include "kernels/matvec/matvec.h"

namespace dcloth::converter {
namespace {

constexpr uint64_t kFloat = sizeof(float);
// tanh and the logistic function: x^2, seven and four terms of a rational function, a division, two clamps.
constexpr uint64_t kActivationFlops = 25;

uint64_t Extent(const format::Tensor* tensor, uint32_t axis) { return tensor->shape()->Get(axis); }

// y = x W + bias: weights and scales once, x read, y written.
PartWork Product(const format::Linear* linear) {
  if (linear == nullptr) return {};
  const uint64_t rows = Extent(linear->weights(), 0), columns = Extent(linear->weights(), 1);
  const bool int8 = linear->weights()->dtype() == format::DType_I8;
  const uint64_t width = int8 ? 1 : linear->weights()->dtype() == format::DType_F16 ? 2 : kFloat;
  PartWork work;
  work.flops = 2 * rows * columns;
  work.weight_bytes = (int8 ? rows + rows % 2 : rows) * kernels::PaddedColumns(columns) * width;
  if (int8) work.weight_bytes += (rows + kernels::PaddedColumns(columns)) * kFloat;
  if (linear->bias() != nullptr) work.weight_bytes += kernels::PaddedColumns(columns) * kFloat;
  work.state_bytes = (rows + columns) * kFloat;
  work.int8 = int8;
  return work;
}

PartWork Sum(PartWork a, const PartWork& b) {
  a.flops += b.flops;
  a.weight_bytes += b.weight_bytes;
  a.state_bytes += b.state_bytes;
  return a;
}

PartWork CountStatic(const format::Model* model) {
  return Sum(Product(model->static_stage()->hidden()), Product(model->static_stage()->increments()));
}

// A stage's product; none where the model lacks the stage.
template <typename Stage>
PartWork StageProduct(const Stage* stage, const format::Linear* (Stage::*linear)() const) {
  return stage == nullptr ? PartWork{} : Product((stage->*linear)());
}

PartWork CountSkeletonInput(const format::Model* model) {
  return StageProduct(model->skeleton_stage(), &format::SkeletonStage::input);
}

// Integers are multiplied by the state and by what rounding leaves of it; the weights are read once.
PartWork CountSkeletonHidden(const format::Model* model) {
  PartWork work = StageProduct(model->skeleton_stage(), &format::SkeletonStage::hidden);
  if (work.int8) work.flops *= 2;
  return work;
}

PartWork CountMeshHidden(const format::Model* model) {
  return StageProduct(model->mesh_stage(), &format::MeshStage::hidden);
}

PartWork CountMeshCoefficients(const format::Model* model) {
  return StageProduct(model->mesh_stage(), &format::MeshStage::coefficients);
}

// P through the head of a reduced basis.
PartWork CountHead(const format::Model* model) {
  return StageProduct(model->displacement(), &format::Displacement::head);
}

PartWork CountBasis(const format::Model* model) {
  return StageProduct(model->displacement(), &format::Displacement::basis);
}

// r, z and q of k units, then h' = (1 - z) q + z h, from two vectors of 3 k.
PartWork CountSkeletonGates(const format::Model* model) {
  if (model->skeleton_stage() == nullptr) return {};
  const uint64_t units = Extent(model->skeleton_stage()->hidden()->weights(), 0);
  return {units * (3 * kActivationFlops + 8), 0, (6 + 2) * units * kFloat, false};
}

// The matrix of a vertex is the weighted sum of its bones' (12 numbers), then it moves a point.
uint64_t SkinningFlops(uint64_t influences) { return 24 * influences + 18; }

PartWork CountBodyPoints(const format::Model* model) {
  const format::MeshStage* mesh = model->mesh_stage();
  if (mesh == nullptr) return {};
  const uint64_t n = model->garment()->vertices();
  const uint64_t influences = mesh->body_influences();
  PartWork work;
  work.flops = n * SkinningFlops(influences);
  work.weight_bytes = n * (3 * kFloat + influences * (1 + kFloat));
  work.state_bytes = n * 4 * kFloat;  // rows of three at a stride of four
  return work;
}

PartWork CountMeshLayers(const format::Model* model) {
  const format::MeshStage* mesh = model->mesh_stage();
  if (mesh == nullptr) return {};
  const uint64_t n = model->garment()->vertices();
  const uint64_t f = mesh->feature_width(), edges = Extent(mesh->columns(), 0);
  PartWork work;
  for (uint32_t l = 0; l < mesh->layers()->size(); ++l) {
    const uint64_t w = l == 0 ? 3 : f;
    const uint64_t products = 3 * w * f + 2 * f * f + f * f + f * f;  // gates of x, of h, candidate, output
    const uint64_t aggregation = edges * w + n * w;                   // sum of neighbours, their number divided out
    const uint64_t gates = n * f * (3 * kActivationFlops + 8);
    const uint64_t norm = n * f * (4 + 4 + 2);  // mean and variance, LayerNorm, PReLU
    work.flops += 2 * n * products + aggregation + gates + norm;
    const bool int8 = mesh->layers()->Get(l)->weights() != nullptr;
    const uint64_t points = l == 0 ? 3 * w * f : 0, columns = l == 0 ? 4 * f : 8 * f;  // scales, and steps of inputs
    work.weight_bytes += int8 ? (products - points) + points * kFloat + columns * kFloat : products * kFloat;
    work.weight_bytes += (3 * f + 3 * f) * kFloat + (n + 1) * sizeof(uint32_t) + edges * 2;
    work.int8 = work.int8 || int8;
    const bool last = l + 1 == mesh->layers()->size();
    work.state_bytes += n * kFloat * ((l == 0 ? 4 : f) + 2 * f + (last ? 1 : f));  // x, state in and out, next x
    if (last) work.flops += n * 2 * f;
  }
  return work;
}

PartWork CountSkinning(const format::Model* model) {
  const uint64_t n = model->garment()->vertices();
  const uint64_t influences = model->static_stage()->influences();
  PartWork work;
  work.flops = n * (SkinningFlops(influences) + 12);  // the displacement between two ticks, added
  work.weight_bytes = n * (3 * kFloat + influences * (1 + kFloat));
  work.state_bytes = n * (2 + 1) * 3 * kFloat;
  return work;
}

// Per triangle two edges, their cross product and three sums; per vertex a length, a division, three products.
PartWork CountNormals(const format::Model* model) {
  const uint64_t n = model->garment()->vertices();
  const uint64_t triangles = Extent(model->garment()->faces(), 0);
  return {triangles * (6 + 9 + 9) + n * 10, triangles * 3 * sizeof(uint16_t), n * (1 + 2 + 2) * 3 * kFloat, false};
}

// A patch's frame, bases of its points from four joints each, and for each point two limbs of two capsules: a place on
// the axis, a root, a quotient and an exponential.
PartWork CountPatchInputs(const format::Model* model) {
  const format::PatchStage* stage = model->patch_stage();
  if (stage == nullptr) return {};
  const uint64_t patches = stage->patches(), points = patches * stage->points();
  const uint64_t inputs = patches * Extent(stage->enter()->weights(), 0);
  constexpr uint64_t kBase = 96, kCloth = 60, kCapsule = 50, kLimb = 2 * kCapsule + 35;
  PartWork work;
  work.flops = points * (kBase + kCloth + 2 * kLimb) + patches * 200;
  work.weight_bytes = points * 4 * (1 + 4 * kFloat) + patches * (12 * kFloat + 5);
  work.state_bytes = (points * (3 * 3 + 3) + inputs) * kFloat;
  return work;
}

// The weights are read once for all patches.
PartWork CountPatchLayers(const format::Model* model) {
  const format::PatchStage* stage = model->patch_stage();
  if (stage == nullptr) return {};
  const uint64_t patches = stage->patches(), width = stage->width();
  PartWork work;
  const auto add = [&](const format::Linear* linear) {
    PartWork product = Product(linear);
    product.flops *= patches;
    product.state_bytes *= patches;
    work = Sum(work, product);
    work.int8 = work.int8 || product.int8;
  };
  add(stage->enter());
  for (const format::Linear* mix : *stage->mix()) add(mix);
  for (const format::Linear* linear : {stage->input_gates(), stage->hidden_gates(), stage->out()}) add(linear);
  work.flops += patches * width * (3 * kActivationFlops + 8);
  work.state_bytes += patches * (6 + 2) * width * kFloat;
  return work;
}

// Each group of vertices from its own points.
PartWork CountPatchMap(const format::Model* model) {
  const format::PatchStage* stage = model->patch_stage();
  if (stage == nullptr) return {};
  PartWork work = Product(stage->map());
  const uint64_t groups = uint64_t{stage->patches()} * stage->points(), rows = Extent(stage->map()->weights(), 0);
  work.state_bytes = (groups * rows + 3 * uint64_t{model->garment()->vertices()}) * kFloat;
  return work;
}

}  // namespace

const char* WorkPartName(WorkPart part) {
  if (part == WorkPart::kSkinning) return "skinning";
  return part == WorkPart::kNormals ? "normals" : format::kTickParts[static_cast<size_t>(part)].name;
}

bool FindWorkPart(std::string_view name, WorkPart* part) {
  for (size_t p = 0; p < kWorkPartCount; ++p) {
    if (name != WorkPartName(static_cast<WorkPart>(p))) continue;
    *part = static_cast<WorkPart>(p);
    return true;
  }
  return false;
}

int StepOf(WorkPart part) {
  if (part == WorkPart::kSkinning) return DCLOTH_STEP_SKINNING;
  return part == WorkPart::kNormals ? DCLOTH_STEP_NORMALS : format::kTickParts[static_cast<size_t>(part)].step;
}

ModelWork CountWork(std::span<const std::byte> bytes) {
  const format::Model* model = format::GetModel(bytes.data());
#define DCLOTH_PART(part, number, name, step) Count##part(model),
  return {DCLOTH_TICK_PARTS(DCLOTH_PART) CountSkinning(model), CountNormals(model)};
#undef DCLOTH_PART
}

PatchSizes PatchSizesOf(std::span<const std::byte> bytes) {
  const format::PatchStage* stage = format::GetModel(bytes.data())->patch_stage();
  if (stage == nullptr) return {};
  return {stage->patches(), stage->points(), stage->width(), static_cast<uint32_t>(Extent(stage->sources(), 1))};
}

}  // namespace dcloth::converter

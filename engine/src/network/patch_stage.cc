#include "engine/src/network/patch_stage.h"

#include <cstring>
#include <initializer_list>

#include "kernels/matvec/quantize.h"

namespace dcloth::engine {
namespace {

using format::LinearView;
using format::ModelView;
using format::PatchStageView;

constexpr float kOutStep = 0.1f;           // of `out`, metres
constexpr float kFarthestFromBase = 0.8f;  // metres along each axis: the inputs tell no more

// A body that is still for long has cloth at rest: time runs slower for the state, and stops. The network alone may
// creep or tremble there for ever, as it was not trained for minutes, and an idle character would never freeze.
constexpr float kStillMetres = 5e-5f;         // a tick, of limbs and of the places where patches hang
constexpr float kSwings = 45, kSettles = 30;  // ticks that cloth swings on, and that its steps then take to end

size_t PatchFloats(const PatchStageView& stage) { return kAxes * stage.point_count; }
size_t AllPoints(const PatchStageView& stage) { return stage.patch_count * PatchFloats(stage); }
size_t Inputs(const PatchStageView& stage) { return stage.enter.rows; }
size_t FeatureStride(const PatchStageView& stage) { return kernels::PaddedColumns(stage.width); }

size_t ProductStride(const PatchStageView& stage) {
  const size_t gates = kernels::PaddedColumns(size_t{3} * stage.width);
  const size_t out = kernels::PaddedColumns(PatchFloats(stage));
  return gates > out ? gates : out;
}

// Parts of PatchMemory::cloth.
struct Cloths {
  float *displacement, *last, *before, *last_centres, *before_centres, *ends;
  float* still;  // [1] ticks since the body moved
};

Cloths ClothsOf(const PatchStageView& stage, const PatchMemory& memory) {
  const size_t points = AllPoints(stage), centres = kAxes * stage.patch_count;
  Cloths cloths = {};
  cloths.displacement = memory.cloth;
  cloths.last = cloths.displacement + points;
  cloths.before = cloths.last + points;
  cloths.last_centres = cloths.before + points;
  cloths.before_centres = cloths.last_centres + centres;
  cloths.ends = cloths.before_centres + centres;
  cloths.still = cloths.ends + size_t{6} * stage.capsule_count;
  return cloths;
}

PatchPose PoseOf(const ModelView& model, const PatchMemory& memory) {
  float* const after = memory.pose + size_t{12} * model.joint_count;
  return {memory.pose, after, after + 1};
}

PatchFrame FrameOf(const PatchStageView& stage, const PatchMemory& memory, size_t k) {
  return PatchFrameAt(memory.frames + k * PatchFrameFloats(stage.point_count));
}

// Metres from the hips of this tick, which have gone by `way`.
void Rebase(const float (&way)[kAxes], size_t patches, size_t points, float* places) {
  for (size_t i = 0; i < patches; ++i) {
    for (size_t c = 0; c < kAxes; ++c, places += points) {
      for (size_t r = 0; r < points; ++r) places[r] = BoundPlace(places[r] - way[c]);
    }
  }
}

size_t WidestQuantized(const PatchStageView& stage) {
  size_t widest = 0;
  const auto count = [&](const LinearView& linear) {
    const size_t elements = QuantizedElements(linear);
    if (elements > widest) widest = elements;
  };
  for (const LinearView* linear : {&stage.enter, &stage.input_gates, &stage.hidden_gates, &stage.out}) count(*linear);
  for (size_t l = 0; l < stage.layer_count; ++l) count(stage.mix[l]);
  // The map's integers are those of all points.
  if (stage.map.type == format::WeightType::kI8 && widest < PatchFloats(stage)) widest = PatchFloats(stage);
  return widest;
}

// A layer of all patches.
void Multiply(const kernels::KernelTable& kernels, const PatchStageView& stage, const LinearView& linear,
              const float* x, size_t x_stride, Activation activation, const PatchMemory& memory, float* y,
              size_t y_stride) {
  ApplyBatch(kernels,
             {&linear, x, x_stride, stage.patch_count, activation, memory.quantized, memory.scales, y, y_stride});
}

// f = f + ReLU(W [f, f of the neighbours] + b).
void Mix(const kernels::KernelTable& kernels, const PatchStageView& stage, size_t layer, const PatchMemory& memory) {
  const size_t width = stage.width, stride = FeatureStride(stage), rows = stage.mix[layer].rows;
  const uint8_t* near = stage.near + layer * stage.neighbour_count * stage.patch_count;
  for (size_t k = 0; k < stage.patch_count; ++k) {
    float* mixed = memory.mixed + k * rows;
    std::memcpy(mixed, memory.features + k * stride, width * sizeof(float));
    for (size_t s = 0; s < stage.neighbour_count; ++s) {
      mixed += width;
      std::memcpy(mixed, memory.features + near[s * stage.patch_count + k] * stride, width * sizeof(float));
    }
  }
  float* const made = memory.products[0];
  Multiply(kernels, stage, stage.mix[layer], memory.mixed, rows, Activation::kRelu, memory, made, stride);
  for (size_t i = 0; i < stage.patch_count * stride; ++i) memory.features[i] += made[i];
}

bool AreStill(const float* a, const float* b, size_t count) {
  bool still = true;
  for (size_t i = 0; i < count; ++i) still &= a[i] - b[i] <= kStillMetres && b[i] - a[i] <= kStillMetres;
  return still;
}

// One more tick that the body was still in, or none; before the state moves on. Against a state that has stopped,
// however slowly a body creeps is motion at last.
void CountStill(const ModelView& model, const PatchMemory& memory) {
  const PatchStageView& stage = model.patch_stage;
  const PatchPose pose = PoseOf(model, memory);
  const Cloths cloths = ClothsOf(stage, memory);
  float ends[6 * format::kMaxCapsules];
  PlaceCapsules(stage, pose, ends);
  bool still = pose.wind[0] == 0 && pose.wind[1] == 0 && pose.wind[2] == 0 &&
               AreStill(ends, cloths.ends, size_t{6} * stage.capsule_count);
  for (size_t k = 0; k < stage.patch_count; ++k)
    still &= AreStill(FrameOf(stage, memory, k).centre, cloths.last_centres + kAxes * k, kAxes);
  *cloths.still = still ? Clamp(0, kSwings + kSettles, *cloths.still + 1) : 0;
}

// How much of its step the state goes: all of it while the body moves, nothing when it was still for long.
float ShareOfStep(const Cloths& cloths) { return Clamp(0, 1, (kSwings + kSettles - *cloths.still) / kSettles); }

// h' of every patch.
void RunGates(const kernels::KernelTable& kernels, const ModelView& model, const PatchMemory& memory) {
  const PatchStageView& stage = model.patch_stage;
  const size_t width = stage.width, stride = ProductStride(stage);
  CountStill(model, memory);
  const float share = ShareOfStep(ClothsOf(stage, memory));
  if (share == 0) return;
  Multiply(kernels, stage, stage.input_gates, memory.features, FeatureStride(stage), Activation::kNone, memory,
           memory.products[0], stride);
  Multiply(kernels, stage, stage.hidden_gates, memory.hidden, width, Activation::kNone, memory, memory.products[1],
           stride);
  float* const before = memory.features;  // which the gates have read
  for (size_t k = 0; k < stage.patch_count; ++k) {
    float* const hidden = memory.hidden + k * width;
    std::memcpy(before, hidden, width * sizeof(float));
    kernels.gru_gates({memory.products[0] + k * stride, memory.products[1] + k * stride, hidden, width});
    if (share == 1) continue;
    for (size_t i = 0; i < width; ++i) hidden[i] = share * hidden[i] + (1 - share) * before[i];
  }
}

// u', and every position of the state one tick further back.
void MoveCloth(const kernels::KernelTable& kernels, const ModelView& model, const PatchMemory& memory) {
  const PatchStageView& stage = model.patch_stage;
  const size_t points = stage.point_count, floats = PatchFloats(stage), stride = ProductStride(stage);
  const Cloths cloths = ClothsOf(stage, memory);
  const float share = ShareOfStep(cloths);
  if (share == 0) return;
  for (size_t k = 0; k < stage.patch_count; ++k) {
    std::memcpy(memory.rows + k * PatchRowFloats(stage), memory.hidden + k * stage.width, stage.width * sizeof(float));
  }
  float* const made = memory.products[0];
  Multiply(kernels, stage, stage.out, memory.rows, PatchRowFloats(stage), Activation::kNone, memory, made, stride);
  std::memcpy(cloths.before, cloths.last, AllPoints(stage) * sizeof(float));
  std::memcpy(cloths.before_centres, cloths.last_centres, kAxes * stage.patch_count * sizeof(float));
  for (size_t k = 0; k < stage.patch_count; ++k) {
    const float* out = made + k * stride;
    float* const u = cloths.displacement + k * floats;
    for (size_t c = 0; c < kAxes; ++c) {
      for (size_t r = 0; r < points; ++r) {
        const size_t i = c * points + r;
        const float kept = 1 - share + share * stage.keep[r];
        u[i] = Clamp(-kFarthestFromBase, kFarthestFromBase, share * (kOutStep * out[i]) + kept * u[i]);
      }
    }
    const PatchFrame frame = FrameOf(stage, memory, k);
    PlacePoints(frame, u, points, cloths.last + k * floats);
    std::memcpy(cloths.last_centres + kAxes * k, frame.centre, kAxes * sizeof(float));
  }
  PlaceCapsules(stage, PoseOf(model, memory), cloths.ends);
}

// The map of all points' displacements to vertices, a group of vertices at a time. Integers share a step, that of the
// largest displacement: a group's products then begin by gathering.
class GroupMap {
 public:
  // `displacement` [K][3][R]; `steps` has room for as many integers where the map has int8 weights.
  GroupMap(const kernels::KernelTable& kernels, const PatchStageView& stage, const float* displacement, int16_t* steps)
      : kernels_(kernels), stage_(stage), displacement_(displacement), steps_(steps) {
    if (stage.map.type != format::WeightType::kI8) return;
    const size_t floats = AllPoints(stage);
    float largest = 0;
    for (size_t i = 0; i < floats; ++i) {
      const float u = kernels::FiniteProduct(displacement[i], 1), size = u < 0 ? -u : u;
      largest = size > largest ? size : largest;
    }
    static_assert(kRows * kernels::kQuantizedMax <= kernels::kQuantizedSumLimit, "no sum of a group overflows");
    scales_.x = largest > 0 ? kernels::QuantizedStep(largest) : 1;
    const float inverse = 1 / scales_.x;
    for (size_t i = 0; i < floats; ++i)
      steps[i] = static_cast<int16_t>(kernels::RoundToInt(kernels::FiniteProduct(displacement[i], 1) * inverse));
  }

  // The groups before `group` are left out.
  void Skip(size_t group) {
    for (size_t g = 0; g < group; ++g) panel_ += Panels(g);
  }

  // The next group: calls take(first vertex of the group, vertices, their displacement [vertices, 3]).
  template <typename Take>
  void Run(size_t g, const Take& take) {
    constexpr size_t kPanels = 6, kVertices = kPanels * kernels::kPanelColumns / kAxes;
    static_assert(kVertices * kAxes == kPanels * kernels::kPanelColumns, "whole vertices");
    float x[kRows];
    alignas(64) int16_t quantized[kRows];
    if (stage_.map.type == format::WeightType::kI8) {
      Gather(steps_, g, quantized);
    } else {
      Gather(displacement_, g, x);
    }
    const LinearProduct product = {&stage_.map, x, stage_.map.rows, Activation::kNone, quantized, nullptr};
    const size_t vertices = stage_.group_starts[g + 1] - stage_.group_starts[g], first_panel = panel_;
    panel_ += Panels(g);
    for (size_t v = 0, panel = first_panel; v < vertices; v += kVertices, panel += kPanels) {
      alignas(64) float made[kPanels * kernels::kPanelColumns];
      const size_t panels = panel_ - panel, count = vertices - v;
      ApplyPanelsTo(kernels_, product, scales_, panel, panels < kPanels ? panels : kPanels, made);
      take(v, count < kVertices ? count : kVertices, made);
    }
  }

 private:
  static constexpr size_t kRows = kAxes * format::kMaxSources;

  size_t Panels(size_t g) const {
    return kernels::PanelCount(kAxes * (stage_.group_starts[g + 1] - stage_.group_starts[g]));
  }

  template <typename T>
  void Gather(const T* all, size_t g, T* x) const {
    const size_t points = stage_.point_count;
    const uint16_t* sources = stage_.sources + g * stage_.source_count;
    for (size_t m = 0; m < stage_.source_count; ++m) {
      const T* u = all + sources[m] / points * PatchFloats(stage_) + sources[m] % points;
      for (size_t b = 0; b < kAxes; ++b) x[kAxes * m + b] = u[b * points];
    }
  }

  const kernels::KernelTable& kernels_;
  const PatchStageView& stage_;
  const float* displacement_;
  const int16_t* steps_;
  InputScales scales_;
  size_t panel_ = 0;
};

}  // namespace

size_t PatchClothFloats(const PatchStageView& stage) {
  return 3 * AllPoints(stage) + 2 * kAxes * stage.patch_count + size_t{6} * stage.capsule_count + 1;
}

size_t PatchPoseFloats(const ModelView& model) { return size_t{12} * model.joint_count + 1 + kAxes; }

size_t PatchRowFloats(const PatchStageView& stage) { return stage.width + Inputs(stage); }

PatchMemory PlacePatchMemory(const ModelView& model, Arena* arena) {
  const PatchStageView& stage = model.patch_stage;
  const size_t patches = stage.patch_count;
  PatchMemory memory = {};
  if (patches == 0) return memory;
  memory.cloth = arena->Take<float>(PatchClothFloats(stage));
  memory.hidden = arena->Take<float>(patches * stage.width);
  memory.pose = arena->Take<float>(PatchPoseFloats(model));
  memory.frames = arena->Take<float>(patches * PatchFrameFloats(stage.point_count));
  memory.rows = arena->Take<float>(patches * PatchRowFloats(stage));
  memory.features = arena->Take<float>(patches * FeatureStride(stage));
  const size_t product = ProductStride(stage), mixed = (1 + size_t{stage.neighbour_count}) * stage.width;
  memory.products[0] = arena->Take<float>(patches * product);
  memory.products[1] = memory.mixed = arena->Take<float>(patches * (mixed > product ? mixed : product));
  memory.quantized = arena->Take<int16_t>(patches * WidestQuantized(stage));
  memory.scales = arena->Take<float>(patches);
  return memory;
}

void ClearPatchState(const PatchStageView& stage, const PatchMemory& memory) {
  if (stage.patch_count == 0) return;
  std::memset(memory.cloth, 0, PatchClothFloats(stage) * sizeof(float));
  std::memset(memory.hidden, 0, size_t{stage.patch_count} * stage.width * sizeof(float));
}

void PreparePatches(const ModelView& model, const SkinPose& skin, const PatchMotion& motion,
                    const PatchMemory& memory) {
  const PatchStageView& stage = model.patch_stage;
  const PatchPose pose = PoseOf(model, memory);
  const Cloths cloths = ClothsOf(stage, memory);
  for (size_t j = 0; j < model.joint_count; ++j) StoreFloats(skin.joints[j], pose.matrices + 12 * j);
  *pose.share = motion.carried ? 0 : motion.elapsed_ticks > 1 ? static_cast<float>(1 / motion.elapsed_ticks) : 1;
  float way[kAxes];
  for (size_t c = 0; c < kAxes; ++c) {
    pose.wind[c] = static_cast<float>(motion.wind[c]);
    way[c] = static_cast<float>(motion.hips_way[c]);
  }
  Rebase(way, stage.patch_count, stage.point_count, cloths.last);
  Rebase(way, stage.patch_count, 1, cloths.last_centres);
  Rebase(way, 2 * size_t{stage.capsule_count}, 1, cloths.ends);
  if (!motion.carried) {
    Rebase(way, stage.patch_count, stage.point_count, cloths.before);
    Rebase(way, stage.patch_count, 1, cloths.before_centres);
    return;
  }
  // At rest where it is carried to.
  std::memcpy(cloths.before, cloths.last, AllPoints(stage) * sizeof(float));
  std::memcpy(cloths.before_centres, cloths.last_centres, kAxes * stage.patch_count * sizeof(float));
}

void ReadPatches(const ModelView& model, const PatchMemory& memory, size_t begin, size_t count) {
  const PatchStageView& stage = model.patch_stage;
  const PatchPose pose = PoseOf(model, memory);
  const Cloths cloths = ClothsOf(stage, memory);
  CapsuleMotion capsules[format::kMaxCapsules];
  MoveCapsules(stage, pose, cloths.ends, capsules);
  for (size_t k = begin; k < begin + count; ++k) {
    const size_t points = k * PatchFloats(stage), centre = kAxes * k;
    const PatchHistory history = {cloths.displacement + points, cloths.last + points, cloths.before + points,
                                  cloths.last_centres + centre, cloths.before_centres + centre};
    ReadPatch(stage, pose, capsules, k, history, FrameOf(stage, memory, k),
              memory.rows + k * PatchRowFloats(stage) + stage.width);
  }
}

size_t PatchLayerItems(const PatchStageView& stage) { return size_t{stage.layer_count} + 3; }

void RunPatchLayers(const kernels::KernelTable& kernels, const ModelView& model, const PatchMemory& memory,
                    size_t begin, size_t count) {
  const PatchStageView& stage = model.patch_stage;
  for (size_t item = begin; item < begin + count; ++item) {
    if (item == 0) {
      Multiply(kernels, stage, stage.enter, memory.rows + stage.width, PatchRowFloats(stage), Activation::kRelu, memory,
               memory.features, FeatureStride(stage));
    } else if (item <= stage.layer_count) {
      Mix(kernels, stage, item - 1, memory);
    } else if (item == size_t{stage.layer_count} + 1) {
      RunGates(kernels, model, memory);
    } else {
      MoveCloth(kernels, model, memory);
    }
  }
}

size_t PatchMapItems(const PatchStageView& stage) {
  return (size_t{stage.patch_count} * stage.point_count + kMapPoints - 1) / kMapPoints;
}

void MapPatches(const kernels::KernelTable& kernels, const PatchStageView& stage, const PatchMemory& memory,
                size_t begin, size_t count, float* displacement) {
  const size_t groups = size_t{stage.patch_count} * stage.point_count;
  const size_t first = begin * kMapPoints, wanted = (begin + count) * kMapPoints;
  GroupMap map(kernels, stage, PatchDisplacement(memory), memory.quantized);
  map.Skip(first);
  for (size_t g = first; g < groups && g < wanted; ++g) {
    const uint16_t* vertices = stage.vertices + stage.group_starts[g];
    map.Run(g, [&](size_t vertex, size_t made_count, const float* made) {
      for (size_t i = 0; i < made_count; ++i)
        std::memcpy(displacement + kAxes * vertices[vertex + i], made + kAxes * i, kAxes * sizeof(float));
    });
  }
}

bool ArePatchesAtRest(const PatchStageView& stage, const PatchMemory& memory) {
  return ShareOfStep(ClothsOf(stage, memory)) == 0;
}

uint32_t PatchShape(const PatchStageView& stage) {
  if (stage.patch_count == 0) return 0;
  static_assert(format::kMaxPatches <= 1 << 9 && format::kMaxPatchPoints < 1 << 5 &&
                format::kMaxPatchWidth / format::kPatchWidthStep < 1 << 6 && format::kMaxCapsules < 1 << 6);
  return stage.patch_count | stage.point_count << 9 | stage.width / format::kPatchWidthStep << 14 |
         stage.capsule_count << 20;
}

}  // namespace dcloth::engine

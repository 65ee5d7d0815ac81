#include "engine/src/contact/contact.h"

#include <cmath>

#include "engine/src/contact/skin_search.h"
#include "engine/src/contact/steps.h"

namespace dcloth::engine {
namespace {

using format::BodyView;
using format::ModelView;

constexpr float kFade = 6;             // offsets fade at this rate, 1/s
constexpr float kLeastOffset = 1e-3f;  // metres: less is none
constexpr float kOnTrunk = 0.012f;     // metres over it when bound: cloth that stays
constexpr int kStartSteps = 2;         // from the bind pose to the first frame's
constexpr float kLongestGap = 0.5f;    // seconds without a drawn frame; then the last one tells nothing

// exp(-x) within 0.2 % for a frame's time; libm's last bit differs from system to system.
float Fading(float x) { return 1 / (1 + x * (1 + 0.5f * x)); }

int16_t Kept(float metres) {
  constexpr float kMost = 32767;
  float steps = metres * (1 / kKeptStep);
  steps = steps < kMost ? steps : kMost;  // and what is not a number
  steps = steps > -kMost ? steps : -kMost;
  return static_cast<int16_t>(static_cast<int>(steps + 32768.5f) - 32768);
}

void Keep(Vecf metres, int16_t* steps) {
  steps[0] = Kept(metres.x), steps[1] = Kept(metres.y), steps[2] = Kept(metres.z);
}

void MakeNormals(const kernels::KernelTable& kernels, const BodyView& body, const float* positions, float* normals) {
  kernels::NormalsJob job = {};
  job.positions = positions;
  job.position_stride_bytes = job.normal_stride_bytes = 3 * sizeof(float);
  job.triangles = body.faces;
  job.normals = normals;
  job.vertices = body.vertex_count;
  job.triangle_count = body.face_count;
  kernels.normals(job);
}

void PoseBody(const kernels::KernelTable& kernels, const ModelView& model, const SkinPose& skin,
              const ContactMemory& memory) {
  const BodyView& body = model.body;
  for (size_t j = 0; j < model.joint_count; ++j) StoreFloats(skin.joints[j], memory.matrices + 12 * j);
  kernels::SkinningJob skinning = {};
  skinning.matrices = memory.matrices;
  skinning.positions = body.positions;
  skinning.bones = body.joints;
  skinning.weights = body.weights;
  skinning.out = memory.positions;
  skinning.out_stride_bytes = 3 * sizeof(float);
  skinning.vertices = body.vertex_count;
  skinning.influences = body.influences;
  kernels.skinning(skinning);
  MakeNormals(kernels, body, memory.positions, memory.normals);
}

// Neighbours on the mesh, from faces that may be anything.
void ListNeighbours(const ModelView& model, const ContactMemory& memory) {
  const size_t n = model.vertex_count;
  uint32_t* const starts = memory.beside_starts;
  for (size_t v = 0; v <= n; ++v) starts[v] = 0;
  // Both other corners of each face, with repeats; then each vertex keeps one of equals.
  for (size_t i = 0; i < size_t{3} * model.triangle_count; ++i) starts[model.faces[i] + 1] += 2;
  for (size_t v = 0; v < n; ++v) starts[v + 1] += starts[v];
  for (size_t i = 0; i < size_t{3} * model.triangle_count; ++i) {
    const size_t first = i / 3 * 3;
    uint32_t& at = starts[model.faces[i]];
    memory.beside[at++] = model.faces[first + (i + 1) % 3];
    memory.beside[at++] = model.faces[first + (i + 2) % 3];
  }
  uint32_t* const seen_by = memory.close;  // one more than the last vertex that each is beside
  for (size_t v = 0; v < n; ++v) seen_by[v] = 0;
  uint32_t begin = 0, out = 0;  // starts[v] is where v's end now
  for (size_t v = 0; v < n; ++v) {
    const uint32_t end = starts[v], kept = out;
    seen_by[v] = static_cast<uint32_t>(v + 1);
    for (uint32_t i = begin; i < end; ++i) {
      const uint16_t u = memory.beside[i];
      if (seen_by[u] == v + 1) continue;
      seen_by[u] = static_cast<uint32_t>(v + 1);
      memory.beside[out++] = u;
    }
    starts[v] = kept;
    begin = end;
  }
  starts[n] = out;
  double sum = 0;
  for (size_t v = 0; v < n; ++v) {
    for (uint32_t j = starts[v]; j < starts[v + 1]; ++j) {
      const Vec edge =
          VecAt(model.template_positions + 3 * v) - VecAt(model.template_positions + size_t{3} * memory.beside[j]);
      sum += std::sqrt(Dot(edge, edge));
    }
  }
  *memory.mean_edge = static_cast<float>(sum / (out > 0 ? out : 1));
}

// Whether a joint with a core moves a body vertex most.
bool LiesInLimb(const ModelView& model, const LimbCores& limbs, uint16_t vertex) {
  const BodyView& body = model.body;
  size_t most = size_t{vertex} * body.influences;
  for (size_t k = most; k < (size_t{vertex} + 1) * body.influences; ++k)
    most = body.weights[k] > body.weights[most] ? k : most;
  for (uint32_t k = 0; k < *limbs.count; ++k) {
    if (limbs.cores[k].joint == body.joints[most]) return true;
  }
  return false;
}

// Cloth that is bound close to skin which no core has: the waistband, shoulders.
void FindFixed(const kernels::KernelTable& kernels, const ModelView& model, const ContactMemory& memory) {
  const BodyView& body = model.body;
  MakeNormals(kernels, body, body.positions, memory.normals);
  FillBodySites(body, memory.touch, body.positions, memory.normals, kOnTrunk, memory.sites);
  PosedSkin skin = {&body, body.positions, memory.normals, 0};
  kernels::NearestJob job = {};
  uint16_t nearest[kernels::kNearestPatch], suspect[kernels::kNearestPatch];
  job.points = model.template_positions;
  job.point_stride_bytes = 3 * sizeof(float);
  job.reach = model.body.reach;
  job.clearance = kOnTrunk;
  job.nearest = nearest;
  job.suspect = suspect;
  size_t patch = 0;
  for (size_t v = 0; v < model.vertex_count; ++v) memory.fixed[v] = 0, memory.patches[v] = 0;
  for (size_t c = 0; c < ClassCount(model); ++c) {
    const TouchClass touch = ClassAt(model, memory.touch, c);
    skin.touch_bit = touch.bit;
    for (size_t begin = 0; begin < touch.vertex_count; begin += job.points_count) {
      job.order = touch.vertices + begin;
      const size_t left = touch.vertex_count - begin;
      job.points_count = left < kernels::kNearestPatch ? left : kernels::kNearestPatch;
      for (size_t i = 0; i < job.points_count; ++i)
        memory.patches[job.order[i]] = static_cast<uint16_t>(patch + (begin + i) / kPatch);
      if (touch.group_count == 0) continue;
      UseSites(touch, memory.sites, &job);
      kernels.nearest(job);
      for (size_t i = 0; i < job.points_count; ++i) {
        if (nearest[i] == kernels::kNoSite) continue;
        const size_t v = job.order[i], at = BodyVertexAt(body, memory.touch, nearest[i]);
        const Vecf place = VecfAt(model.template_positions + 3 * v);
        const ClosestSkin closest = FindClosestSkin(skin, static_cast<uint16_t>(at), static_cast<uint16_t>(at), place);
        const bool on_skin = closest.found && closest.height < kOnTrunk;
        memory.fixed[v] = on_skin && !LiesInLimb(model, memory.limbs, closest.vertex) ? 1 : 0;
      }
    }
    patch += (touch.vertex_count + kPatch - 1) / kPatch;
  }
}

// The garment as bound, where the hips are now.
Vecf BoundAt(const ModelView& model, const ContactMemory& memory, size_t v) {
  const float* hips = memory.matrices + size_t{12} * model.hips;
  const Vecf bound = VecfAt(model.template_positions + 3 * v);
  return {Dot(VecfAt(hips), bound) + hips[3], Dot(VecfAt(hips + 4), bound) + hips[7],
          Dot(VecfAt(hips + 8), bound) + hips[11]};
}

// Poses the bones on the way from how they were bound, where the hips are now, to their pose: `share` 0 to 1.
void PoseBones(const ModelView& model, const ContactMemory& memory, float share) {
  const float* hips = memory.matrices + size_t{12} * model.hips;
  for (uint32_t k = 0; k < *memory.limbs.count; ++k) {
    LimbCore* core = memory.limbs.cores + k;
    float matrix[12];
    for (int i = 0; i < 12; ++i)
      matrix[i] = (1 - share) * hips[i] + share * memory.matrices[size_t{12} * core->joint + static_cast<size_t>(i)];
    PoseBone(matrix, core);
  }
}

// This frame becomes the last one.
void KeepFrame(const ModelView& model, const ContactMemory& memory) {
  for (uint32_t k = 0; k < *memory.limbs.count; ++k) memory.limbs.cores[k].before = memory.limbs.cores[k].now;
  const float* hips = memory.matrices + size_t{12} * model.hips;
  for (int i = 0; i < 9; ++i) memory.hips[i] = hips[4 * (i / 3) + i % 3];
}

// False where a pose is so large, or so far from one, that the next frame starts anew.
bool AreBonesKept(const ContactMemory& memory) {
  const auto fits = [](const float* values, size_t count) {
    bool all = true;
    for (size_t i = 0; i < count; ++i) all &= std::fabs(values[i]) <= kLargestBone;
    return all;
  };
  bool all = fits(memory.hips, 9);
  for (uint32_t k = 0; k < *memory.limbs.count; ++k) all &= fits(&memory.limbs.cores[k].before.axes[0].x, kBoneFloats);
  return all;
}

void StartFromBindPose(const ModelView& model, const ContactMemory& memory) {
  for (size_t v = 0; v < model.vertex_count; ++v) {
    Keep(BoundAt(model, memory, v), memory.kept.places + 3 * v);
    Keep({0, 0, 0}, memory.kept.offsets + 3 * v);
  }
  PoseBones(model, memory, 0);
  KeepFrame(model, memory);
}

// Takes the target from the host's buffer, `share` of the way to it from the bind pose, and what is kept of the last
// frame, turned with the hips.
void TakeTargets(const ModelView& model, const Space& space, const Surface& surface, float seconds, float share,
                 const ContactMemory& memory) {
  const float* hips = memory.matrices + size_t{12} * model.hips;
  float turn[9], fading = Fading(kFade * seconds);
  for (size_t r = 0; r < 3; ++r) {
    for (size_t c = 0; c < 3; ++c) turn[3 * r + c] = fading * Dot(VecfAt(hips + 4 * r), VecfAt(memory.hips + 3 * c));
  }
  float unit[3];
  for (int i = 0; i < 3; ++i) unit[i] = static_cast<float>(space.sign[i] * space.metres_per_unit);
  for (size_t v = 0; v < model.vertex_count; ++v) {
    const float* p = surface.PositionOf(v);
    memory.places[v] = {unit[0] * p[space.axis[0]], unit[1] * p[space.axis[1]], unit[2] * p[space.axis[2]]};
    if (share < 1) {
      const Vecf bound = BoundAt(model, memory, v);
      memory.places[v] = bound + share * (memory.places[v] - bound);
    }
    const Vecf offset = FromKept(memory.kept.offsets + 3 * v);
    memory.active[v] = Dot(offset, offset) > kLeastOffset * kLeastOffset ? 1 : 0;
    memory.offsets[v] = {0, 0, 0};
    memory.holds[v] = Hold::kFree;
    if (memory.active[v] != 0)
      memory.offsets[v] = {Dot(VecfAt(turn), offset), Dot(VecfAt(turn + 3), offset), Dot(VecfAt(turn + 6), offset)};
  }
}

// Writes what has moved, and keeps it where time has passed. `places` hold where vertices are, `offsets` nothing.
void WriteMoved(const ModelView& model, const Space& space, const Surface& surface, bool keeps,
                const ContactMemory& memory) {
  float metres[3], units[3];
  for (int i = 0; i < 3; ++i) {
    metres[i] = static_cast<float>(space.sign[i] * space.metres_per_unit);
    units[i] = static_cast<float>(space.sign[i] / space.metres_per_unit);
  }
  for (size_t v = 0; v < model.vertex_count; ++v) {
    float* p = surface.PositionOf(v);
    const Vecf target = {metres[0] * p[space.axis[0]], metres[1] * p[space.axis[1]], metres[2] * p[space.axis[2]]};
    const Vecf place = memory.places[v], offset = place - target;
    if (offset.x != 0 || offset.y != 0 || offset.z != 0) {
      p[space.axis[0]] = units[0] * place.x, p[space.axis[1]] = units[1] * place.y,
      p[space.axis[2]] = units[2] * place.z;
    }
    if (!keeps) continue;
    Keep(place, memory.kept.places + 3 * v);
    Keep(offset, memory.kept.offsets + 3 * v);
  }
}

}  // namespace

ContactMemory PlaceContactMemory(const ModelView& model, Arena* arena) {
  const size_t b = model.body.vertex_count, n = model.vertex_count;
  ContactMemory memory = {};
  if (b == 0) return memory;
  memory.limbs = PlaceLimbCores(arena);
  memory.touch = PlaceTouchLists(model, arena);
  memory.beside_starts = arena->Take<uint32_t>(n + 1);
  memory.beside = arena->Take<uint16_t>(size_t{6} * model.triangle_count);
  memory.mean_edge = arena->Take<float>(1);
  memory.patches = arena->Take<uint16_t>(n);
  memory.fixed = arena->Take<uint8_t>(n);
  memory.kept.places = arena->Take<int16_t>(6 * n);
  memory.kept.offsets = memory.kept.places == nullptr ? nullptr : memory.kept.places + 3 * n;
  memory.hips = arena->Take<float>(9);
  memory.matrices = arena->Take<float>(size_t{12} * model.joint_count);
  memory.positions = arena->Take<float>(3 * b);
  memory.normals = arena->Take<float>(3 * b);
  memory.sites = PlaceBodySites(model.body, arena);
  memory.places = arena->Take<Vecf>(n);
  memory.offsets = arena->Take<Vecf>(n);
  memory.close = arena->Take<uint32_t>(n);
  memory.holds = arena->Take<Hold>(n);
  memory.active = arena->Take<uint8_t>(n);
  memory.rings = arena->Take<uint8_t>(n);
  memory.sorted = arena->Take<uint16_t>(n);
  memory.list = arena->Take<uint16_t>(n);
  memory.near = arena->Take<NearCores>(n / kPatch + format::kMaxTouchClasses);
  memory.touches = arena->Take<Touch>(kMostTouches);
  memory.skin = arena->Take<uint16_t>(n);
  return memory;
}

void PrepareContact(const kernels::KernelTable& kernels, const ModelView& model, const ContactMemory& memory) {
  if (memory.kept.places == nullptr) return;
  FillTouchLists(model, memory.touch);
  MeasureLimbCores(model, memory.limbs);
  ListNeighbours(model, memory);
  FindFixed(kernels, model, memory);
}

void KeepOutside(const kernels::KernelTable& kernels, const ModelView& model, const Space& space, const SkinPose& skin,
                 const ContactMemory& memory, ContactClock* clock, const Surface& surface, Stopwatch* watch) {
  if (model.body.vertex_count == 0) return;
  PoseBody(kernels, model, skin, memory);
  FillBodySites(model.body, memory.touch, memory.positions, memory.normals, model.body.clearance, memory.sites);
  watch->Lap(DCLOTH_STEP_PENETRATION, "skin");
  const bool starts = !clock->started || clock->seconds > kLongestGap, keeps = starts || clock->seconds > 0;
  const int steps = starts ? kStartSteps : 1;
  if (starts) StartFromBindPose(model, memory);
  for (int step = 1; step <= steps; ++step) {
    const float share = static_cast<float>(step) / static_cast<float>(steps);
    PoseBones(model, memory, share);
    TakeTargets(model, space, surface, clock->seconds, share, memory);
    KeepSides(model, memory, FindPiercedLimbs(model, memory));
    watch->Lap(DCLOTH_STEP_PENETRATION, "limbs");
    GiveWay(model, memory, ListActive(model, memory));
    for (size_t v = 0; v < model.vertex_count; ++v) memory.places[v] = memory.places[v] + memory.offsets[v];
    watch->Lap(DCLOTH_STEP_PENETRATION, "cloth gives way");
    if (step == steps) break;
    for (size_t v = 0; v < model.vertex_count; ++v) {
      Keep(memory.places[v], memory.kept.places + 3 * v);
      Keep(memory.offsets[v], memory.kept.offsets + 3 * v);
    }
    KeepFrame(model, memory);
  }
  PushOutOfSkin(kernels, model, memory);
  WriteMoved(model, space, surface, keeps, memory);
  if (keeps) KeepFrame(model, memory);
  *clock = {AreBonesKept(memory), 0};
}

}  // namespace dcloth::engine

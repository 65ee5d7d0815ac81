#include "engine/src/body/penetration.h"

#include <cmath>
#include <cstdint>

#include "engine/src/body/crossings.h"
#include "engine/src/body/cut_corners.h"
#include "engine/src/body/folded_cloth.h"
#include "engine/src/body/hitched_cloth.h"
#include "engine/src/body/kicked_cloth.h"
#include "engine/src/body/spread_moves.h"

namespace dcloth::engine {
namespace {

using format::BodyView;

void PoseBody(const kernels::KernelTable& kernels, const format::ModelView& model, const Space& space,
              const SkinPose& skin, const BodyMemory& memory) {
  const BodyView& body = model.body;
  for (size_t j = 0; j < model.joint_count; ++j) StoreFloats(ToHost(space, skin.joints[j]), memory.matrices + 12 * j);
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
  kernels::NormalsJob normals = {};
  normals.positions = memory.positions;
  normals.position_stride_bytes = normals.normal_stride_bytes = 3 * sizeof(float);
  normals.triangles = body.faces;
  normals.normals = memory.normals;
  normals.vertices = body.vertex_count;
  normals.triangle_count = body.face_count;
  kernels.normals(normals);
  if (!space.mirrored) return;
  for (size_t i = 0; i < size_t{3} * body.vertex_count; ++i) memory.normals[i] = -memory.normals[i];
}

// A push may lead under another part of the body: in a fold, between two legs.
constexpr int kMaxPushes = 4;
constexpr double kShare[kMaxPushes] = {1, 1, 0.5, 0.25};  // of the clearance: a fold may be narrower than it
constexpr double kPushed = 0.99;  // of the clearance: rounded to floats, a vertex that was pushed stays put
// Clearances more for cloth that was laid over a limb by five clearances or more: its triangles are long, and the
// middle of an edge lies lower than its ends.
constexpr double kLaid = 1, kLaidBy = 5;
// Clearances. A vertex that was pushed or laid further may be under skin that the vertices near its first place know
// nothing of.
constexpr double kFarPush = 2;

// Clearances. Cloth around vertices that were moved further gives way.
constexpr double kLongMove = 2;

constexpr int kUncrossings = 2;  // what is pushed out of skin that it crosses may come to cross other skin

constexpr double kPastRim = 5;  // clearances under skin beyond a rim, at most: a sleeve may lie deep in the trunk

double SquaredDistance(const double* a, const float* b) {
  double squared = 0;
  for (size_t c = 0; c < 3; ++c) {
    const double apart = a[c] - static_cast<double>(b[c]);
    squared += apart * apart;
  }
  return squared;
}

// Where what counts ends, at a shoulder say, the skin goes on: cloth that is just under it there is taken out of it.
bool PushPastRim(const PosedBody& posed, const ClosestPoint& rim, double clearance, SearchBudget* budget, double* v) {
  PosedBody all = posed;
  all.touch_bit = 0;
  const uint32_t start = posed.body->faces[size_t{3} * rim.face];
  const ClosestPoint closest = SearchBody(all, start, start, v);
  budget->faces -= closest.faces_seen < budget->faces ? closest.faces_seen : budget->faces;
  if (!closest.found || !(std::fabs(closest.distance) < kPushed * std::fabs(rim.distance))) return false;
  if (closest.distance >= kPushed * clearance || closest.distance < -kPastRim * clearance) return false;
  for (size_t c = 0; c < 3; ++c) v[c] = closest.point[c] + clearance * closest.direction[c];
  return true;
}

// The pushes of a frame, class by class.
class Pushes {
 public:
  Pushes(const kernels::KernelTable& kernels, const format::ModelView& model, const Space& space,
         const BodyMemory& memory, const Surface& surface, double clearance, double reach)
      : kernels_(kernels),
        model_(model),
        memory_(memory),
        surface_(surface),
        clearance_(clearance),
        budget_(SearchBudgetOf(model.vertex_count)),
        posed_{&model.body, memory.positions, space.mirrored ? -1.0 : 1.0, 0},
        listed_(CountListed(model, memory.deep)) {
    job_.points = surface.positions;
    job_.point_stride_bytes = surface.position_stride_bytes;
    job_.reach = static_cast<float>(reach);
    job_.clearance = static_cast<float>(clearance);
    job_.nearest = nearest_;
    job_.suspect = suspect_;
    job_.looks = &looks_;
  }
  Pushes(const Pushes&) = delete;
  Pushes& operator=(const Pushes&) = delete;

  // False where there is nothing to push out of.
  bool Use(const TouchClass& touch) {
    if (touch.vertex_count == 0 || touch.group_count == 0) return false;
    UseSites(touch, memory_.sites, &job_);
    posed_.touch_bit = touch.bit;
    return true;
  }

  // Vertices of the class in use; at `first` those that were laid elsewhere go further out. Lists what is moved. False
  // where the frame's searches have run out.
  bool Push(const uint16_t* vertices, size_t count, bool first) {
    for (size_t begin = 0; begin < count; begin += job_.points_count) {
      if (budget_.looks == 0) return false;
      job_.order = vertices + begin;
      job_.points_count = count - begin < kernels::kNearestPatch ? count - begin : kernels::kNearestPatch;
      looks_ = 0;
      kernels_.nearest(job_);
      budget_.looks -= looks_ < budget_.looks ? looks_ : budget_.looks;
      for (size_t i = 0; i < job_.points_count; ++i) {
        if (suspect_[i] == kernels::kNoSite) continue;
        const uint16_t vertex = job_.order[i];
        const double laid = first ? static_cast<double>(MoveOf(memory_.deep, surface_, vertex)) / clearance_ : 0;
        const double share = laid < kLaidBy ? laid / kLaidBy : 1;
        float* position = surface_.PositionOf(vertex);
        const float start[3] = {position[0], position[1], position[2]};
        memory_.beside[vertex] = PushOut(posed_, job_, memory_.touch, i, (1 + kLaid * share) * clearance_,
                                         laid > kFarPush, &budget_, position);
        listed_ = ListMove(memory_.deep, listed_, vertex, start, surface_);
      }
    }
    return true;
  }

  // Cloth around what was moved far gives way, and may be under other skin then. False as above.
  bool Spread() {
    const size_t moved =
        SpreadLongMoves(model_, memory_.deep, listed_, kLongMove * clearance_, memory_.swept.starts, surface_);
    return moved == 0 || PushListed();
  }

  // Once more. False as above.
  bool PushListed() {
    for (size_t c = 0; c < ClassCount(model_); ++c) {
      const TouchClass touch = ClassAt(model_, memory_.touch, c);
      if (!Use(touch)) continue;
      uint16_t vertices[kernels::kNearestPatch];
      size_t count = 0;
      for (size_t i = 0; i < touch.vertex_count; ++i) {
        if (memory_.deep.places[touch.vertices[i]] != kNotDeep) vertices[count++] = touch.vertices[i];
        if (count < kernels::kNearestPatch && i + 1 < touch.vertex_count) continue;
        if (count != 0 && !Push(vertices, count, false)) return false;
        count = 0;
      }
    }
    return true;
  }

  uint32_t* faces() { return &budget_.faces; }

 private:
  const kernels::KernelTable& kernels_;
  const format::ModelView& model_;
  const BodyMemory& memory_;
  const Surface& surface_;
  const double clearance_;
  SearchBudget budget_;
  PosedBody posed_;
  size_t listed_;  // in `deep`
  kernels::NearestJob job_ = {};
  uint32_t looks_ = 0;
  uint16_t nearest_[kernels::kNearestPatch], suspect_[kernels::kNearestPatch];
};

}  // namespace

BodyMemory PlaceBodyMemory(const format::ModelView& model, Arena* arena) {
  const size_t b = model.body.vertex_count;
  BodyMemory memory = {};
  if (b == 0) return memory;
  memory.matrices = arena->Take<float>(size_t{12} * model.joint_count);
  memory.positions = arena->Take<float>(3 * b);
  memory.normals = arena->Take<float>(3 * b);
  // What hitching needs is done with when sites are filled. Red zones stand for one use of the memory alone.
  Arena scratch = *arena;
  memory.sites = PlaceBodySites(model.body, arena);
  memory.hitched = PlaceHitchedCloth(model, kRedZoneBytes == 0 ? &scratch : arena);
  if (scratch.size() > arena->size()) arena->Take<uint8_t>(scratch.size() - arena->size());
  memory.hitched.at_edge = arena->Take<uint8_t>(model.vertex_count);
  memory.touch = PlaceTouchLists(model, arena);
  memory.limbs = PlaceLimbCores(arena);
  const Sleeves sleeves = PlaceSleeves(model, arena);
  memory.swept = PlaceSweptCloth(model, arena);
  memory.deep = PlaceDeepCloth(model, sleeves, arena);
  memory.tops = arena->Take<float>(b);
  memory.beside = arena->Take<uint16_t>(model.vertex_count);
  return memory;
}

void OrderGarment(const format::ModelView& model, const BodyMemory& memory) {
  if (memory.touch.order == nullptr) return;
  FillTouchLists(model, memory.touch);
  MeasureLimbCores(model, memory.limbs);
  FindSleeves(model, memory.limbs, memory.deep.sleeves);
  FindSweptCloth(model, memory.limbs, memory.deep.sleeves, memory.swept);
  FindEdges(model, memory.hitched);
}

void KeepOutside(const kernels::KernelTable& kernels, const format::ModelView& model, const Space& space,
                 const SkinPose& skin, const BodyMemory& memory, const Surface& surface) {
  const BodyView& body = model.body;
  if (body.vertex_count == 0) return;
  const double units_per_metre = 1 / space.metres_per_unit;
  const double clearance = static_cast<double>(body.clearance) * units_per_metre;
  PoseBody(kernels, model, space, skin, memory);
  PoseLimbCores(memory.matrices, memory.limbs);
  ThreadSleeves(model, memory.limbs, memory.deep.sleeves, surface);
  const bool kicked = TakeAlong(model, space.mirrored, memory.positions, memory.limbs, memory.swept, surface);
  KeepDrawn(model, memory.hitched, surface);
  const auto lay = [&] {
    return LayOrSweep(model, space.mirrored, memory.matrices, memory.limbs, memory.touch, memory.deep, memory.swept,
                      surface);
  };
  const uint8_t torn = lay();
  if (torn != 0 && HitchUp(model, space.mirrored, memory.limbs, torn, memory.swept, memory.hitched, surface)) lay();
  FillBodySites(body, memory.touch, memory.positions, memory.normals, static_cast<float>(clearance), memory.sites);
  for (size_t v = 0; v < model.vertex_count; ++v) memory.beside[v] = kNotNear;
  Pushes pushes(kernels, model, space, memory, surface, clearance, static_cast<double>(body.reach) * units_per_metre);
  for (size_t c = 0; c < ClassCount(model); ++c) {
    const TouchClass touch = ClassAt(model, memory.touch, c);
    if (!pushes.Use(touch)) continue;
    if (!pushes.Push(touch.vertices, touch.vertex_count, true)) return;
  }
  if (!pushes.Spread()) return;
  const PosedBody whole = {&body, memory.positions, space.mirrored ? -1.0 : 1.0, 0};
  // Only cloth that was torn or kicked away lies in folds. What is lifted is listed in `deep.places`.
  const bool folded = (torn != 0 || kicked) && LiftOverLining(model, whole, memory.normals, memory.beside, clearance,
                                                              memory.deep.places, memory.tops, surface) != 0;
  if (folded && !pushes.PushListed()) return;
  CoverCorners(model, whole, memory.normals, memory.beside, clearance, memory.hitched.at_edge, memory.deep.places,
               surface, pushes.faces());
  const CrossedBody crossed = {whole, memory.normals, memory.sites, memory.touch, memory.beside, clearance};
  for (int k = 0; k < kUncrossings; ++k) {
    const size_t moved = Uncross(model, crossed, memory.deep, memory.swept.starts, surface, pushes.faces());
    if (moved == 0 || !pushes.PushListed()) return;
  }
}

uint16_t PushOut(const PosedBody& posed, const kernels::NearestJob& job, const TouchLists& lists, size_t i,
                 double clearance, bool far_moved, SearchBudget* budget, float* position) {
  const auto nearest = static_cast<uint32_t>(BodyVertexAt(*posed.body, lists, job.nearest[i]));
  const auto suspect = static_cast<uint32_t>(BodyVertexAt(*posed.body, lists, job.suspect[i]));
  const double far = kFarPush * clearance;
  double v[3] = {static_cast<double>(position[0]), static_cast<double>(position[1]), static_cast<double>(position[2])};
  bool moved = false;
  uint16_t beside = kNotNear;
  for (int push = 0; push < kMaxPushes && budget->faces != 0; ++push) {
    const bool whole =
        budget->whole_searches != 0 && (push == 0 ? far_moved : SquaredDistance(v, position) > far * far);
    if (whole) --budget->whole_searches;
    const ClosestPoint closest =
        whole ? SearchWholeBody(posed, job, lists, suspect, v) : SearchBody(posed, suspect, nearest, v);
    budget->faces -= closest.faces_seen < budget->faces ? closest.faces_seen : budget->faces;
    const double height = kShare[push] * clearance;
    if (!closest.found) break;
    if (EndsAt(posed, closest)) {
      if (moved || !PushPastRim(posed, closest, clearance, budget, v)) break;
      moved = true;
      continue;
    }
    beside = posed.body->faces[size_t{3} * closest.face];
    if (closest.distance >= kPushed * height) break;
    for (size_t c = 0; c < 3; ++c) v[c] = closest.point[c] + height * closest.direction[c];
    moved = true;
  }
  for (size_t c = 0; c < 3 && moved; ++c) position[c] = static_cast<float>(v[c]);
  return beside;
}

}  // namespace dcloth::engine

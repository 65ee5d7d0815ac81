// The inside of a body's limbs, by its bones: tells cloth that lies deep in a limb from cloth beside it.
//
// A core is a bone with the space around it that is free of skin in the bind pose, less a margin for what a pose does
// to skin. The closest point of the skin cannot tell as much: where a bent knee presses the calf into the thigh, the
// skin that is nearest is inside of the body itself.
#ifndef DCLOTH_ENGINE_SRC_BODY_LIMB_CORES_H_
#define DCLOTH_ENGINE_SRC_BODY_LIMB_CORES_H_

#include <cstddef>
#include <cstdint>

#include "engine/format/view.h"
#include "engine/src/base/lent_memory.h"

namespace dcloth::engine {

inline float Dot(const float* a, const float* b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
inline void Cross(const float* a, const float* b, float* out) {
  for (size_t c = 0; c < 3; ++c) out[c] = a[(c + 1) % 3] * b[(c + 2) % 3] - a[(c + 2) % 3] * b[(c + 1) % 3];
}

inline void Transform(const float* matrix, const float* point, float* out) {
  for (size_t r = 0; r < 3; ++r) out[r] = Dot(matrix + 4 * r, point) + matrix[4 * r + 3];
}

constexpr size_t kCoreSlices = 8;   // along the bone
constexpr size_t kCoreSectors = 8;  // around it
constexpr size_t kMostCores = 32;
constexpr float kCoreOfFree = 0.9f;  // share of the free space that is core

// The joint that a body vertex goes with most.
inline uint16_t MainJointOf(const format::BodyView& body, size_t body_vertex) {
  const size_t first = body_vertex * body.influences;
  size_t most = first;
  for (size_t i = first; i < first + body.influences; ++i) most = body.weights[i] > body.weights[most] ? i : most;
  return body.joints[most];
}

struct LimbCore {
  float from[3], to[3];                    // of the bone, bind pose, metres
  float around[2][3];                      // unit vectors across the bone and each other, bind pose
  float radii[kCoreSlices][kCoreSectors];  // metres; slices from `from` to `to`; 0 where there is no core
  float cap;                               // radius of the ball around `to` that is core beyond it, metres
  float tip;                               // how far skin reaches beyond `to`, metres
  float posed_from[3];                     // of this frame, in the host's space
  float along[3];                          // posed `to` less posed `from`
  float posed_around[2][3];
  float reach;            // from the posed bone, all of the core is within it
  float inverse_squared;  // 1 / |along|^2
  float scale;            // host units a metre, of a frame's radii
  uint32_t joint;
  uint32_t above;      // core of the limb that this one bends with at `from`: a shank's is the thigh's; or kMostCores
  uint32_t below;      // the core that this one is `above`, or kMostCores
  bool bends;          // with a limb above or below
  bool in_sleeve;      // a sleeve goes around it (FindSleeves)
  uint8_t touched_by;  // classes that touch all the skin around it; all where there are none
};

struct LimbCores {
  LimbCore* cores;  // [kMostCores]
  uint32_t* count;  // [1]
};

// A point seen from a bone.
struct OnBone {
  float along;  // 0 to 1 between the bone's ends, beyond them less and more
  float away[3];
  float squared;  // |away|^2, from the bone
};

inline OnBone PlaceOnBone(const float* from, const float* along, float inverse_squared, const float* point) {
  OnBone on = {};
  float relative[3];
  for (size_t c = 0; c < 3; ++c) relative[c] = point[c] - from[c];
  on.along = Dot(relative, along) * inverse_squared;
  const float clamped = on.along < 0 ? 0.0f : on.along < 1 ? on.along : 1.0f;
  for (size_t c = 0; c < 3; ++c) on.away[c] = relative[c] - clamped * along[c];
  on.squared = Dot(on.away, on.away);
  return on;
}
OnBone InBindPose(const LimbCore& core, const float* point);

// Of the bone in the bind pose, metres.
float LengthOf(const LimbCore& core);

// `along` is between 0 and 1; `away` from the bone, in the space of `around`.
size_t SliceAt(float along);
size_t SectorAt(const float (&around)[2][3], const float* away);

// The model has a body.
LimbCores PlaceLimbCores(Arena* arena);

// Once for each body: finds the cores in the bind pose. There are none where the file has no parents of joints. Cost:
// 0.35 ms for 8,000 vertices of skin.
void MeasureLimbCores(const format::ModelView& model, const LimbCores& limbs);

// Every frame: `matrices` [joint_count, 12] take the bind pose to the host's space.
void PoseLimbCores(const float* matrices, const LimbCores& limbs);

// The cores, a bit each, that in the bind pose lie under a garment vertex at `point`: on the inner side of the plane
// across its distance to the nearest bone, and not far from it. A hand beside a skirt does not; both legs do. A foot
// does where its shank does. `bit` is of the vertex's class, 0 where every vertex touches everything. `nearest` is the
// core of that bone, kMostCores where there is none.
uint32_t CoresUnder(const LimbCores& limbs, const float* point, uint8_t bit, uint32_t* nearest);

// Whether the posed core may reach into a ball.
bool ReachesInto(const LimbCore& core, const float* centre, float radius);

// Whether the posed core holds `point`, seen `on` its bone, within its reach; if so, `away` is the way to it from the
// bone and `radius` the core's there.
bool IsInCore(const LimbCore& core, const OnBone& on, float* away, float* radius);
inline bool IsInCore(const LimbCore& core, const float* point, float* away, float* radius) {
  const OnBone on = PlaceOnBone(core.posed_from, core.along, core.inverse_squared, point);
  return on.along > 0 && on.squared < core.reach * core.reach && IsInCore(core, on, away, radius);
}

// visit(upper core, its index, bit) for each of the first eight limbs that bend.
template <typename Visit>
void VisitLimbs(const LimbCores& limbs, Visit visit) {
  constexpr uint32_t kMostLimbs = 8;
  uint32_t found = 0;
  for (uint32_t k = 0; k < *limbs.count && found < kMostLimbs; ++k) {
    const LimbCore& core = limbs.cores[k];
    if (core.above == kMostCores && core.below != kMostCores) visit(core, k, static_cast<uint8_t>(1u << found++));
  }
}

// Above the core of a limb that bends lies its skin; cloth that is laid over it is to meet that one, not the skin that
// a bent knee folds into itself. What to add to a core's radius.
float SkinOver(const LimbCore& core, float radius);

// Straight out of the posed core, across its bone, to where its skin is; what is not in it stays.
void LiftAcross(const LimbCore& core, float* position);

// Unit vector `out` across the posed bone to the side on which a garment vertex was at `bound` in the bind pose.
// Returns 0 to 1: how surely it belongs there. A sleeve, close to its bone, goes with the limb; a skirt swings.
float OwnSide(const LimbCore& core, const float* bound, float* out);

// Whether the posed bone goes through the triangle a, b, c.
bool GoesThrough(const LimbCore& core, const float* a, const float* b, const float* c);

// Whether `k` is the core `nearest`, or one that bends with it.
bool BendsWith(const LimbCores& limbs, uint32_t nearest, uint32_t k);

// Whether a garment vertex that was at `bound` in the bind pose and is at `point` lies behind a posed core, seen from
// where it was: the limb has gone through the cloth. The core is the nearest bone's or one that bends with it, and is
// one of those `under` the vertex. If so, `out` is the unit vector across the bone to the vertex's own side, and
// `middle` a place in the core on the way there.
bool IsBehindCore(const LimbCores& limbs, uint32_t under, uint32_t nearest, const float* bound, const float* point,
                  float* out, float* middle);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_BODY_LIMB_CORES_H_

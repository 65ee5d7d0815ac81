#include "engine/src/network/patch_inputs.h"

#include <cmath>
#include <cstring>

#include "engine/src/base/vec.h"
#include "kernels/half.h"

namespace dcloth::engine {
namespace {

using format::PatchStageView;

constexpr size_t kMost = format::kMaxPatchPoints;
constexpr float kLength = 10, kLimit = 8, kDeepest = -0.1f, kFarthest = 0.3f, kFastest = 4;
constexpr float kJoint = 2, kWind = 6, kAcceleration = 20;
constexpr float kReach = 0.08f;           // metres from a limb within which its cloth feels it
constexpr float kShortestSquare = 1e-8f;  // of a capsule's axis
constexpr float kLeastApart = 1e-4f;      // of a point from it
// Of an axis of a frame: hosts scale limbs to zero to hide them.
constexpr float kLeastAxisSquare = 1e-12f;

// Places and frames that a wild saved state makes still are what a saved state may hold.
Vecf Bounded(Vecf v) { return {BoundPlace(v.x), BoundPlace(v.y), BoundPlace(v.z)}; }

// exp(-t) for t >= 0 but for a few roundings of t, and never below 2^-64. Without libm, whose last bit differs from
// system to system. 2^y = 2^k 2^f: k is y rounded, by adding what leaves no room for a fraction, and goes into the
// exponent; 2^f on +-1/2 is its Taylor sum.
float ExpMinus(float t) {
  constexpr float kLog2e = 1.44269504f, kRound = 12582912.0f;  // 1.5 2^23
  const float y = Clamp(-64, 0, t * -kLog2e), rounded = y + kRound, f = y - (rounded - kRound);
  float p = 1.54035304e-4f;
  p = p * f + 1.33335581e-3f;
  p = p * f + 9.61812911e-3f;
  p = p * f + 5.55041087e-2f;
  p = p * f + 2.40226507e-1f;
  p = p * f + 6.93147181e-1f;
  p = p * f + 1.0f;
  const auto bits = [](float value) { return static_cast<int32_t>(kernels::BitsFromFloat(value)); };
  return kernels::FloatFromBits(static_cast<uint32_t>(bits(p) + (bits(rounded) - bits(kRound)) * (1 << 23)));
}

Vecf Turn(const float* m, Vecf v) {
  return {m[0] * v.x + m[1] * v.y + m[2] * v.z, m[4] * v.x + m[5] * v.y + m[6] * v.z,
          m[8] * v.x + m[9] * v.y + m[10] * v.z};
}
Vecf Shift(const float* m) { return {m[3], m[7], m[11]}; }

float AxisSquare(Vecf axis) {
  const float square = Dot(axis, axis);
  return square > kLeastAxisSquare ? square : kLeastAxisSquare;
}

// Into a frame: each axis over its squared length, so that a scaled joint's frame is left as it was entered.
struct IntoFrame {
  Vecf rows[kAxes];

  explicit IntoFrame(const float* axes) {
    for (size_t c = 0; c < kAxes; ++c) {
      const Vecf axis = VecfAt(axes + 3 * c);
      rows[c] = (1 / AxisSquare(axis)) * axis;
    }
  }

  void Put(float scale, Vecf v, float* x) const {
    for (size_t c = 0; c < kAxes; ++c) x[c] = Clamp(-kLimit, kLimit, scale * Dot(rows[c], v));
  }
};

void PlaceFrame(const PatchStageView& stage, const PatchPose& pose, size_t k, const PatchFrame& frame) {
  const size_t points = stage.point_count;
  const float* joint = pose.matrices + size_t{12} * stage.joints[k];
  const float* axes = stage.axes + 9 * k;
  Vecf turned[kAxes];
  for (size_t c = 0; c < kAxes; ++c) {
    turned[c] = Turn(joint, {axes[c], axes[3 + c], axes[6 + c]});
    for (size_t before = 0; before < c; ++before)
      turned[c] = turned[c] - (Dot(turned[before], turned[c]) / AxisSquare(turned[before])) * turned[before];
    Store(Bounded(turned[c]), frame.axes + 3 * c);
  }
  Store(Bounded(Turn(joint, VecfAt(stage.centres + 3 * k)) + Shift(joint)), frame.centre);
  constexpr size_t kInfluences = format::kPointInfluences;
  const uint8_t* joints = stage.point_joints + kInfluences * points * k;
  const float* parts = stage.point_parts + 4 * kInfluences * points * k;
  for (size_t r = 0; r < points; ++r) {
    Vecf sum = {0, 0, 0};
    for (size_t i = 0; i < kInfluences; ++i, ++joints, parts += 4) {
      const float* m = pose.matrices + size_t{12} * *joints;
      sum = sum + Turn(m, VecfAt(parts)) + parts[3] * Shift(m);
    }
    sum = Bounded(sum);
    frame.base[r] = sum.x, frame.base[points + r] = sum.y, frame.base[2 * points + r] = sum.z;
  }
}

// A capsule beside each point: normal from its axis, distance of its surface, motion of the axis along the normal.
struct Beside {
  float x[kMost], y[kMost], z[kMost], distance[kMost], speed[kMost];
};

void FindCapsule(const CapsuleMotion& capsule, const float* places, size_t points, Beside* beside) {
  const Vecf start = VecfAt(capsule.start), way = VecfAt(capsule.way), start_motion = VecfAt(capsule.start_motion),
             way_motion = VecfAt(capsule.way_motion);
  const float inverse_squared = capsule.inverse_squared, radius = capsule.radius, change = capsule.radius_change;
  Beside found;
  for (size_t r = 0; r < points; ++r) {
    const Vecf from = Vecf{places[r], places[points + r], places[2 * points + r]} - start;
    const float at = Clamp(0, 1, Dot(from, way) * inverse_squared);
    const Vecf away = from - at * way;
    const float apart = std::sqrt(Dot(away, away)), length = apart > kLeastApart ? apart : kLeastApart;
    const Vecf normal = (1 / length) * away;
    found.x[r] = normal.x, found.y[r] = normal.y, found.z[r] = normal.z;
    found.distance[r] = length - (radius + at * change);
    found.speed[r] = Dot(normal, start_motion + at * way_motion);
  }
  *beside = found;
}

// [5 R] of the nearer of a limb's capsules, the first of equals: near in(n) [3][R], 10 d [R], 10 near v [R].
void ReadLimb(const CapsuleMotion& upper, const CapsuleMotion& lower, const IntoFrame& into, const float* places,
              size_t points, float* x) {
  Beside a, b;
  FindCapsule(upper, places, points, &a);
  FindCapsule(lower, places, points, &b);
  const Vecf out = into.rows[0], up = into.rows[1], along = into.rows[2];
  float made[5][kMost];
  for (size_t r = 0; r < points; ++r) {
    const bool second = b.distance[r] < a.distance[r];
    const Vecf normal = {second ? b.x[r] : a.x[r], second ? b.y[r] : a.y[r], second ? b.z[r] : a.z[r]};
    const float distance = second ? b.distance[r] : a.distance[r], speed = second ? b.speed[r] : a.speed[r];
    const float near = ExpMinus((distance > 0 ? distance : 0) * (1 / kReach));
    made[0][r] = Clamp(-kLimit, kLimit, near * Dot(out, normal));
    made[1][r] = Clamp(-kLimit, kLimit, near * Dot(up, normal));
    made[2][r] = Clamp(-kLimit, kLimit, near * Dot(along, normal));
    made[3][r] = kLength * Clamp(kDeepest, kFarthest, distance);
    made[4][r] = Clamp(-kFastest, kFastest, kLength * near * speed);
  }
  for (size_t i = 0; i < 5; ++i) std::memcpy(x + i * points, made[i], points * sizeof(float));
}

// [9 R]: the last displacement, the cloth held still in the world, its velocity there. Moves the last places to where
// they were a tick ago.
void ReadCloth(const PatchHistory& history, const PatchFrame& frame, const IntoFrame& into, float share, size_t points,
               float* x) {
  const float rest = 1 - share;
  float carried[kAxes * kMost], still[kAxes][kMost], motion[kAxes][kMost];
  PlacePoints(frame, history.displacement, points, carried);
  for (size_t c = 0; c < kAxes; ++c) {
    float* last = history.last + c * points;
    for (size_t r = 0; r < points; ++r) {
      const size_t i = c * points + r;
      motion[c][r] = last[r] - history.before[i];
      last[r] = BoundPlace(last[r] * share + carried[i] * rest);
      still[c][r] = last[r] - frame.base[i];
    }
  }
  for (size_t c = 0; c < kAxes; ++c) {
    const Vecf row = into.rows[c];
    const float* u = history.displacement + c * points;
    float* out = x + c * points;
    for (size_t r = 0; r < points; ++r) {
      out[r] = Clamp(-kLimit, kLimit, kLength * u[r]);
      out[3 * points + r] =
          Clamp(-kLimit, kLimit, kLength * (Dot(row, Vecf{still[0][r], still[1][r], still[2][r]}) - u[r]));
      out[6 * points + r] = Clamp(-kLimit, kLimit, kLength * Dot(row, Vecf{motion[0][r], motion[1][r], motion[2][r]}));
    }
  }
}

}  // namespace

void PlaceCapsules(const PatchStageView& stage, const PatchPose& pose, float* ends) {
  for (size_t i = 0; i < stage.capsule_count; ++i) {
    const float* m = pose.matrices + size_t{12} * stage.capsule_joints[i];
    for (size_t end = 0; end < 2; ++end)
      Store(Bounded(Turn(m, VecfAt(stage.capsules + 8 * i + 3 * end)) + Shift(m)), ends + 6 * i + 3 * end);
  }
  // A knee is one place, also of a leg that is longer than the figure's.
  for (size_t i = 0; i < stage.capsule_count; ++i) {
    for (size_t j = 0; j < stage.capsule_count; ++j) {
      const float *end = stage.capsules + 8 * i + 3, *start = stage.capsules + 8 * j;
      if (end[0] == start[0] && end[1] == start[1] && end[2] == start[2]) Store(VecfAt(ends + 6 * j), ends + 6 * i + 3);
    }
  }
}

void MoveCapsules(const PatchStageView& stage, const PatchPose& pose, const float* ends_before,
                  CapsuleMotion (&capsules)[format::kMaxCapsules]) {
  float ends[6 * format::kMaxCapsules];
  PlaceCapsules(stage, pose, ends);
  for (size_t i = 0; i < stage.capsule_count; ++i) {
    const Vecf start = VecfAt(ends + 6 * i), end = VecfAt(ends + 6 * i + 3), way = end - start;
    const Vecf start_motion = *pose.share * (start - VecfAt(ends_before + 6 * i));
    const Vecf end_motion = *pose.share * (end - VecfAt(ends_before + 6 * i + 3));
    CapsuleMotion& capsule = capsules[i];
    Store(start, capsule.start);
    Store(way, capsule.way);
    Store(end, capsule.end);
    Store(start_motion, capsule.start_motion);
    Store(end_motion - start_motion, capsule.way_motion);
    Store(end_motion, capsule.end_motion);
    const float square = Dot(way, way);
    capsule.inverse_squared = 1 / (square > kShortestSquare ? square : kShortestSquare);
    capsule.radius = stage.capsules[8 * i + 6];
    capsule.radius_change = stage.capsules[8 * i + 7] - capsule.radius;
  }
}

void ReadPatch(const PatchStageView& stage, const PatchPose& pose,
               const CapsuleMotion (&capsules)[format::kMaxCapsules], size_t k, const PatchHistory& history,
               const PatchFrame& frame, float* x) {
  const size_t points = stage.point_count;
  const float share = *pose.share;
  PlaceFrame(stage, pose, k, frame);
  const IntoFrame into(frame.axes);
  ReadCloth(history, frame, into, share, points, x);
  x += 9 * points;
  const uint8_t* limbs = stage.limbs + size_t{format::kLimbsAPatch} * format::kCapsulesALimb * k;
  for (size_t limb = 0; limb < format::kLimbsAPatch; ++limb, x += 5 * points)
    ReadLimb(capsules[limbs[2 * limb]], capsules[limbs[2 * limb + 1]], into, history.last, points, x);
  const Vecf centre = VecfAt(frame.centre);
  for (size_t i = 0; i < size_t{format::kLimbsAPatch} * format::kCapsulesALimb; ++i, x += 6) {
    const CapsuleMotion& capsule = capsules[limbs[i]];
    into.Put(kJoint, VecfAt(capsule.end) - centre, x);
    into.Put(kLength, VecfAt(capsule.end_motion), x + 3);
  }
  const Vecf last = VecfAt(history.last_centre), motion = share * (centre - last);
  into.Put(1, {0, -1, 0}, x);
  into.Put(kWind, VecfAt(pose.wind), x + 3);
  into.Put(kAcceleration, motion - (last - VecfAt(history.before_centre)), x + 6);
  Store(Bounded(centre - motion), history.last_centre);
  if (stage.embedding_size == 0) return;
  std::memcpy(x + 9, stage.embedding + k * stage.embedding_size, stage.embedding_size * sizeof(float));
}

void PlacePoints(const PatchFrame& frame, const float* displacement, size_t points, float* places) {
  const float* u = displacement;
  for (size_t c = 0; c < kAxes; ++c) {
    const float out = frame.axes[c], up = frame.axes[3 + c], along = frame.axes[6 + c];
    for (size_t r = 0; r < points; ++r) {
      const size_t i = c * points + r;
      places[i] = BoundPlace(frame.base[i] + (out * u[r] + up * u[points + r] + along * u[2 * points + r]));
    }
  }
}

}  // namespace dcloth::engine

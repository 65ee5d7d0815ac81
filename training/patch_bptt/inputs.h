// What a patch reads of its cloth and of the body: forward, and the gradient by its own cloth.
#ifndef DCLOTH_TRAINING_PATCH_BPTT_INPUTS_H_
#define DCLOTH_TRAINING_PATCH_BPTT_INPUTS_H_

#include <algorithm>
#include <cmath>
#include <vector>

#include "training/patch_bptt/patch_bptt.h"

namespace patch_bptt {

constexpr int kFrames = 3;  // this tick and the two before it

// Steps of the inputs: what is near 1 in a lively clip.
constexpr double kLength = 10, kLimit = 8, kReach = 0.08, kDeepest = -0.1, kFarthest = 0.3, kSpeed = 10, kFastest = 4;
constexpr double kJoint = 2, kWind = 6, kAcceleration = 20;

template <class Real>
struct V3 {
  Real x, y, z;
  friend V3 operator+(V3 a, V3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
  friend V3 operator-(V3 a, V3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
  friend V3 operator*(Real s, V3 a) { return {s * a.x, s * a.y, s * a.z}; }
  Real Dot(V3 b) const { return x * b.x + y * b.y + z * b.z; }
};

template <class Real>
Real Clamp(double low, double high, Real v) {
  return std::min(std::max(v, static_cast<Real>(low)), static_cast<Real>(high));
}

template <class Real>
struct M3 {
  V3<Real> column[3];
  V3<Real> Out(V3<Real> v) const { return v.x * column[0] + v.y * column[1] + v.z * column[2]; }
  V3<Real> In(V3<Real> v) const { return {column[0].Dot(v), column[1].Dot(v), column[2].Dot(v)}; }
};

template <class Real>
struct Geometry {
  const Real *axes, *centres, *points, *capsules;
  Geometry(const patch_bptt_shape& s, const Real* all)
      : axes(all),
        centres(axes + 9 * s.patches),
        points(centres + 3 * s.patches),
        capsules(points + 16 * s.patches * s.points) {}
};

// One tick of one stream: skinning matrices [J, 12], the hips' way since the tick before, wind.
template <class Real>
struct Pose {
  const Real* values;
  int32_t joints;
  V3<Real> Turn(int32_t j, V3<Real> v) const {
    const Real* m = values + 12 * j;
    return {m[0] * v.x + m[1] * v.y + m[2] * v.z, m[4] * v.x + m[5] * v.y + m[6] * v.z,
            m[8] * v.x + m[9] * v.y + m[10] * v.z};
  }
  V3<Real> Shift(int32_t j) const {
    const Real* m = values + 12 * j;
    return {m[3], m[7], m[11]};
  }
  V3<Real> Place(int32_t j, V3<Real> v) const { return Turn(j, v) + Shift(j); }
  V3<Real> HipsWay() const { return At(12 * joints); }
  V3<Real> Wind() const { return At(12 * joints + 3); }
  V3<Real> At(int32_t i) const { return {values[i], values[i + 1], values[i + 2]}; }
};

template <class Real>
V3<Real> VecAt(const Real* p) {
  return {p[0], p[1], p[2]};
}

// The frame of a patch and its points without displacement, of one tick; metres from the hips of the newest tick.
template <class Real>
struct PatchFrame {
  M3<Real> axes;
  V3<Real> centre;
  std::vector<V3<Real>> base;
};

template <class Real>
class Inputs {
 public:
  Inputs(const patch_bptt_shape& s, const Real* geometry) : s_(s), g_(s, geometry), R_(s.points) {}

  static int32_t Count(const patch_bptt_shape& s) { return 19 * s.points + 33 + s.embedding; }

  // `from_hips`: from the hips of the newest tick to those of the pose.
  void Frame(const Pose<Real>& pose, V3<Real> from_hips, int32_t k, PatchFrame<Real>* f) const {
    const int32_t joint = s_.patch_joint[k];
    for (int c = 0; c < 3; ++c) {
      const Real* a = g_.axes + 9 * k + c;
      f->axes.column[c] = pose.Turn(joint, {a[0], a[3], a[6]});
    }
    f->centre = pose.Place(joint, VecAt(g_.centres + 3 * k)) + from_hips;
    f->base.resize(R_);
    for (int32_t r = 0; r < R_; ++r) {
      V3<Real> sum = from_hips;
      for (int32_t i = 0; i < PATCH_BPTT_INFLUENCES; ++i) {
        const int64_t at = (static_cast<int64_t>(k) * R_ + r) * PATCH_BPTT_INFLUENCES + i;
        const Real* part = g_.points + 4 * at;
        if (part[3] == 0) continue;
        const int32_t j = s_.point_joints[at];
        sum = sum + pose.Turn(j, VecAt(part)) + part[3] * pose.Shift(j);
      }
      f->base[r] = sum;
    }
  }

  // poses and frames: [kFrames], newest first. last, before: [3, R]. x [I] without the embedding.
  void Read(const Pose<Real>* poses, const PatchFrame<Real>* frames, int32_t k, const Real* last, const Real* before,
            Real* x) const {
    const PatchFrame<Real>&now = frames[0], &then = frames[1], &first = frames[2];
    const auto put = [&](Real* to, int32_t r, V3<Real> v) {
      to[r] = Clamp(-kLimit, kLimit, static_cast<Real>(kLength) * v.x);
      to[R_ + r] = Clamp(-kLimit, kLimit, static_cast<Real>(kLength) * v.y);
      to[2 * R_ + r] = Clamp(-kLimit, kLimit, static_cast<Real>(kLength) * v.z);
    };
    std::vector<V3<Real>>& places = places_;
    places.resize(R_);
    for (int32_t r = 0; r < R_; ++r) {
      const V3<Real> a = Of(last, r), b = Of(before, r);
      const V3<Real> was = then.base[r] + then.axes.Out(a), earlier = first.base[r] + first.axes.Out(b);
      places[r] = was;
      put(x, r, a);
      put(x + 3 * R_, r, now.axes.In(was - now.base[r]) - a);
      put(x + 6 * R_, r, now.axes.In(was - earlier));
    }
    x += 9 * R_;
    const V3<Real> back = Real(-1) * poses[0].HipsWay();
    for (int32_t limb = 0; limb < PATCH_BPTT_LIMBS; ++limb, x += 5 * R_) Beside(poses, back, now, k, limb, x);
    for (int32_t limb = 0; limb < PATCH_BPTT_LIMBS; ++limb) {
      const int32_t* bones = s_.limbs + (2 * k + limb) * 2;
      for (int32_t end = 0; end < PATCH_BPTT_BONES_A_LIMB; ++end, x += 6) {
        const int32_t joint = s_.capsule_joints[bones[end]];
        const V3<Real> tip = VecAt(g_.capsules + 8 * bones[end] + 3);
        const V3<Real> at = poses[0].Place(joint, tip), was = poses[1].Place(joint, tip) + back;
        Put3(x, static_cast<Real>(kJoint), now.axes.In(at - now.centre));
        Put3(x + 3, static_cast<Real>(kLength), now.axes.In(at - was));
      }
    }
    Put3(x, 1, now.axes.In({0, -1, 0}));
    Put3(x + 3, static_cast<Real>(kWind), now.axes.In(poses[0].Wind()));
    const V3<Real> turn = now.centre - Real(2) * then.centre + first.centre;
    Put3(x + 6, static_cast<Real>(kAcceleration), now.axes.In(turn));
  }

  // Adds to by_last and by_before what by_x [I] is worth; the distance to the body has no gradient.
  void Back(const PatchFrame<Real>* frames, const Real* x, const Real* by_x, Real* by_last, Real* by_before) const {
    const auto get = [&](int32_t at, int32_t r) {
      const auto one = [&](int32_t i) {
        return x[i] > -kLimit && x[i] < kLimit ? static_cast<Real>(kLength) * by_x[i] : Real(0);
      };
      return V3<Real>{one(at + r), one(at + R_ + r), one(at + 2 * R_ + r)};
    };
    for (int32_t r = 0; r < R_; ++r) {
      const V3<Real> a = get(0, r), h = get(3 * R_, r), v = get(6 * R_, r);
      Add(by_last, r, a - h + frames[1].axes.In(frames[0].axes.Out(h + v)));
      Add(by_before, r, Real(-1) * frames[2].axes.In(frames[0].axes.Out(v)));
    }
  }

 private:
  V3<Real> Of(const Real* u, int32_t r) const { return {u[r], u[R_ + r], u[2 * R_ + r]}; }
  void Add(Real* u, int32_t r, V3<Real> v) const { u[r] += v.x, u[R_ + r] += v.y, u[2 * R_ + r] += v.z; }
  static void Put3(Real* x, Real scale, V3<Real> v) {
    x[0] = Clamp(-kLimit, kLimit, scale * v.x);
    x[1] = Clamp(-kLimit, kLimit, scale * v.y);
    x[2] = Clamp(-kLimit, kLimit, scale * v.z);
  }

  // The nearer surface of a limb's two capsules: normal times nearness [3, R], distance [R], motion along the normal.
  void Beside(const Pose<Real>* poses, V3<Real> back, const PatchFrame<Real>& now, int32_t k, int32_t limb,
              Real* x) const {
    V3<Real> start[2], way[2], moved[2][2];
    Real radius[2][2], squared[2];
    for (int b = 0; b < 2; ++b) {
      const int32_t c = s_.limbs[(2 * k + limb) * 2 + b], joint = s_.capsule_joints[c];
      const Real* capsule = g_.capsules + 8 * c;
      for (int end = 0; end < 2; ++end) {
        const V3<Real> at = poses[0].Place(joint, VecAt(capsule + 3 * end));
        moved[b][end] = at - poses[1].Place(joint, VecAt(capsule + 3 * end)) - back;
        radius[b][end] = capsule[6 + end];
        if (end == 0)
          start[b] = at;
        else
          way[b] = at - start[b];
      }
      squared[b] = std::max(way[b].Dot(way[b]), Real(1e-8));
    }
    for (int32_t r = 0; r < R_; ++r) {
      Real nearest = 0, speed = 0;
      V3<Real> normal = {};
      for (int b = 0; b < 2; ++b) {
        const V3<Real> from = places_[r] - start[b];
        const Real u = Clamp(0, 1, from.Dot(way[b]) / squared[b]);
        const V3<Real> away = from - u * way[b];
        const Real length = std::max(std::sqrt(away.Dot(away)), Real(1e-4));
        const Real distance = length - (radius[b][0] + u * (radius[b][1] - radius[b][0]));
        if (b == 1 && !(distance < nearest)) break;
        nearest = distance;
        normal = (1 / length) * away;
        speed = normal.Dot(moved[b][0] + u * (moved[b][1] - moved[b][0]));
      }
      const Real near = std::exp(-std::max(nearest, Real(0)) / static_cast<Real>(kReach));
      const V3<Real> n = now.axes.In(normal);
      x[r] = near * n.x, x[R_ + r] = near * n.y, x[2 * R_ + r] = near * n.z;
      x[3 * R_ + r] = static_cast<Real>(kLength) * Clamp(kDeepest, kFarthest, nearest);
      x[4 * R_ + r] = Clamp(-kFastest, kFastest, static_cast<Real>(kSpeed) * speed * near);
    }
  }

  const patch_bptt_shape& s_;
  Geometry<Real> g_;
  int32_t R_;
  mutable std::vector<V3<Real>> places_;
};

}  // namespace patch_bptt

#endif  // DCLOTH_TRAINING_PATCH_BPTT_INPUTS_H_

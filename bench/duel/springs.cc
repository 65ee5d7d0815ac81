// Chains of spring bones, as characters for games carry them: the update of VRMC_springBone 1.0, with capsules.
//   chains, bones  which set of the case; stiffness, drag, gravity: of VRM; radius: m of a bone's sphere
//   follow         share of the hips' way that the chains are carried along; VRM has 0, or 1 with a `center`
#include <algorithm>

#include "bench/duel/drawn.h"
#include "bench/duel/method.h"
#include "training/cloth_solver/vec.h"

namespace dcloth::duel {
namespace {

using cloth_solver::Cross;
using cloth_solver::Dot;
using cloth_solver::Length;
using cloth_solver::Unit;
using cloth_solver::Vec;

Vec VecOf(Four a) { return {a[0], a[1], a[2]}; }
Four FourOf(const Vec& a) { return Four{a.x, a.y, a.z, 0}; }

struct Capsule {
  Vec a, b;
  float ra, rb;
};

// The turn that takes `from` to `to`, both of unit length, after `m`'s.
Columns Turned(const Columns& m, const Vec& from, const Vec& to) {
  const Vec axis = Cross(from, to);
  const float cosine = Dot(from, to), share = 1 / std::max(1 + cosine, 1e-4F);
  Columns out = m;
  for (int c = 0; c < 3; ++c) {
    const Vec v = VecOf(m[c]);
    out[c] = FourOf(cosine * v + Cross(axis, v) + share * Dot(axis, v) * axis);
  }
  return out;
}

class Springs : public Method {
 public:
  Springs(const Case& data, const Options& options)
      : key_("chains." + std::to_string(static_cast<int>(options.Get("chains", 16))) + "x" +
             std::to_string(static_cast<int>(options.Get("bones", 4)))),
        bones_(static_cast<int>(options.Get("bones", 4))),
        stiffness_(options.Get("stiffness", 0.3)),
        drag_(options.Get("drag", 0.3)),
        gravity_(options.Get("gravity", 0.1)),
        radius_(options.Get("radius", 0.02)),
        follow_(options.Get("follow", 1)),
        drawn_(data),
        bind_(data.Get<float>("bind")),
        rest_(data.Get<float>("draw.rest")),
        joints_(data.Get<float>(key_)),
        weight_(data.Get<float>(key_ + ".weight")),
        capsules_(data.Get<float>("capsules")),
        bone_(data.Get<int32_t>(key_ + ".bone")),
        capsule_joints_(data.Get<int32_t>("capsule_joints")),
        skin_(data.Rows("bind") + data.Rows(key_) * bones_),
        now_(data.Rows(key_) * bones_),
        before_(now_.size()),
        shapes_(capsule_joints_.size()) {}

  void Start(Pose pose, std::span<const float>) override {
    Posed(pose);
    for (size_t chain = 0; chain < now_.size() / bones_; ++chain)
      for (int k = 0; k < bones_; ++k) now_[chain * bones_ + k] = VecOf(Place(skin_[0], Rest(chain, k + 1)));
    before_ = now_;
    hips_ = {pose[3], pose[7], pose[11]};
  }

  void Frame(Pose pose, float seconds, bool) override {
    Posed(pose);
    const int steps = Steps(seconds);
    const Vec hips = {pose[3], pose[7], pose[11]};
    const Vec way = (follow_ / static_cast<float>(steps)) * (hips - hips_);
    hips_ = hips;
    for (int step = 0; step < steps; ++step)
      for (size_t chain = 0; chain < now_.size() / bones_; ++chain)
        Swing(chain, seconds / static_cast<float>(steps), way);
    drawn_.FollowBones(skin_, bone_, weight_, rest_);
  }
  std::span<const float> positions() const override { return drawn_.positions(); }
  size_t instance_bytes() const override {
    return 2 * now_.size() * sizeof(Vec) + skin_.size() * sizeof(Columns) + 6 * drawn_.vertices() * sizeof(float);
  }
  size_t shared_bytes() const override { return 4 * (rest_.size() + weight_.size() + bone_.size()); }

 private:
  Vec Rest(size_t chain, int k) const {
    const float* at = &joints_[3 * (chain * (bones_ + 1) + k)];
    return {at[0], at[1], at[2]};
  }
  static Four Place(const Columns& m, const Vec& p) { return Apply(m, p.x, p.y, p.z); }

  void Posed(Pose pose) {
    const size_t joints = bind_.size() / 16;
    SkinMatrices(pose, bind_, std::span(skin_).first(joints));
    for (size_t k = 0; k < shapes_.size(); ++k) {
      const float* c = &capsules_[8 * k];
      const Columns& m = skin_[capsule_joints_[k]];
      shapes_[k] = {VecOf(Place(m, {c[0], c[1], c[2]})), VecOf(Place(m, {c[3], c[4], c[5]})), c[6], c[7]};
    }
  }

  // Joint 0 of the skeleton carries the chains; each bone turns with the one above it.
  void Swing(size_t chain, float dt, const Vec& way) {
    Columns above = skin_[0];
    Vec head = VecOf(Place(above, Rest(chain, 0)));
    for (int k = 0; k < bones_; ++k) {
      const size_t at = chain * bones_ + k;
      const Vec bind = Rest(chain, k + 1) - Rest(chain, k),
                axis = VecOf(bind.x * above[0] + bind.y * above[1] + bind.z * above[2]);
      const float length = Length(bind);
      const Vec pull = (stiffness_ * dt) * Unit(axis), fall = {0, -gravity_ * dt, 0};
      now_[at] += way, before_[at] += way;
      Vec tail = now_[at] + (1 - drag_) * (now_[at] - before_[at]) + pull + fall;
      tail = head + length * Unit(tail - head);
      for (const Capsule& shape : shapes_) {
        const Vec along = shape.b - shape.a;
        const float t = std::clamp(Dot(tail - shape.a, along) / std::max(Dot(along, along), 1e-12F), 0.0F, 1.0F);
        const Vec away = tail - (shape.a + t * along);
        const float least = std::max(shape.ra + t * (shape.rb - shape.ra) + radius_, 0.0F);
        if (Dot(away, away) >= least * least) continue;
        tail += (least - Length(away)) * Unit(away);
        tail = head + length * Unit(tail - head);
      }
      before_[at] = now_[at], now_[at] = tail;
      Columns& own = skin_[bind_.size() / 16 + at];
      own = Turned(above, Unit(axis), Unit(tail - head));
      own[3] = Four{};
      own[3] = FourOf(head) - Place(own, Rest(chain, k));
      above = own, head = tail;
    }
  }

  std::string key_;
  int bones_;
  float stiffness_, drag_, gravity_, radius_, follow_;
  Vec hips_;
  Drawn drawn_;
  std::vector<float> bind_, rest_, joints_, weight_, capsules_;
  std::vector<int32_t> bone_, capsule_joints_;
  std::vector<Columns> skin_;
  std::vector<Vec> now_, before_;
  std::vector<Capsule> shapes_;
};

}  // namespace

std::unique_ptr<Method> MakeSprings(const Case& data, const Options& options) {
  return std::make_unique<Springs>(data, options);
}

}  // namespace dcloth::duel

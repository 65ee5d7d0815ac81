// The paper's three stages in double, written from NETWORK.md alone, with a bound on what float arithmetic may change.
// The patch stage has a reference of its own, in network/patch_stage_test.cc.
#ifndef DCLOTH_TESTS_UNIT_ENGINE_REFERENCE_NETWORK_H_
#define DCLOTH_TESTS_UNIT_ENGINE_REFERENCE_NETWORK_H_

#include <array>
#include <vector>

#include "tests/unit/engine/bounded.h"
#include "tests/unit/engine/model_builder.h"

namespace dcloth::testing {

using Matrix4 = std::array<std::array<double, 4>, 4>;

// y = x W + b over W's first x.size() rows; with int8 weights also the error of 16-bit activations.
Vector Apply(const Linear& linear, const Vector& x);

class ReferenceNetwork {
 public:
  explicit ReferenceNetwork(const Numbers& numbers);

  void Reset();
  void SetWind(const std::array<double, 3>& wind) { wind_ = wind; }  // m/s, world
  void Tick(const std::vector<float>& pose, uint32_t stages);        // row-major matrices, DCLOTH_STAGES_*

  // [n, 3], relative to the hips and in the world.
  struct Frame {
    Vector relative, world;
  };
  Frame Skin(const std::vector<float>& pose, double blend) const;

  // [n, 3] from Frame::relative.
  Vector Normals(const Vector& relative) const;

  const Vector& features() const { return features_; }

 private:
  struct Bind {
    std::vector<Matrix4> joints;  // G_j B_j^-1
    std::array<double, 3> hips;   // world
  };
  struct Tick2 {
    Vector increments, displacement;
  };

  Bind BindOf(const std::vector<float>& pose) const;
  void UpdateFeatures(const Bind& bind);
  Matrix4 HeadingInverse() const;
  void RunGru();
  Vector BodyPoints(const Bind& bind) const;
  Vector RunLayer(size_t index, const Vector& x);
  Vector RunMesh(const Bind& bind);
  Vector Stacked(const Vector& q) const;
  Vector Mixed(const Vector& q) const;

  const Numbers& numbers_;
  bool started_ = false;
  double yaw_ = 0;
  std::array<double, 3> hips_ = {}, wind_ = {};
  std::vector<std::array<double, 3>> places_;  // of the hips, tick by tick since the reset
  Vector features_;
  Vector h_;                    // skeleton stage
  std::vector<Vector> states_;  // mesh stage, per layer [n, F]
  Tick2 last_, before_;
  size_t ticks_ = 0;
  uint32_t last_stages_ = 0;
};

}  // namespace dcloth::testing

#endif  // DCLOTH_TESTS_UNIT_ENGINE_REFERENCE_NETWORK_H_

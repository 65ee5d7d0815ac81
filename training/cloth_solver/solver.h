// The state of one garment and one small step of it.
#pragma once
#include <vector>

#include "body.h"
#include "cloth_solver.h"
#include "layers.h"
#include "mesh.h"

namespace cloth_solver {

class Solver {
 public:
  explicit Solver(const cloth_solver_problem& problem);

  // Moves from frame `frame` - 1 to `frame`.
  void Frame(int32_t frame);
  bool Write(float* out) const;  // world positions [vertices, 3]; false when one is not finite or too far away

 private:
  Vec At(const float* path, int32_t count, int32_t frame, int32_t i) const;  // relative to origin_
  void MakeSprings();
  void Step(float t);
  void Predict();
  void Bend();
  void Stretch();
  void HoldTethers();
  void UpdateVelocities();
  void PushOut();
  void Damp();

  const cloth_solver_problem& problem_;
  cloth_solver_settings settings_;
  float dt_;
  Mesh mesh_;
  Body body_;
  Layers layers_;
  std::vector<Tether> tethers_;
  static constexpr int kBlock = 8;
  struct alignas(32) Springs {
    float rest[kBlock] = {}, yield[kBlock] = {};  // m; 1/kg: compliance over the step's squared length
    int32_t a[kBlock] = {}, b[kBlock] = {};
  };
  std::vector<Springs> springs_;
  struct alignas(16) Point {
    Vec x;
    float w = 0;
  };
  std::vector<Point> points_;  // Stretch's own
  std::vector<int32_t> pins_;
  std::vector<float> inverse_mass_;
  std::vector<float> drag_normal_, drag_tangent_;  // 1/m: deceleration over squared speed
  std::vector<Vec> x_, before_, v_, normals_, smoothed_, pin_from_, pin_to_;
  Vec origin_;  // of the simulation in the world, so that floats stay small and precise
  Vec wind_from_, wind_to_, wind_;
  struct Push {
    int step = -1;
    Vec normal;
  };
  std::vector<Push> pushed_;  // by the body, last
  int step_ = 0;
};

}  // namespace cloth_solver

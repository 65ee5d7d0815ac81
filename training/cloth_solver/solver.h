// The state of one garment and one small step of it.
#pragma once
#include <vector>

#include "cloth_solver.h"
#include "collider.h"
#include "mesh.h"

namespace cloth_solver {

class Solver {
 public:
  explicit Solver(const cloth_solver_problem& problem);

  // Moves from frame `frame` - 1 to `frame`.
  void Frame(int32_t frame);
  bool Write(float* out) const;  // world positions [vertices, 3]; false when one is not finite or too far away

 private:
  struct Distance {
    int32_t a, b;
    float rest;
  };
  Vec At(const float* path, int32_t count, int32_t frame, int32_t i) const;  // relative to origin_
  void Step(float t);
  void Predict();
  void Solve(const std::vector<Distance>& constraints, float compliance);
  void HoldTethers();
  void PushOut();
  void UpdateVelocities();
  void SmoothVelocities();

  const cloth_solver_problem& problem_;
  cloth_solver_settings settings_;
  float dt_;
  Mesh mesh_;
  Collider collider_;
  std::vector<Distance> stretch_, bend_, brace_;
  std::vector<Tether> tethers_;
  std::vector<int32_t> pins_;
  std::vector<float> inverse_mass_;
  std::vector<Vec> x_, before_, v_, normals_, smoothed_, pin_from_, pin_to_;
  std::vector<uint8_t> touching_;
  std::vector<Vec> slide_;      // contact: velocity of the body where a vertex touches it
  std::vector<Vec> slide_normal_;
  Vec origin_;                  // of the simulation in the world: the hips, so that floats stay small and precise
  Vec air_velocity_, air_spin_;
  Vec up_, up_from_, up_to_;    // the hips'
  int step_ = 0;
};

}  // namespace cloth_solver

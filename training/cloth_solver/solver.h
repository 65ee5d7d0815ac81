// The state of one garment and one small step of it.
#pragma once
#include <array>
#include <vector>

#include "body.h"
#include "cloth_solver.h"
#include "lanes.h"
#include "layers.h"
#include "mesh.h"

namespace cloth_solver {

class Solver {
 public:
  explicit Solver(const cloth_solver_problem& problem);

  // Moves from frame `frame` - 1 to `frame`.
  void Frame(int32_t frame);
  // World positions [vertices, 3], those of vertex i at given[i]; false when one is not finite or too far away.
  bool Write(const std::vector<int32_t>& given, float* out) const;

 private:
  Vec At(const float* path, int32_t count, int32_t frame, int32_t i) const;  // relative to origin_
  void MakeSprings();
  void MakeHinges();
  void Step(float t);
  void LookAtNormals();
  void Damp();
  void Predict();
  void Bend();
  void Stretch();
  void UpdateVelocities();
  void PushOut();
  void TakeContact(int32_t part, int32_t i);

  const cloth_solver_problem& problem_;
  cloth_solver_settings settings_;
  float dt_;
  // Cloth vertices in memory: as many as fill blocks up. Those beyond the last one are nobody's; constraints that fill
  // a block up name spare_.
  int32_t spare_;
  size_t padded_;
  Mesh mesh_;
  std::vector<int32_t> pins_;
  std::vector<uint32_t> touches_;  // parts of the body; none where a vertex is pinned
  Body body_;
  Layers layers_;
  struct Springs {
    Floats rest, longer, shorter, weight_a, weight_b;  // m; kg: share of a change in length, over inverse masses; 1/kg
    std::array<Offset, kLanes> a, b;
  };
  std::vector<Springs> springs_;
  struct Hinges {
    Floats k[4], move[4];  // of a vertex along the curvature vector
    std::array<Offset, kLanes> v[4];
  };
  struct Creases {  // of the first hinges
    std::array<int32_t, kLanes> a, b;  // ends of the edge
    std::array<float, kLanes> rest;
    std::array<Point, kLanes> bent;  // curvature vector at rest
  };
  std::vector<Hinges> hinges_;
  std::vector<Creases> creases_;
  struct Tethers {
    Floats most;
    std::array<int32_t, kLanes> pin;
  };
  std::vector<Tethers> tethers_;
  std::vector<float> inverse_mass_;
  std::vector<float> drag_normal_, drag_tangent_;  // 1/m: deceleration over squared speed
  std::vector<Point> x_, before_, v_, normals_, smoothed_;
  std::vector<Vec> pin_from_, pin_to_;
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

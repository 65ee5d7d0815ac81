// The body as a cloth vertex feels it: for each part the nearest body vertex, followed over time, and a smooth surface
// through that vertex and its neighbours.
#pragma once
#include <cstdint>
#include <vector>

#include "mesh.h"

namespace cloth_solver {

struct Contact {
  bool near = false;
  float distance = 0;  // signed, positive outside
  Vec normal;
  Vec velocity;        // of the surface, m/s
};

class Collider {
 public:
  // `touches` [cloth vertices] bit p: the vertex touches part p; empty: all do.
  Collider(Mesh mesh, std::vector<uint32_t> part, int32_t parts, std::vector<uint32_t> touches, int32_t cloth_vertices);

  // Where the body is at the start and the end of a frame, and how far cloth may travel in it.
  void BeginFrame(std::vector<Vec> from, std::vector<Vec> to, float seconds, const std::vector<Vec>& cloth,
                  float cloth_travel);
  // The body at `t` in 0..1 of the frame.
  void MoveTo(float t);
  int32_t parts() const { return parts_; }
  // Cloth vertices that may touch part p during this frame.
  const std::vector<int32_t>& candidates(int32_t p) const { return candidates_[p]; }
  Contact Touch(int32_t p, int32_t cloth_vertex, const Vec& at);

 private:
  Mesh mesh_;
  std::vector<uint32_t> part_, rim_;            // bit p: in part p; at its edge
  std::vector<uint32_t> touches_;
  int32_t parts_;
  float spacing_ = 0;                           // greatest edge length of the body in bind pose
  float per_second_ = 0;
  std::vector<std::vector<int32_t>> members_;   // body vertices of each part
  std::vector<std::vector<int32_t>> candidates_;
  std::vector<std::vector<int32_t>> nearest_;   // [part][cloth vertex]
  std::vector<Vec> from_, to_, from_normal_, to_normal_, at_, normal_;
};

}  // namespace cloth_solver

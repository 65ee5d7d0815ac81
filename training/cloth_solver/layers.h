// Contact between layers of cloth: vertices are kept on their side of triangles that are no neighbours of theirs.
#pragma once
#include <cstdint>
#include <utility>
#include <vector>

#include "mesh.h"

namespace cloth_solver {

class Layers {
 public:
  Layers(const Mesh& mesh, int32_t vertices);

  // Whether a vertex has moved so far since the last search, beside the cloth's mean, that Find must search again.
  bool Due(const std::vector<Vec>& x) const;
  // Finds vertices that are near a triangle which is no neighbour of theirs. A pair that is known keeps its side.
  void Find(const std::vector<Vec>& x);
  // Moves vertices and triangles apart where they are nearer than `thickness`, and takes their approach velocity away.
  void Hold(std::vector<Vec>* x, std::vector<Vec>* v, const std::vector<float>& inverse_mass,
            float thickness) const;

 private:
  struct Pair {
    int32_t vertex, face;
    float side;  // +1 or -1
  };
  bool Adjacent(int32_t a, int32_t b) const;
  bool Close(int32_t a, int32_t b) const;  // at most two edges apart

  const Mesh& mesh_;
  float reach_;                                    // m between vertices of two layers that are looked at
  std::vector<int32_t> ring_first_, ring_;         // CSR: vertices at most two edges away, ascending
  std::vector<int32_t> around_first_, around_;     // CSR: faces about a vertex
  std::vector<int32_t> cell_first_, cell_, order_; // hash grid: vertices sorted by cell
  std::vector<Vec> sorted_;                        // positions in that order
  std::vector<std::pair<int32_t, int32_t>> near_;  // vertices of two layers within reach of each other
  std::vector<Vec> last_;                          // positions at the last search
  std::vector<Pair> pairs_, before_;               // by vertex, then face
};

}  // namespace cloth_solver

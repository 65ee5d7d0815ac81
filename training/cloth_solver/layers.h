// Contact between layers of cloth: vertices are kept on their side of triangles that are no neighbours of theirs.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "lanes.h"
#include "mesh.h"

namespace cloth_solver {

class Layers {
 public:
  Layers(const Mesh& mesh, int32_t vertices);

  // Whether a vertex has moved so far since the last search, beside the cloth's mean, that Find must search again.
  bool Due(const std::vector<Point>& x) const;
  // Finds vertices that are near a triangle which is no neighbour of theirs. A pair that is known keeps its side.
  void Find(const std::vector<Point>& x);
  // Moves vertices and triangles apart where they are nearer than `thickness`, and takes their approach velocity away.
  void Hold(std::vector<Point>* x, std::vector<Point>* v, const std::vector<float>& inverse_mass,
            float thickness) const;

 private:
  struct Pair {
    int32_t vertex, face;
    float side;  // +1 or -1
  };
  struct PairBlock {
    std::array<int32_t, kLanes> vertex, a, b, c;
    Floats side;
  };
  static constexpr uint32_t kCells = 1 << 14, kAlongY = 19349663u, kAlongZ = 83492791u;
  struct Place {
    uint32_t x, y, z;  // number of the cell along x, hashes of those along y and z
    int32_t sorted;    // place of the vertex in the order of cells
    // The cell some cells away: those of a row along x follow each other.
    uint32_t Cell(int32_t x_on, int32_t y_on, int32_t z_on) const {
      return (((y + kAlongY * static_cast<uint32_t>(y_on)) ^ (z + kAlongZ * static_cast<uint32_t>(z_on))) + x +
              static_cast<uint32_t>(x_on)) & (kCells - 1);
    }
  };
  bool Adjacent(int32_t a, int32_t b) const;
  void FindNear(const std::vector<Point>& x);
  void FindPairs();
  void HoldPair(const PairBlock& pairs, int k, std::vector<Point>* x, std::vector<Point>* v,
                const std::vector<float>& inverse_mass, float thickness) const;
  bool Close(int32_t a, int32_t b) const;  // at most two edges apart

  const Mesh& mesh_;
  int32_t count_;                                // vertices; further ones fill blocks up
  float reach_;                                  // m between vertices of two layers that are looked at
  std::vector<int32_t> ring_first_, ring_;       // CSR: vertices at most two edges away, -1 where a block ends early
  std::vector<int32_t> around_first_, around_;   // CSR: faces about a vertex
  std::vector<Place> place_;                              // in a hash grid
  std::vector<int32_t> cell_first_, order_, next_;        // vertices sorted by cell
  std::vector<float> sorted_x_, sorted_y_, sorted_z_;     // positions in that order
  std::vector<uint64_t> near_;         // vertices of two layers within reach of each other: first << 32 | second
  std::vector<Point> last_;            // positions at the last search
  std::vector<Pair> pairs_, before_;   // by vertex, then face
  std::vector<PairBlock> blocks_;      // the same
  std::vector<int32_t> faces_;
};

}  // namespace cloth_solver

// What the solver reads off a triangle mesh: edges, hinges, neighbours, normals, and the flat pattern's measures.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "lanes.h"
#include "vec.h"

namespace cloth_solver {

struct Edge {
  int32_t a, b;
  float rest;       // m, in the pattern
  float stiffness;  // N/m of this spring
};

// Two triangles that share the edge (v[0], v[1]); v[2] and v[3] lie opposite. Sum of k[i] x[v[i]] is the edge's
// integrated curvature vector: zero where the cloth is flat, 2 |edge| sin(angle / 2) long where it is folded.
struct Hinge {
  std::array<int32_t, 4> v;
  std::array<float, 4> k;
  float compliance;  // m/N
  float rest;        // length of that vector in a pressed pleat, signed along the normal; 0: flat
};

struct Mesh {
  std::vector<std::array<int32_t, 3>> faces;
  std::vector<Edge> edges;                 // by vertices a < b, rising
  std::vector<Hinge> hinges;               // the same
  std::vector<float> area;                 // [vertices] m^2 of pattern that belongs to a vertex
  std::vector<int32_t> first, neighbours;  // CSR of vertices, without the vertex itself
};

struct Fabric {
  float stretch, bias, bend;
};

// `pattern` [faces, 3, 2]; `bend_scale` and `crease` [vertices] or null, see cloth_solver.h.
Mesh MakeMesh(int32_t vertices, int32_t faces, const int32_t* face, const float* pattern, const float* bend_scale,
              const float* crease, const Fabric& fabric);

// Area-weighted normals of unit length of the first vertices of `at`, as many as `out` holds.
void Normals(const Mesh& mesh, const std::vector<Point>& at, std::vector<Point>* out);

// Numbers below `items` in blocks of kLanes, -1 where a block ends early. Those of a block share no vertex: their
// constraints are solved side by side. Consecutive blocks rarely share one (greedy colouring), so that a Gauss-Seidel
// pass favours no direction of the mesh and the processor overlaps them. `vertices_of` gives the vertices of an item.
using Block = std::array<int32_t, kLanes>;
template <typename Vertices>
std::vector<Block> Blocks(int32_t items, int32_t vertices, Vertices vertices_of) {
  constexpr int kColours = 63;
  std::vector<std::vector<int32_t>> colours(kColours + 1);
  std::vector<uint64_t> used(vertices, 0);
  for (int32_t item = 0; item < items; ++item) {
    uint64_t taken = 0;
    for (int32_t v : vertices_of(item)) taken |= used[v];
    int colour = 0;
    while (colour < kColours && (taken >> colour & 1)) ++colour;
    for (int32_t v : vertices_of(item)) used[v] |= uint64_t{1} << colour;
    colours[colour].push_back(item);
  }
  std::vector<Block> out;
  for (int colour = 0; colour <= kColours; ++colour) {
    const size_t side_by_side = colour < kColours ? kLanes : 1;  // those beyond all colours may share vertices
    for (size_t k = 0; k < colours[colour].size(); ++k) {
      if (k % side_by_side == 0) out.emplace_back().fill(-1);
      out.back()[k % side_by_side] = colours[colour][k];
    }
  }
  return out;
}

// For each vertex the pinned vertex nearest along the edges, and that distance (Dijkstra). -1 where none is reached.
struct Tether {
  int32_t pin = -1;
  float length = 0;
};
std::vector<Tether> Tethers(const Mesh& mesh, int32_t vertices, const std::vector<int32_t>& pins);

}  // namespace cloth_solver

// What the solver reads off a triangle mesh: edges, the vertices across them, neighbours, normals.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "vec.h"

namespace cloth_solver {

struct Pair {
  int32_t a, b;
};

struct Mesh {
  std::vector<std::array<int32_t, 3>> faces;
  std::vector<Pair> edges;                 // each once
  std::vector<Pair> across;                // the two vertices opposite an inner edge
  std::vector<int32_t> first, neighbours;  // CSR, without the vertex itself
};

Mesh MakeMesh(int32_t vertices, int32_t faces, const int32_t* face);

// Area-weighted vertex normals of unit length.
void Normals(const Mesh& mesh, const std::vector<Vec>& at, std::vector<Vec>& out);

// Pairs in an order in which neighbours in the list share no vertex: a Gauss-Seidel pass then favours no direction of the
// mesh, and the processor can overlap consecutive constraints.
std::vector<Pair> Interleave(const std::vector<Pair>& pairs, int32_t vertices);

// Braces: pairs `rings` edges apart, up to `directions` from every second vertex, spread over all directions. They carry
// bending over more than one edge, which one pass a step over neighbouring vertices cannot.
std::vector<Pair> Braces(const Mesh& mesh, const std::vector<Vec>& rest, int rings, int directions);

// For each vertex the pinned vertex nearest along the edges, and that distance (Dijkstra). -1 where none is reached.
struct Tether {
  int32_t pin = -1;
  float length = 0;
};
std::vector<Tether> Tethers(const Mesh& mesh, const std::vector<Vec>& rest, const std::vector<int32_t>& pins);

}  // namespace cloth_solver

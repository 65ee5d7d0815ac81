// What the solver reads off a triangle mesh: edges, hinges, neighbours, normals, and the flat pattern's measures.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

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
  std::vector<Edge> edges;                 // in an order in which consecutive ones share no vertex
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

// Area-weighted vertex normals of unit length.
void Normals(const Mesh& mesh, const std::vector<Vec>& at, std::vector<Vec>& out);

// For each vertex the pinned vertex nearest along the edges, and that distance (Dijkstra). -1 where none is reached.
struct Tether {
  int32_t pin = -1;
  float length = 0;
};
std::vector<Tether> Tethers(const Mesh& mesh, int32_t vertices, const std::vector<int32_t>& pins);

}  // namespace cloth_solver

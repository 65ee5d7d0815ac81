#include "mesh.h"

#include <algorithm>
#include <limits>
#include <queue>

namespace cloth_solver {

Mesh MakeMesh(int32_t vertices, int32_t faces, const int32_t* face) {
  Mesh mesh;
  struct Side {
    int32_t a, b, opposite;
  };
  std::vector<Side> sides;
  for (int32_t f = 0; f < faces; ++f) {
    const int32_t* v = face + 3 * f;
    mesh.faces.push_back({v[0], v[1], v[2]});
    for (int k = 0; k < 3; ++k)
      sides.push_back({std::min(v[k], v[(k + 1) % 3]), std::max(v[k], v[(k + 1) % 3]), v[(k + 2) % 3]});
  }
  std::sort(sides.begin(), sides.end(), [](const Side& p, const Side& q) {
    return p.a != q.a ? p.a < q.a : p.b != q.b ? p.b < q.b : p.opposite < q.opposite;
  });
  for (size_t i = 0; i < sides.size(); ++i) {
    const bool again = i > 0 && sides[i].a == sides[i - 1].a && sides[i].b == sides[i - 1].b;
    if (again) mesh.across.push_back({sides[i - 1].opposite, sides[i].opposite});
    else mesh.edges.push_back({sides[i].a, sides[i].b});
  }
  mesh.first.assign(vertices + 1, 0);
  for (const Pair& e : mesh.edges) ++mesh.first[e.a + 1], ++mesh.first[e.b + 1];
  for (int32_t i = 0; i < vertices; ++i) mesh.first[i + 1] += mesh.first[i];
  mesh.neighbours.resize(mesh.first[vertices]);
  std::vector<int32_t> next(mesh.first.begin(), mesh.first.end() - 1);
  for (const Pair& e : mesh.edges) mesh.neighbours[next[e.a]++] = e.b, mesh.neighbours[next[e.b]++] = e.a;
  return mesh;
}

void Normals(const Mesh& mesh, const std::vector<Vec>& at, std::vector<Vec>& out) {
  out.assign(at.size(), Vec{});
  for (const auto& [a, b, c] : mesh.faces) {
    const Vec n = Cross(at[b] - at[a], at[c] - at[a]);
    out[a] += n, out[b] += n, out[c] += n;
  }
  for (Vec& n : out) n = Unit(n);
}

std::vector<Pair> Interleave(const std::vector<Pair>& pairs, int32_t vertices) {
  std::vector<std::vector<Pair>> colours;
  std::vector<uint64_t> used(vertices, 0);
  for (const Pair& p : pairs) {
    const uint64_t taken = used[p.a] | used[p.b];
    int colour = 0;
    while (colour < 63 && (taken >> colour & 1)) ++colour;
    used[p.a] |= uint64_t{1} << colour, used[p.b] |= uint64_t{1} << colour;
    if (static_cast<size_t>(colour) >= colours.size()) colours.resize(colour + 1);
    colours[colour].push_back(p);
  }
  std::vector<Pair> out;
  for (const auto& colour : colours) out.insert(out.end(), colour.begin(), colour.end());
  return out;
}

std::vector<Pair> Braces(const Mesh& mesh, const std::vector<Vec>& rest, int rings, int directions) {
  std::vector<Pair> out;
  std::vector<int32_t> seen_by(rest.size(), -1), ring, next;
  for (int32_t i = 0; i < static_cast<int32_t>(rest.size()); i += 2) {
    ring.assign(1, i);
    seen_by[i] = i;
    for (int r = 0; r < rings; ++r) {
      next.clear();
      for (int32_t v : ring)
        for (int32_t k = mesh.first[v]; k < mesh.first[v + 1]; ++k)
          if (const int32_t j = mesh.neighbours[k]; seen_by[j] != i) seen_by[j] = i, next.push_back(j);
      ring.swap(next);
    }
    // Farthest first, then always the one farthest from all chosen.
    std::vector<float> apart(ring.size());
    for (size_t k = 0; k < ring.size(); ++k) apart[k] = Length(rest[ring[k]] - rest[i]);
    for (int d = 0; d < directions && !ring.empty(); ++d) {
      const size_t best = std::max_element(apart.begin(), apart.end()) - apart.begin();
      const int32_t chosen = ring[best];
      out.push_back({std::min(i, chosen), std::max(i, chosen)});
      for (size_t k = 0; k < ring.size(); ++k) {
        const float distance = Length(rest[ring[k]] - rest[chosen]);
        apart[k] = d == 0 ? distance : std::min(apart[k], distance);
      }
    }
  }
  const auto order = [](const Pair& p, const Pair& q) { return p.a != q.a ? p.a < q.a : p.b < q.b; };
  std::sort(out.begin(), out.end(), order);
  out.erase(std::unique(out.begin(), out.end(), [](const Pair& p, const Pair& q) { return p.a == q.a && p.b == q.b; }),
            out.end());
  return out;
}

std::vector<Tether> Tethers(const Mesh& mesh, const std::vector<Vec>& rest, const std::vector<int32_t>& pins) {
  std::vector<Tether> out(rest.size(), {-1, std::numeric_limits<float>::max()});
  using Item = std::pair<float, int32_t>;
  std::priority_queue<Item, std::vector<Item>, std::greater<Item>> queue;
  for (int32_t pin : pins) out[pin] = {pin, 0}, queue.push({0, pin});
  while (!queue.empty()) {
    const auto [length, i] = queue.top();
    queue.pop();
    if (length > out[i].length) continue;
    for (int32_t k = mesh.first[i]; k < mesh.first[i + 1]; ++k) {
      const int32_t j = mesh.neighbours[k];
      const float reached = length + Length(rest[i] - rest[j]);
      if (reached < out[j].length) out[j] = {out[i].pin, reached}, queue.push({reached, j});
    }
  }
  return out;
}

}  // namespace cloth_solver

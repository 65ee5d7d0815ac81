#include "mesh.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <queue>

namespace cloth_solver {
namespace {

struct Side {
  int32_t a, b, opposite, face;
  float length;   // in the pattern of its face
  float bias;     // 0 along a thread, 1 at 45 degrees to it
  float cot_a, cot_b;  // cotangents of the face's angles at a and b
};

// With an energy of B / (2 A) |sum k x|^2 a hinge of area A, the hinges of an even cylinder add up to B / (2 r^2) an
// area. But cloth finds shapes in which they hold half of that; with this factor a cantilever hangs as theory says for
// B, whatever the triangles' size (tests/test_fabric.py).
constexpr float kSoftening = 1.9f;

float Cotangent(float ux, float uy, float vx, float vy) {
  constexpr float kSteepest = 4;  // of a sliver: keeps its hinge from outweighing all others
  const float cross = std::abs(ux * vy - uy * vx), dot = ux * vx + uy * vy;
  return std::clamp(dot / std::max(cross, 1e-12f), -kSteepest, kSteepest);
}

}  // namespace

Mesh MakeMesh(int32_t vertices, int32_t faces, const int32_t* face, const float* pattern, const float* bend_scale,
              const float* crease, const Fabric& fabric) {
  Mesh mesh;
  mesh.area.assign(vertices, 0);
  std::vector<Side> sides;
  std::vector<float> face_area(faces);
  for (int32_t f = 0; f < faces; ++f) {
    const int32_t* v = face + 3 * f;
    const float* p = pattern + 6 * static_cast<size_t>(f);
    mesh.faces.push_back({v[0], v[1], v[2]});
    const float ux = p[2] - p[0], uy = p[3] - p[1], vx = p[4] - p[0], vy = p[5] - p[1];
    face_area[f] = 0.5f * std::abs(ux * vy - uy * vx);
    for (int k = 0; k < 3; ++k) {
      mesh.area[v[k]] += face_area[f] / 3;
      int32_t a = v[k], b = v[(k + 1) % 3];
      const float* pa = p + 2 * k;
      const float* pb = p + 2 * ((k + 1) % 3);
      const float* po = p + 2 * ((k + 2) % 3);
      const float dx = pb[0] - pa[0], dy = pb[1] - pa[1], squared = dx * dx + dy * dy;
      const float sine2 = 2 * dx * dy / std::max(squared, 1e-12f);  // of twice the angle to the threads
      float cot_a = Cotangent(dx, dy, po[0] - pa[0], po[1] - pa[1]);
      float cot_b = Cotangent(-dx, -dy, po[0] - pb[0], po[1] - pb[1]);
      if (a > b) std::swap(a, b), std::swap(cot_a, cot_b);
      sides.push_back({a, b, v[(k + 2) % 3], f, std::sqrt(squared), sine2 * sine2, cot_a, cot_b});
    }
  }
  std::sort(sides.begin(), sides.end(), [](const Side& p, const Side& q) {
    return p.a != q.a ? p.a < q.a : p.b != q.b ? p.b < q.b : p.opposite < q.opposite;
  });
  for (size_t i = 0; i < sides.size();) {
    const Side& s = sides[i];
    const bool inner = i + 1 < sides.size() && sides[i + 1].a == s.a && sides[i + 1].b == s.b;
    const Side& t = inner ? sides[i + 1] : s;
    const float area = inner ? face_area[s.face] + face_area[t.face] : face_area[s.face];
    const float rest = 0.5f * (s.length + t.length);  // sewn edges may differ a little: ease
    const float bias = 0.5f * (s.bias + t.bias);
    const float membrane = fabric.stretch + bias * (fabric.bias - fabric.stretch);
    mesh.edges.push_back({s.a, s.b, rest, membrane * area / std::max(rest * rest, 1e-12f)});
    if (inner && fabric.bend > 0) {
      Hinge h;
      h.v = {s.a, s.b, s.opposite, t.opposite};
      // Gradient of the two triangles' areas about their common edge, the edge's far ends weighted by the cotangents at
      // the near ones: affine motions of the plane give zero.
      h.k = {s.cot_b + t.cot_b, s.cot_a + t.cot_a, -(s.cot_a + s.cot_b), -(t.cot_a + t.cot_b)};
      const float stiffer = bend_scale ? 0.5f * (bend_scale[s.a] + bend_scale[s.b]) : 1.0f;
      h.compliance = area / (kSoftening * fabric.bend * stiffer);
      const float ca = crease ? crease[s.a] : 0, cb = crease ? crease[s.b] : 0;
      const float angle = ca * cb > 0 ? (std::abs(ca) < std::abs(cb) ? ca : cb) : 0;
      h.rest = 2 * rest * std::sin(0.5f * angle);
      mesh.hinges.push_back(h);
    }
    i += inner ? 2 : 1;
    while (i < sides.size() && sides[i].a == s.a && sides[i].b == s.b) ++i;  // a third face on an edge: not cloth
  }
  mesh.first.assign(vertices + 1, 0);
  for (const Edge& e : mesh.edges) ++mesh.first[e.a + 1], ++mesh.first[e.b + 1];
  for (int32_t i = 0; i < vertices; ++i) mesh.first[i + 1] += mesh.first[i];
  mesh.neighbours.resize(mesh.first[vertices]);
  std::vector<int32_t> next(mesh.first.begin(), mesh.first.end() - 1);
  for (const Edge& e : mesh.edges) mesh.neighbours[next[e.a]++] = e.b, mesh.neighbours[next[e.b]++] = e.a;
  return mesh;
}

void Normals(const Mesh& mesh, const std::vector<Point>& at, std::vector<Point>* out) {
  std::fill(out->begin(), out->end(), Point{});
  const auto add = [out](int32_t i, const Vec& n) {
    Point& to = (*out)[i];
    to.x += n.x, to.y += n.y, to.z += n.z;
  };
  for (const auto& [a, b, c] : mesh.faces) {
    const Vec from = ToVec(at[a]), n = Cross(ToVec(at[b]) - from, ToVec(at[c]) - from);
    add(a, n), add(b, n), add(c, n);
  }
  for (Point& n : *out) n = ToPoint(Unit(ToVec(n)));
}

std::vector<Tether> Tethers(const Mesh& mesh, int32_t vertices, const std::vector<int32_t>& pins) {
  std::vector<std::vector<std::pair<int32_t, float>>> next(vertices);
  for (const Edge& e : mesh.edges) next[e.a].push_back({e.b, e.rest}), next[e.b].push_back({e.a, e.rest});
  std::vector<Tether> out(vertices, {-1, std::numeric_limits<float>::max()});
  using Item = std::pair<float, int32_t>;
  std::priority_queue<Item, std::vector<Item>, std::greater<Item>> queue;
  for (int32_t pin : pins) out[pin] = {pin, 0}, queue.push({0, pin});
  while (!queue.empty()) {
    const auto [length, i] = queue.top();
    queue.pop();
    if (length > out[i].length) continue;
    for (const auto& [j, along] : next[i])
      if (length + along < out[j].length) out[j] = {out[i].pin, length + along}, queue.push({length + along, j});
  }
  return out;
}

}  // namespace cloth_solver

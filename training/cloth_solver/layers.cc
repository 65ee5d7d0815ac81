#include "layers.h"

#include <algorithm>
#include <cmath>

namespace cloth_solver {
namespace {

constexpr int kBits = 14;  // of the hash grid
constexpr float kReach = 1.25f;     // mean edges: layers that touch have vertices nearer than that
constexpr float kStale = 0.25f;     // of the reach that a vertex may move before it is searched for again
constexpr float kPrism = 0.2f;      // barycentric weight outside of the triangle up to which a pair keeps its side
constexpr float kFastest = 0.25f;   // thicknesses a step: a tangle comes undone slowly
constexpr float kBeyond = 0.05f;  // barycentric weight outside of the triangle that still counts as above it

// Half of a cell's 26 neighbours: the other half looks at this cell.
constexpr int32_t kHalf[13][3] = {{1, -1, -1}, {1, -1, 0}, {1, -1, 1}, {1, 0, -1}, {1, 0, 0}, {1, 0, 1}, {1, 1, -1},
                                  {1, 1, 0},   {1, 1, 1},  {0, 1, -1}, {0, 1, 0},  {0, 1, 1}, {0, 0, 1}};

uint32_t Cell(int32_t x, int32_t y, int32_t z) {
  return (static_cast<uint32_t>(x) * 73856093u ^ static_cast<uint32_t>(y) * 19349663u ^
          static_cast<uint32_t>(z) * 83492791u) & ((1u << kBits) - 1);
}

struct Above {
  Vec normal;
  float height, wa, wb, wc;
};

// Height of p over the triangle's plane, and its foot's barycentric weights. False for a sliver.
bool Over(const Vec& p, const Vec& a, const Vec& b, const Vec& c, Above* out) {
  const Vec u = b - a, v = c - a, n = Cross(u, v), d = p - a;
  const float squared = Dot(n, n);
  if (squared < 1e-16f) return false;
  const float inverse = 1 / squared;
  out->wb = Dot(Cross(d, v), n) * inverse;
  out->wc = Dot(Cross(u, d), n) * inverse;
  out->wa = 1 - out->wb - out->wc;
  const float scale = std::sqrt(inverse);
  out->normal = scale * n;
  out->height = Dot(d, out->normal);
  return true;
}

}  // namespace

Layers::Layers(const Mesh& mesh, int32_t vertices) : mesh_(mesh), ring_first_(1, 0), around_first_(vertices + 1, 0) {
  float total = 0;
  for (const Edge& e : mesh.edges) total += e.rest;
  reach_ = kReach * total / static_cast<float>(std::max<size_t>(mesh.edges.size(), 1));
  std::vector<int32_t> own;
  for (int32_t i = 0; i < vertices; ++i) {
    own.assign(1, i);
    for (int32_t k = mesh.first[i]; k < mesh.first[i + 1]; ++k) {
      const int32_t j = mesh.neighbours[k];
      own.push_back(j);
      own.insert(own.end(), mesh.neighbours.begin() + mesh.first[j], mesh.neighbours.begin() + mesh.first[j + 1]);
    }
    std::sort(own.begin(), own.end());
    own.erase(std::unique(own.begin(), own.end()), own.end());
    ring_.insert(ring_.end(), own.begin(), own.end());
    ring_first_.push_back(static_cast<int32_t>(ring_.size()));
  }
  for (const auto& f : mesh.faces)
    for (int32_t v : f) ++around_first_[v + 1];
  for (int32_t i = 0; i < vertices; ++i) around_first_[i + 1] += around_first_[i];
  around_.resize(around_first_[vertices]);
  std::vector<int32_t> next(around_first_.begin(), around_first_.end() - 1);
  for (size_t f = 0; f < mesh.faces.size(); ++f)
    for (int32_t v : mesh.faces[f]) around_[next[v]++] = static_cast<int32_t>(f);
  cell_.resize(vertices), order_.resize(vertices);
}

bool Layers::Adjacent(int32_t a, int32_t b) const {
  const auto first = mesh_.neighbours.begin();
  return a == b || std::find(first + mesh_.first[a], first + mesh_.first[a + 1], b) != first + mesh_.first[a + 1];
}

bool Layers::Close(int32_t a, int32_t b) const {
  return std::binary_search(ring_.begin() + ring_first_[a], ring_.begin() + ring_first_[a + 1], b);
}

bool Layers::Due(const std::vector<Vec>& x) const {
  if (last_.empty()) return true;
  Vec mean{};
  for (size_t i = 0; i < x.size(); ++i) mean += x[i] - last_[i];
  mean = (1 / static_cast<float>(x.size())) * mean;
  const float most = kStale * reach_;
  return std::any_of(x.begin(), x.end(), [&, i = size_t{0}](const Vec& at) mutable {
    const Vec moved = at - last_[i++] - mean;
    return Dot(moved, moved) > most * most;
  });
}

void Layers::Find(const std::vector<Vec>& x) {
  if (last_.empty()) last_ = x;
  before_.swap(pairs_);
  pairs_.clear();
  const int32_t count = static_cast<int32_t>(x.size());
  const float per_cell = 1 / reach_;
  const auto number = [per_cell](float v) {
    return static_cast<int32_t>(std::floor(std::clamp(v, -1e3f, 1e3f) * per_cell));
  };
  cell_first_.assign((size_t{1} << kBits) + 1, 0);
  for (int32_t i = 0; i < count; ++i) {
    cell_[i] = static_cast<int32_t>(Cell(number(x[i].x), number(x[i].y), number(x[i].z)));
    ++cell_first_[cell_[i] + 1];
  }
  for (size_t c = 0; c < size_t{1} << kBits; ++c) cell_first_[c + 1] += cell_first_[c];
  std::vector<int32_t> next(cell_first_.begin(), cell_first_.end() - 1);
  for (int32_t i = 0; i < count; ++i) order_[next[cell_[i]]++] = i;

  // Pairs of vertices that are near, each found once, both ways round.
  sorted_.resize(count);
  for (int32_t k = 0; k < count; ++k) sorted_[k] = x[order_[k]];
  near_.clear();
  const float reach_squared = reach_ * reach_;
  for (int32_t k = 0; k < count; ++k) {
    const Vec p = sorted_[k];
    const int32_t i = order_[k], cx = number(p.x), cy = number(p.y), cz = number(p.z);
    const auto look = [&](int32_t first, int32_t last) {
      for (int32_t m = first; m < last; ++m) {
        const Vec d = sorted_[m] - p;
        if (Dot(d, d) > reach_squared) continue;
        const int32_t j = order_[m];
        if (j != i && !Close(i, j)) near_.push_back({i, j}), near_.push_back({j, i});
      }
    };
    look(k + 1, cell_first_[cell_[i] + 1]);
    for (const auto& [x_on, y_on, z_on] : kHalf) {
      const uint32_t cell = Cell(cx + x_on, cy + y_on, cz + z_on);
      look(cell_first_[cell], cell_first_[cell + 1]);
    }
  }
  std::sort(near_.begin(), near_.end());

  std::vector<int32_t> faces;
  size_t known = 0, near = 0;
  for (int32_t i = 0; i < count; ++i) {
    faces.clear();
    for (; near < near_.size() && near_[near].first == i; ++near) {
      const int32_t j = near_[near].second;
      faces.insert(faces.end(), around_.begin() + around_first_[j], around_.begin() + around_first_[j + 1]);
    }
    while (known < before_.size() && before_[known].vertex < i) ++known;
    if (faces.empty()) continue;
    std::sort(faces.begin(), faces.end());
    faces.erase(std::unique(faces.begin(), faces.end()), faces.end());
    size_t at = known;
    for (int32_t f : faces) {
      const auto& [a, b, c] = mesh_.faces[f];
      if (Adjacent(i, a) || Adjacent(i, b) || Adjacent(i, c)) continue;
      while (at < before_.size() && before_[at].vertex == i && before_[at].face < f) ++at;
      const bool known_pair = at < before_.size() && before_[at].vertex == i && before_[at].face == f;
      // Its side is the one it came from, as it may have passed through since the last search. A vertex that has left
      // the triangle's prism may have gone round the cloth's border: its side is looked at anew.
      Above over;
      if (!Over(last_[i], last_[a], last_[b], last_[c], &over)) continue;
      const bool above = std::min({over.wa, over.wb, over.wc}) > -kPrism;
      pairs_.push_back({i, f, known_pair && above ? before_[at].side : over.height >= 0 ? 1.0f : -1.0f});
    }
  }
  last_ = x;
}

void Layers::Hold(std::vector<Vec>* at, std::vector<Vec>* velocity, const std::vector<float>& inverse_mass,
                  float thickness) const {
  std::vector<Vec>&x = *at, &v = *velocity;
  for (const Pair& pair : pairs_) {
    const auto& [a, b, c] = mesh_.faces[pair.face];
    Above over;
    if (!Over(x[pair.vertex], x[a], x[b], x[c], &over)) continue;
    if (over.wa < -kBeyond || over.wb < -kBeyond || over.wc < -kBeyond) continue;
    const float deep = thickness - pair.side * over.height;
    if (deep <= 0) continue;
    const float w = inverse_mass[pair.vertex], wa = inverse_mass[a], wb = inverse_mass[b], wc = inverse_mass[c];
    const float total = w + over.wa * over.wa * wa + over.wb * over.wb * wb + over.wc * over.wc * wc;
    if (total <= 0) continue;
    const auto apart = [&](std::vector<Vec>& of, float amount) {
      const Vec push = (pair.side * amount / total) * over.normal;
      of[pair.vertex] += w * push;
      of[a] -= (wa * over.wa) * push, of[b] -= (wb * over.wb) * push, of[c] -= (wc * over.wc) * push;
    };
    apart(x, std::min(deep, kFastest * thickness));
    const Vec relative = v[pair.vertex] - over.wa * v[a] - over.wb * v[b] - over.wc * v[c];
    const float approach = -pair.side * Dot(relative, over.normal);
    if (approach > 0) apart(v, approach);
  }
}

}  // namespace cloth_solver

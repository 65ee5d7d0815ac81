#include "layers.h"

#include <algorithm>
#include <cmath>

namespace cloth_solver {
namespace {

constexpr float kReach = 1.25f;     // mean edges: layers that touch have vertices nearer than that
constexpr float kStale = 0.25f;     // of the reach that a vertex may move before it is searched for again
constexpr float kPrism = 0.2f;      // barycentric weight outside of the triangle up to which a pair keeps its side
constexpr float kFastest = 0.25f;   // thicknesses a step: a tangle comes undone slowly
constexpr float kBeyond = 0.05f;  // barycentric weight outside of the triangle that still counts as above it

// Half of a row's 8 neighbours: the other half looks at this row.
constexpr int32_t kHalf[4][2] = {{1, -1}, {1, 0}, {1, 1}, {0, 1}};

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

Layers::Layers(const Mesh& mesh, int32_t vertices)
    : mesh_(mesh), count_(vertices), ring_first_(1, 0), around_first_(vertices + 1, 0), place_(vertices),
      cell_first_(kCells + 1), order_(vertices), next_(kCells), sorted_x_(vertices + kLanes),
      sorted_y_(vertices + kLanes), sorted_z_(vertices + kLanes) {
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
    own.resize((own.size() + kLanes - 1) / kLanes * kLanes, -1);
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
}

bool Layers::Adjacent(int32_t a, int32_t b) const {
  const auto first = mesh_.neighbours.begin();
  return a == b || std::find(first + mesh_.first[a], first + mesh_.first[a + 1], b) != first + mesh_.first[a + 1];
}

bool Layers::Due(const std::vector<Point>& x) const {
  if (last_.empty()) return true;
  Vecs sum{};
  for (int32_t i = 0; i < count_; i += kLanes) sum = sum + (Load(&x[i]) - Load(&last_[i]));
  Vec mean{};
  for (int k = 0; k < kLanes; ++k) mean += Vec{sum.x[k], sum.y[k], sum.z[k]};
  mean = (1 / static_cast<float>(count_)) * mean;
  const float most = kStale * reach_;
  for (int32_t i = 0; i < count_; i += kLanes) {
    const Vecs moved = Load(&x[i]) - Load(&last_[i]) - mean;
    const uint32_t own = count_ - i < kLanes ? (1u << (count_ - i)) - 1 : (1u << kLanes) - 1;
    if (Bits(Dot(moved, moved) > most * most) & own) return true;
  }
  return false;
}

// Pairs of vertices that are near, each found once, both ways round.
void Layers::FindNear(const std::vector<Point>& x) {
  const float per_cell = 1 / reach_;
  std::fill(cell_first_.begin(), cell_first_.end(), 0);
  for (int32_t i = 0; i < count_; ++i) {
    const auto number = [per_cell](float v) {
      return static_cast<uint32_t>(static_cast<int32_t>(std::floor(std::clamp(v, -1e3f, 1e3f) * per_cell)));
    };
    place_[i] = {number(x[i].x), kAlongY * number(x[i].y), kAlongZ * number(x[i].z), 0};
    ++cell_first_[place_[i].Cell(0, 0, 0) + 1];
  }
  for (uint32_t c = 0; c < kCells; ++c) cell_first_[c + 1] += cell_first_[c];
  std::copy(cell_first_.begin(), cell_first_.end() - 1, next_.begin());
  for (int32_t i = 0; i < count_; ++i) {
    const int32_t k = next_[place_[i].Cell(0, 0, 0)]++;
    place_[i].sorted = k, order_[k] = i;
    sorted_x_[k] = x[i].x, sorted_y_[k] = x[i].y, sorted_z_[k] = x[i].z;
  }
  near_.clear();
  const float reach_squared = reach_ * reach_;
  const float *const sorted_x = sorted_x_.data(), *const sorted_y = sorted_y_.data();
  const float* const sorted_z = sorted_z_.data();
  const int32_t *const order = order_.data(), *const cell_first = cell_first_.data();
  for (int32_t i = 0; i < count_; ++i) {
    const float px = x[i].x, py = x[i].y, pz = x[i].z;
    const int32_t *ring = ring_.data() + ring_first_[i], *ring_end = ring_.data() + ring_first_[i + 1];
    const auto look = [&](int32_t first, int32_t last) {
      for (int32_t m = first; m < last; m += kLanes) {
        const Floats dx = LoadFloats(sorted_x + m) - px, dy = LoadFloats(sorted_y + m) - py,
                     dz = LoadFloats(sorted_z + m) - pz;
        uint32_t bits = Bits(dx * dx + dy * dy + dz * dz <= reach_squared);
        if (last - m < kLanes) bits &= (1u << (last - m)) - 1;
        ForEachBit(bits, [&](int lane) {
          const int32_t j = order[m + lane];
          for (const int32_t* r = ring; r < ring_end; r += kLanes) {
            Ints some;
            std::memcpy(&some, r, sizeof(some));
            if (Bits(some == j)) return;
          }
          near_.push_back(static_cast<uint64_t>(i) << 32 | static_cast<uint32_t>(j));
          near_.push_back(static_cast<uint64_t>(j) << 32 | static_cast<uint32_t>(i));
        });
      }
    };
    const auto look_in = [&](uint32_t first_cell, uint32_t cells) {
      if (first_cell + cells <= kCells) return look(cell_first[first_cell], cell_first[first_cell + cells]);
      look(cell_first[first_cell], cell_first[kCells]);  // the rest is where the table begins
      look(cell_first[0], cell_first[first_cell + cells - kCells]);
    };
    const Place& place = place_[i];
    const uint32_t own = place.Cell(0, 0, 0);
    look(place.sorted + 1, cell_first[std::min(own + 2, kCells)]);
    if (own + 1 == kCells) look_in(0, 1);
    for (const auto& [y, z] : kHalf) look_in(place.Cell(-1, y, z), 3);
  }
  std::sort(near_.begin(), near_.end());
}

void Layers::Find(const std::vector<Point>& x) {
  if (last_.empty()) last_ = x;
  FindNear(x);
  FindPairs();
  std::copy(x.begin(), x.end(), last_.begin());
}

void Layers::FindPairs() {
  before_.swap(pairs_);
  pairs_.clear();
  size_t known = 0;
  for (size_t near = 0; near < near_.size();) {
    const int32_t i = static_cast<int32_t>(near_[near] >> 32);
    faces_.clear();
    for (; near < near_.size() && static_cast<int32_t>(near_[near] >> 32) == i; ++near) {
      const uint32_t j = static_cast<uint32_t>(near_[near]);
      faces_.insert(faces_.end(), around_.begin() + around_first_[j], around_.begin() + around_first_[j + 1]);
    }
    while (known < before_.size() && before_[known].vertex < i) ++known;
    std::sort(faces_.begin(), faces_.end());
    faces_.erase(std::unique(faces_.begin(), faces_.end()), faces_.end());
    size_t at = known;
    for (int32_t f : faces_) {
      const auto& [a, b, c] = mesh_.faces[f];
      if (Adjacent(i, a) || Adjacent(i, b) || Adjacent(i, c)) continue;
      while (at < before_.size() && before_[at].vertex == i && before_[at].face < f) ++at;
      const bool known_pair = at < before_.size() && before_[at].vertex == i && before_[at].face == f;
      // Its side is the one it came from, as it may have passed through since the last search. A vertex that has left
      // the triangle's prism may have gone round the cloth's border: its side is looked at anew.
      Above over;
      if (!Over(ToVec(last_[i]), ToVec(last_[a]), ToVec(last_[b]), ToVec(last_[c]), &over)) continue;
      const bool above = std::min({over.wa, over.wb, over.wc}) > -kPrism;
      pairs_.push_back({i, f, known_pair && above ? before_[at].side : over.height >= 0 ? 1.0f : -1.0f});
    }
  }
  blocks_.assign((pairs_.size() + kLanes - 1) / kLanes, PairBlock{});
  for (size_t k = 0; k < pairs_.size(); ++k) {
    PairBlock& block = blocks_[k / kLanes];
    const size_t lane = k % kLanes;
    const auto& [a, b, c] = mesh_.faces[pairs_[k].face];
    block.vertex[lane] = pairs_[k].vertex, block.a[lane] = a, block.b[lane] = b, block.c[lane] = c;
    block.side[lane] = pairs_[k].side;
  }
}

void Layers::HoldPair(const PairBlock& pairs, int k, std::vector<Point>* at, std::vector<Point>* velocity,
                      const std::vector<float>& inverse_mass, float thickness) const {
  std::vector<Point>&x = *at, &v = *velocity;
  const int32_t i = pairs.vertex[k], a = pairs.a[k], b = pairs.b[k], c = pairs.c[k];
  const float side = pairs.side[k];
  Above over;
  if (!Over(ToVec(x[i]), ToVec(x[a]), ToVec(x[b]), ToVec(x[c]), &over)) return;
  if (over.wa < -kBeyond || over.wb < -kBeyond || over.wc < -kBeyond) return;
  const float deep = thickness - side * over.height;
  if (deep <= 0) return;
  const float w = inverse_mass[i], wa = inverse_mass[a], wb = inverse_mass[b], wc = inverse_mass[c];
  const float total = w + over.wa * over.wa * wa + over.wb * over.wb * wb + over.wc * over.wc * wc;
  if (total <= 0) return;
  const auto apart = [&](std::vector<Point>& of, float amount) {
    const Vec push = (side * amount / total) * over.normal;
    of[i] = ToPoint(ToVec(of[i]) + w * push);
    of[a] = ToPoint(ToVec(of[a]) - (wa * over.wa) * push);
    of[b] = ToPoint(ToVec(of[b]) - (wb * over.wb) * push);
    of[c] = ToPoint(ToVec(of[c]) - (wc * over.wc) * push);
  };
  apart(x, std::min(deep, kFastest * thickness));
  const Vec relative = ToVec(v[i]) - over.wa * ToVec(v[a]) - over.wb * ToVec(v[b]) - over.wc * ToVec(v[c]);
  const float approach = -side * Dot(relative, over.normal);
  if (approach > 0) apart(v, approach);
}

// Heights are looked at side by side; few of them are low enough for more.
void Layers::Hold(std::vector<Point>* x, std::vector<Point>* v, const std::vector<float>& inverse_mass,
                  float thickness) const {
  for (const PairBlock& pairs : blocks_) {
    const Vecs a = Gather(*x, pairs.a), d = Gather(*x, pairs.vertex) - a;
    const Vecs normal = Cross(Gather(*x, pairs.b) - a, Gather(*x, pairs.c) - a);
    const Floats squared = Dot(normal, normal), height = pairs.side * Dot(d, normal);
    ForEachBit(Bits((height < 0.0f) | (height * height < thickness * thickness * squared)),
               [&](int k) { HoldPair(pairs, k, x, v, inverse_mass, thickness); });
  }
}

}  // namespace cloth_solver

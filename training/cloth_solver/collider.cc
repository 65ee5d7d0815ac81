#include "collider.h"

#include <algorithm>
#include <limits>

namespace cloth_solver {
namespace {

constexpr float kReach = 0.10f;  // m, beyond what body and cloth travel in a frame

constexpr float kDeepest = 0.04f;  // m: in one small step cloth sinks by millimetres

struct Points {
  std::vector<float> x, y, z;
};

float Squared(const Points& points, int32_t i, const Vec& at) {
  const float x = points.x[i] - at.x, y = points.y[i] - at.y, z = points.z[i] - at.z;
  return x * x + y * y + z * z;
}

// The point nearest to `at`, and its squared distance.
int32_t Nearest(const Points& points, const Vec& at, float* squared) {
  constexpr int32_t kLanes = 16, kBlock = 8 * kLanes;
  const int32_t count = static_cast<int32_t>(points.x.size());
  float best = std::numeric_limits<float>::max();
  int32_t block = 0;
  for (int32_t i = 0; i < count; i += kBlock) {
    float least[kLanes];
    std::fill_n(least, kLanes, std::numeric_limits<float>::max());
    const int32_t end = std::min(i + kBlock, count);
    int32_t k = i;
    for (; k + kLanes <= end; k += kLanes)
      for (int32_t lane = 0; lane < kLanes; ++lane) {
        const float d = Squared(points, k + lane, at);
        least[lane] = d < least[lane] ? d : least[lane];
      }
    for (; k < end; ++k) least[0] = std::min(least[0], Squared(points, k, at));
    const float lowest = *std::min_element(least, least + kLanes);
    if (lowest < best) best = lowest, block = i;
  }
  *squared = best;
  int32_t found = block;
  float least = std::numeric_limits<float>::max();
  for (int32_t i = block; i < std::min(block + kBlock, count); ++i)
    if (const float d = Squared(points, i, at); d < least) least = d, found = i;
  return found;
}

}  // namespace

Collider::Collider(Mesh mesh, std::vector<uint32_t> part, int32_t parts, std::vector<uint32_t> touches,
                   int32_t cloth_vertices)
    : mesh_(std::move(mesh)), part_(std::move(part)), touches_(std::move(touches)), parts_(parts), members_(parts),
      candidates_(parts), nearest_(parts, std::vector<int32_t>(cloth_vertices, 0)) {
  for (int32_t p = 0; p < parts; ++p)
    for (int32_t b = 0; b < static_cast<int32_t>(part_.size()); ++b)
      if (part_[b] >> p & 1) members_[p].push_back(b);
  rim_.assign(part_.size(), 0);
  for (const Pair& e : mesh_.edges) rim_[e.a] |= part_[e.a] & ~part_[e.b], rim_[e.b] |= part_[e.b] & ~part_[e.a];
}

void Collider::BeginFrame(std::vector<Vec> from, std::vector<Vec> to, float seconds, const std::vector<Vec>& cloth,
                          float cloth_travel) {
  from_ = std::move(from), to_ = std::move(to);
  per_second_ = 1 / seconds;
  Normals(mesh_, from_, from_normal_);
  Normals(mesh_, to_, to_normal_);
  if (spacing_ == 0)
    for (const Pair& e : mesh_.edges) spacing_ = std::max(spacing_, Length(from_[e.a] - from_[e.b]));
  at_ = from_, normal_ = from_normal_;

  Points points;
  for (int32_t p = 0; p < parts_; ++p) {
    const auto& members = members_[p];
    points.x.resize(members.size()), points.y.resize(members.size()), points.z.resize(members.size());
    float travel = 0;
    Vec low{1e9f, 1e9f, 1e9f}, high{-1e9f, -1e9f, -1e9f};
    for (size_t k = 0; k < members.size(); ++k) {
      const Vec& v = from_[members[k]];
      points.x[k] = v.x, points.y[k] = v.y, points.z[k] = v.z;
      travel = std::max(travel, Length(to_[members[k]] - v));
      low = {std::min(low.x, v.x), std::min(low.y, v.y), std::min(low.z, v.z)};
      high = {std::max(high.x, v.x), std::max(high.y, v.y), std::max(high.z, v.z)};
    }
    const float reach = kReach + travel + cloth_travel;
    candidates_[p].clear();
    for (int32_t i = 0; i < static_cast<int32_t>(cloth.size()); ++i) {
      if (!touches_.empty() && !(touches_[i] >> p & 1)) continue;
      const Vec& c = cloth[i];
      if (c.x < low.x - reach || c.y < low.y - reach || c.z < low.z - reach || c.x > high.x + reach ||
          c.y > high.y + reach || c.z > high.z + reach)
        continue;
      float squared;
      const int32_t k = Nearest(points, c, &squared);
      if (squared > reach * reach) continue;
      nearest_[p][i] = members[k];
      candidates_[p].push_back(i);
    }
  }
}

void Collider::MoveTo(float t) {
  for (size_t b = 0; b < at_.size(); ++b) {
    at_[b] = Mix(from_[b], to_[b], t);
    normal_[b] = Mix(from_normal_[b], to_normal_[b], t);
  }
}

Contact Collider::Touch(int32_t p, int32_t cloth_vertex, const Vec& at) {
  int32_t& near = nearest_[p][cloth_vertex];
  // Follow the nearest vertex: nothing travels further than an edge in one small step.
  float least = Dot(at - at_[near], at - at_[near]);
  const int32_t start = near;
  for (int32_t k = mesh_.first[start]; k < mesh_.first[start + 1]; ++k) {
    const int32_t j = mesh_.neighbours[k];
    const float d = Dot(at - at_[j], at - at_[j]);
    if (d < least && (part_[j] >> p & 1)) least = d, near = j;
  }
  Contact contact;
  const float plane = Dot(at - at_[near], normal_[near]);
  // A part is open where it was cut off: seen through that mouth its far side lies behind the vertex, but not near it.
  if (plane > spacing_ || plane < -kDeepest || least - plane * plane > spacing_ * spacing_) return contact;
  if (rim_[near] >> p & 1) return contact;  // beside the part, not above it
  // Tangent planes of the neighbourhood, weighted so that the sum is smooth where the nearest vertex changes (an implicit
  // moving least squares surface).
  const float scale = 2 / (spacing_ * spacing_);
  float total = 1, distance = plane;
  Vec normal = normal_[near], velocity = to_[near] - from_[near];
  for (int32_t k = mesh_.first[near]; k < mesh_.first[near + 1]; ++k) {
    const int32_t j = mesh_.neighbours[k];
    const Vec offset = at - at_[j];
    float weight = 1 / (1 + std::max(0.0f, Dot(offset, offset) - least) * scale);
    weight *= weight * weight;
    total += weight;
    distance += weight * Dot(offset, normal_[j]);
    normal += weight * normal_[j];
    velocity += weight * (to_[j] - from_[j]);
  }
  contact.near = true;
  contact.distance = distance / total;
  contact.normal = Unit(normal);
  contact.velocity = (per_second_ / total) * velocity;
  return contact;
}

}  // namespace cloth_solver

#include "engine/src/contact/skin_search.h"

#include <cmath>

namespace dcloth::engine {
namespace {

constexpr float kTouching = 1e-5f;  // metres: nearer, the way to the surface is no direction
constexpr float kSidelong = 0.3f;   // cosine: beside an edge the normals there tell more than the way to it

// Shares of the corners in the point of a triangle that is closest to p, by the Voronoi region that p lies in (Ericson,
// Real-Time Collision Detection, 5.1.5).
Vecf SharesOfClosest(Vecf p, Vecf a, Vecf b, Vecf c) {
  const Vecf ab = b - a, ac = c - a;
  const float d1 = Dot(ab, p - a), d2 = Dot(ac, p - a);
  if (d1 <= 0 && d2 <= 0) return {1, 0, 0};
  const float d3 = Dot(ab, p - b), d4 = Dot(ac, p - b);
  if (d3 >= 0 && d4 <= d3) return {0, 1, 0};
  const float vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return {1 - d1 / (d1 - d3), d1 / (d1 - d3), 0};
  const float d5 = Dot(ab, p - c), d6 = Dot(ac, p - c);
  if (d6 >= 0 && d5 <= d6) return {0, 0, 1};
  const float vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return {1 - d2 / (d2 - d6), 0, d2 / (d2 - d6)};
  const float va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
    const float share = (d4 - d3) / ((d4 - d3) + (d5 - d6));
    return {0, 1 - share, share};
  }
  const float part = 1 / (va + vb + vc);
  return {1 - vb * part - vc * part, vb * part, vc * part};
}

bool Has(const uint16_t* face, uint16_t vertex) { return face[0] == vertex || face[1] == vertex || face[2] == vertex; }

class Search {
 public:
  Search(const PosedSkin& skin, Vecf point) : skin_(skin), body_(*skin.body), point_(point) {}

  // The vertex that no neighbour is nearer than, or the last of the walk.
  uint16_t WalkFrom(uint16_t vertex) {
    Vecf apart = point_ - At(vertex);
    float least = Dot(apart, apart);
    for (int step = 0; step < kMostSteps; ++step) {
      const uint16_t from = vertex;
      faces_seen_ += body_.row_starts[from + 1] - body_.row_starts[from];
      for (uint32_t i = body_.row_starts[from]; i < body_.row_starts[from + 1]; ++i) {
        const uint16_t* face = body_.faces + size_t{3} * body_.columns[i];
        for (int c = 0; c < 3; ++c) {
          apart = point_ - At(face[c]);
          const float squared = Dot(apart, apart);
          if (squared < least) least = squared, vertex = face[c];
        }
      }
      if (vertex == from) break;
    }
    return vertex;
  }

  void LookAround(uint16_t vertex) {
    faces_seen_ += body_.row_starts[vertex + 1] - body_.row_starts[vertex];
    for (uint32_t i = body_.row_starts[vertex]; i < body_.row_starts[vertex + 1]; ++i) LookAt(body_.columns[i]);
  }

  ClosestSkin Result() const {
    ClosestSkin closest = {};
    closest.faces_seen = faces_seen_;
    if (!found_) return closest;
    const uint16_t* face = body_.faces + size_t{3} * face_;
    const Vecf normal = shares_.x * NormalAt(face[0]) + shares_.y * NormalAt(face[1]) + shares_.z * NormalAt(face[2]);
    const float length = std::sqrt(Dot(normal, normal)), distance = std::sqrt(squared_);
    const Vecf outward = length > 0 ? (1 / length) * normal : Vecf{0, 1, 0};
    const float over = Dot(outward, away_);
    closest.outward = outward;
    closest.height = over;
    if (distance > kTouching && std::fabs(over) > kSidelong * distance) {
      closest.outward = ((over < 0 ? -1 : 1) / distance) * away_;
      closest.height = over < 0 ? -distance : distance;
    }
    closest.vertex = face[0];
    closest.found = true;
    closest.on_rim = IsOnRim(face);
    return closest;
  }

 private:
  Vecf At(uint16_t vertex) const { return VecfAt(skin_.positions + size_t{3} * vertex); }
  Vecf NormalAt(uint16_t vertex) const { return VecfAt(skin_.normals + size_t{3} * vertex); }

  bool Counts(const uint16_t* face) const {
    if (skin_.touch_bit == 0) return true;
    const uint8_t* touched = body_.touched_by;
    return (touched[face[0]] & touched[face[1]] & touched[face[2]] & skin_.touch_bit) != 0;
  }

  void LookAt(uint16_t face) {
    const uint16_t* corners = body_.faces + size_t{3} * face;
    if (!Counts(corners)) return;
    const Vecf a = At(corners[0]), b = At(corners[1]), c = At(corners[2]);
    const Vecf shares = SharesOfClosest(point_, a, b, c);
    const Vecf away = point_ - (shares.x * a + shares.y * b + shares.z * c);
    const float squared = Dot(away, away);
    if (!(squared < squared_)) return;
    squared_ = squared;
    shares_ = shares;
    away_ = away;
    face_ = face;
    found_ = true;
  }

  // Whether one face alone counts at the edge.
  bool IsEdgeOfRim(uint16_t vertex, uint16_t other) const {
    int count = 0;
    for (uint32_t i = body_.row_starts[vertex]; i < body_.row_starts[vertex + 1]; ++i) {
      const uint16_t* face = body_.faces + size_t{3} * body_.columns[i];
      count += Has(face, other) && Counts(face) ? 1 : 0;
    }
    return count < 2;
  }

  bool IsCornerOfRim(uint16_t vertex) const {
    for (uint32_t i = body_.row_starts[vertex]; i < body_.row_starts[vertex + 1]; ++i) {
      const uint16_t* face = body_.faces + size_t{3} * body_.columns[i];
      if (!Counts(face)) continue;
      for (int c = 0; c < 3; ++c) {
        if (face[c] != vertex && IsEdgeOfRim(vertex, face[c])) return true;
      }
    }
    return false;
  }

  bool IsOnRim(const uint16_t* face) const {
    const float shares[3] = {shares_.x, shares_.y, shares_.z};
    if (skin_.touch_bit == 0) return false;
    for (int c = 0; c < 3; ++c) {
      if (shares[c] == 1) return IsCornerOfRim(face[c]);
    }
    for (int c = 0; c < 3; ++c) {
      if (shares[c] == 0) return IsEdgeOfRim(face[(c + 1) % 3], face[(c + 2) % 3]);
    }
    return false;
  }

  const PosedSkin& skin_;
  const format::BodyView& body_;
  Vecf point_, shares_ = {}, away_ = {};
  float squared_ = 3e38f;
  uint32_t faces_seen_ = 0;
  uint16_t face_ = 0;
  bool found_ = false;
};

}  // namespace

ClosestSkin FindClosestSkin(const PosedSkin& skin, uint16_t first, uint16_t second, Vecf point) {
  Search search(skin, point);
  const uint16_t end = search.WalkFrom(first), other = second != first ? search.WalkFrom(second) : end;
  search.LookAround(end);
  if (other != end) search.LookAround(other);
  return search.Result();
}

}  // namespace dcloth::engine

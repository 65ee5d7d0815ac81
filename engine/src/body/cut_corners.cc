#include "engine/src/body/cut_corners.h"

namespace dcloth::engine {
namespace {

// The arc over a chord is a quarter of its length times the sine of half the angle high. Skin that may rise so many
// clearances over an edge is looked for; where one end alone is near the skin, the angle is not known, and the edge has
// to be so many clearances long.
constexpr double kArc = 0.5, kLong = 6;
constexpr double kShown = 0.5;  // of the clearance: skin so near to the middle shows
// In clearances; where the skin lies higher, a limb went between the ends. Cloth between the skin of two limbs that
// face each other, by the cosine of their angle, is lifted by hardly more than the clearance: the other is in the way.
constexpr double kMostLift = 5, kMostBetween = 1.25;
constexpr double kFacing = -0.2;

struct Cover {
  const format::ModelView& model;
  const float* normals;
  const uint16_t* beside;
  double clearance;
  const Surface& surface;

  // Of the angle between the skin beside two vertices that are near it.
  double Cosine(uint16_t a, uint16_t b) const {
    const float *n = normals + size_t{3} * beside[a], *m = normals + size_t{3} * beside[b];
    double cosine = 0;
    for (size_t c = 0; c < 3; ++c) cosine += static_cast<double>(n[c]) * static_cast<double>(m[c]);
    return cosine;
  }

  bool MayBeCut(uint16_t a, uint16_t b) const {
    if (beside[a] == kNotNear && beside[b] == kNotNear) return false;
    const float *p = surface.PositionOf(a), *q = surface.PositionOf(b);
    double squared = 0;
    for (size_t c = 0; c < 3; ++c) {
      const double along = static_cast<double>(q[c]) - static_cast<double>(p[c]);
      squared += along * along;
    }
    if (beside[a] == kNotNear || beside[b] == kNotNear) return squared > kLong * kLong * clearance * clearance;
    const double arc = 4 * kArc * clearance;
    return squared * 0.5 * (1 - Cosine(a, b)) > arc * arc;
  }

  uint16_t JointOf(size_t body_vertex) const {
    const format::BodyView& body = model.body;
    const size_t first = body_vertex * body.influences;
    size_t most = first;
    for (size_t i = first; i < first + body.influences; ++i) most = body.weights[i] > body.weights[most] ? i : most;
    return body.joints[most];
  }

  // Both sides of a foot face away from each other, too, and the cloth over its edge is to be lifted.
  bool AreOfOneLimb(size_t body_vertex, size_t other) const {
    if (model.parents == nullptr) return true;
    const uint16_t joint = JointOf(body_vertex), other_joint = JointOf(other);
    return joint == other_joint || model.parents[joint] == other_joint || model.parents[other_joint] == joint;
  }

  bool LiesBetweenLimbs(const uint16_t* vertices, size_t count) const {
    for (size_t i = 0; i < count; ++i) {
      const uint16_t a = vertices[i], b = vertices[(i + 1) % count];
      if (beside[a] == kNotNear || beside[b] == kNotNear || Cosine(a, b) >= kFacing) continue;
      if (!AreOfOneLimb(beside[a], beside[b])) return true;
    }
    return false;
  }

  // An edge or a triangle, `count` vertices of which one at least is near the skin.
  void Lift(PosedBody posed, const uint16_t* vertices, size_t count, uint32_t* faces) const {
    double middle[3] = {};
    uint16_t first = kNotNear, last = kNotNear, toucher = vertices[0];
    for (size_t i = 0; i < count; ++i) {
      const float* p = surface.PositionOf(vertices[i]);
      for (size_t c = 0; c < 3; ++c) middle[c] += static_cast<double>(p[c]) / static_cast<double>(count);
      if (beside[vertices[i]] == kNotNear) continue;
      last = beside[vertices[i]];
      if (first != kNotNear) continue;
      first = last;
      toucher = vertices[i];
    }
    const uint8_t* classes = model.body.touch_classes;
    posed.touch_bit = static_cast<uint8_t>(classes == nullptr ? 0u : 1u << classes[toucher]);
    const ClosestPoint closest = SearchBody(posed, first, last, middle);
    *faces -= closest.faces_seen < *faces ? closest.faces_seen : *faces;
    if (!closest.found || closest.distance >= kShown * clearance || EndsAt(posed, closest)) return;
    const double lift = clearance - closest.distance;
    if (lift > (LiesBetweenLimbs(vertices, count) ? kMostBetween : kMostLift) * clearance) return;
    for (size_t i = 0; i < count; ++i) {
      if (beside[vertices[i]] == kNotNear) continue;  // nothing is known of it
      float* p = surface.PositionOf(vertices[i]);
      for (size_t c = 0; c < 3; ++c) p[c] = static_cast<float>(static_cast<double>(p[c]) + lift * closest.direction[c]);
    }
  }
};

}  // namespace

void CoverCorners(const format::ModelView& model, PosedBody posed, const float* normals, const uint16_t* beside,
                  double clearance, const Surface& surface, uint32_t* faces) {
  const Cover cover = {model, normals, beside, clearance, surface};
  for (size_t t = 0; t < model.triangle_count; ++t) {
    const uint16_t* face = model.faces + 3 * t;
    bool cut = false;
    for (size_t k = 0; k < 3; ++k) {
      const uint16_t ends[2] = {face[k], face[(k + 1) % 3]};
      if (!cover.MayBeCut(ends[0], ends[1])) continue;
      if (*faces == 0) return;
      cut = true;
      // The triangle beyond the edge has its ends the other way round.
      if (ends[0] < ends[1]) cover.Lift(posed, ends, 2, faces);
    }
    if (cut && *faces != 0) cover.Lift(posed, face, 3, faces);
  }
}

}  // namespace dcloth::engine

#include "engine/src/body/cut_corners.h"

#include "engine/src/body/limb_cores.h"

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
// Joints from the one to the other. Around cloth between limbs that are further apart than a thigh and the belly none
// is lifted by more, whichever of them it lies on.
constexpr int kSameLimb = 1, kThighAndBelly = 2;

struct Cover {
  const format::ModelView& model;
  const float* normals;
  const uint16_t* beside;
  double clearance;
  const Surface& surface;
  uint16_t* pressed;
  bool pressed_known;

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

  // Whether it is at most `joints` from the one to the other, by way of the one from which both come.
  bool AreWithin(size_t body_vertex, size_t other, int joints) const {
    if (model.parents == nullptr) return true;
    uint16_t above = MainJointOf(model.body, body_vertex);
    for (int left = joints; left >= 0 && above != format::kNoParent; --left, above = model.parents[above]) {
      uint16_t other_above = MainJointOf(model.body, other);
      for (int i = 0; i <= left && other_above != format::kNoParent; ++i, other_above = model.parents[other_above]) {
        if (above == other_above) return true;
      }
    }
    return false;
  }

  // Both sides of a foot face away from each other, too, and the cloth over its edge is to be lifted.
  bool ArePressed(uint16_t a, uint16_t b, int joints) const {
    if (beside[a] == kNotNear || beside[b] == kNotNear || Cosine(a, b) >= kFacing) return false;
    return !AreWithin(beside[a], beside[b], joints);
  }

  void FindPressed() {
    pressed_known = true;
    constexpr uint16_t kFree = 0, kAround = 1, kPressed = 2;
    for (size_t v = 0; v < model.vertex_count; ++v) pressed[v] = kFree;
    bool found = false;
    for (size_t t = 0; t < model.triangle_count; ++t) {
      const uint16_t* face = model.faces + 3 * t;
      bool between = false;
      for (size_t k = 0; k < 3; ++k) between |= ArePressed(face[k], face[(k + 1) % 3], kThighAndBelly);
      for (size_t k = 0; k < 3 && between; ++k) pressed[face[k]] = kPressed;
      found |= between;
    }
    for (size_t t = 0; t < model.triangle_count && found; ++t) {
      const uint16_t* face = model.faces + 3 * t;
      bool around = false;
      for (size_t k = 0; k < 3; ++k) around |= pressed[face[k]] == kPressed;
      for (size_t k = 0; k < 3 && around; ++k) pressed[face[k]] = pressed[face[k]] == kPressed ? kPressed : kAround;
    }
  }

  bool LiesBetweenLimbs(const uint16_t* vertices, size_t count) {
    if (!pressed_known) FindPressed();
    for (size_t i = 0; i < count; ++i) {
      if (pressed[vertices[i]] != 0 || ArePressed(vertices[i], vertices[(i + 1) % count], kSameLimb)) return true;
    }
    return false;
  }

  // An edge or a triangle, `count` vertices of which one at least is near the skin.
  void Lift(PosedBody posed, const uint16_t* vertices, size_t count, uint32_t* faces) {
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
    // Few frames lift anything so far that it has to be known.
    if (lift > kMostLift * clearance || (lift > kMostBetween * clearance && LiesBetweenLimbs(vertices, count))) return;
    for (size_t i = 0; i < count; ++i) {
      if (beside[vertices[i]] == kNotNear) continue;  // nothing is known of it
      float* p = surface.PositionOf(vertices[i]);
      for (size_t c = 0; c < 3; ++c) p[c] = static_cast<float>(static_cast<double>(p[c]) + lift * closest.direction[c]);
    }
  }
};

}  // namespace

void CoverCorners(const format::ModelView& model, PosedBody posed, const float* normals, const uint16_t* beside,
                  double clearance, const uint8_t* at_edge, uint16_t* pressed, const Surface& surface,
                  uint32_t* faces) {
  Cover cover = {model, normals, beside, clearance, surface, pressed, false};
  for (size_t t = 0; t < model.triangle_count; ++t) {
    const uint16_t* face = model.faces + 3 * t;
    bool cut = false;
    for (size_t k = 0; k < 3; ++k) {
      const uint16_t ends[2] = {face[k], face[(k + 1) % 3]};
      if (!cover.MayBeCut(ends[0], ends[1])) continue;
      if (*faces == 0) return;
      cut = true;
      // The triangle beyond the edge has its ends the other way round. Beyond a hem there is none.
      const bool is_hem = at_edge[ends[0]] != 0 && at_edge[ends[1]] != 0;
      if (ends[0] < ends[1] || is_hem) cover.Lift(posed, ends, 2, faces);
    }
    if (cut && *faces != 0) cover.Lift(posed, face, 3, faces);
  }
}

}  // namespace dcloth::engine

#include "engine/src/body/pierced_cloth.h"

namespace dcloth::engine {
namespace {

constexpr double kLongest = 0.1;  // metres, of a triangle's edge
constexpr double kDip = 0.08;     // metres: a limb that lies on cloth from outside goes in and comes out so soon
constexpr double kFar = 1e18;

struct Triangle {
  Vec corners[3];

  // Whether `from` + t `along`, t from 0 to 1, goes through it.
  bool IsCutBy(Vec from, Vec along, double* t) const {
    const Vec e = corners[1] - corners[0], f = corners[2] - corners[0], p = Cross(along, f);
    const double volume = Dot(e, p);
    if (!(std::fabs(volume) > 0)) return false;
    const Vec s = from - corners[0], q = Cross(s, e);
    const double u = Dot(s, p) / volume, v = Dot(along, q) / volume;
    *t = Dot(f, q) / volume;
    return u >= 0 && v >= 0 && u + v <= 1 && *t >= 0 && *t <= 1;
  }
  Vec area() const { return Cross(corners[1] - corners[0], corners[2] - corners[0]); }
};

// Where a limb goes through cloth.
struct Cut {
  double left;  // of the way to the tip
  bool out;
};

// Whether the limb lay under cloth before it comes out, so far from the tip. `cuts` has that one, too.
bool WasUnder(const Cut* cuts, size_t count, double left, double dip) {
  int outs = 0;
  for (size_t i = 0; i < count; ++i) {
    if (cuts[i].left >= left && cuts[i].left < left + dip) outs += cuts[i].out ? 1 : -1;
  }
  return outs > 0;
}

}  // namespace

LimbWay WayOf(const LimbCores& limbs, const LimbCore& upper) {
  LimbWay way = {};
  const LimbCore* core = &limbs.cores[upper.below];
  way.points[0] = VecAt(core->posed_from);
  for (way.count = 1;; core = &limbs.cores[core->below]) {
    const Vec along = VecAt(core->along), end = VecAt(core->posed_from) + along;
    way.cores[way.count - 1] = core;
    way.points[way.count++] = end;
    if (core->below != kMostCores && way.count <= kMostWayBones) continue;
    way.cores[way.count - 1] = core;
    way.points[way.count++] = end + static_cast<double>(core->tip / LengthOf(*core)) * along;
    return way;
  }
}

Exit FindExit(const format::ModelView& model, bool mirrored, const LimbWay& way, double furthest, double scale,
              const SweptCloth& swept, uint8_t bit, const Surface& surface) {
  constexpr size_t kMost = 16, kMostCuts = 2 * kMost;
  Exit exits[kMost];
  Cut cuts[kMostCuts];
  size_t count = 0, cut_count = 0;
  double in = kFar;
  const Vec tip = way.points[way.count - 1];
  const double near = furthest + kLongest * scale;
  for (size_t t = 0; t < model.triangle_count; ++t) {
    const uint16_t* face = model.faces + 3 * t;
    if (!IsOver(swept, bit, face)) continue;
    const Vec first = VecAt(surface.PositionOf(face[0])), apart = first - tip;
    if (!(Dot(apart, apart) < near * near)) continue;
    const Triangle triangle = {{first, VecAt(surface.PositionOf(face[1])), VecAt(surface.PositionOf(face[2]))}};
    double left = 0;
    for (size_t k = way.count - 1; k > 0; --k) {
      const Vec from = way.points[k - 1], along = way.points[k] - from;
      const double whole = std::sqrt(Dot(along, along));
      double at;
      if (triangle.IsCutBy(from, along, &at)) {
        const double rest = left + (1 - at) * whole;
        const Vec cut = from + at * along, area = (mirrored ? -1.0 : 1.0) * triangle.area();
        const bool out = Dot(area, along) > 0;
        if (cut_count < kMostCuts) cuts[cut_count++] = {rest, out};
        if (!out) in = rest < in ? rest : in;
        if (Dot(area, tip - cut) > 0 && rest < furthest && count < kMost) exits[count++] = {cut, rest, t, k - 1};
        break;
      }
      left += whole;
    }
  }
  Exit chosen = {};
  for (size_t i = 0; i < count; ++i) {
    const bool is_last = exits[i].left < in && exits[i].left > chosen.left;
    if (is_last && WasUnder(cuts, cut_count, exits[i].left, kDip * scale)) chosen = exits[i];
  }
  return chosen;
}

}  // namespace dcloth::engine

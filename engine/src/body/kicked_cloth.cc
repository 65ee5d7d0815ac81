#include "engine/src/body/kicked_cloth.h"

#include <cmath>

#include "engine/src/body/vec.h"

namespace dcloth::engine {
namespace {

using format::ModelView;

constexpr size_t kMostBones = 2;   // shank, foot
constexpr double kFurthest = 0.2;  // metres from where a limb comes out to its tip
constexpr double kSteep = 0.6;     // cosine to the panel's normal: a foot that hangs down along a panel drags no hem
constexpr double kBeyond = 0.01;   // metres, that cloth is moved beyond the tip; less where the limb comes out less
constexpr double kFlat = 0.045;    // metres from the limb's axis: moved as a whole, over the toes
constexpr double kSlope = 1.5;     // metres further out a metre of the move, to where nothing moves
constexpr double kLayers = 0.1;    // metres along the axis from where the limb comes out, of cloth that goes along
constexpr double kLongest = 0.1;   // metres, of a triangle's edge
constexpr double kFar = 1e18;

// A limb from its knee to its tip.
struct Way {
  Vec points[kMostBones + 2];
  size_t count;
};

Way WayOf(const LimbCores& limbs, const LimbCore& upper) {
  Way way = {};
  const LimbCore* core = &limbs.cores[upper.below];
  way.points[way.count++] = VecAt(core->posed_from);
  for (size_t bone = 1;; core = &limbs.cores[core->below], ++bone) {
    const Vec along = VecAt(core->along), end = VecAt(core->posed_from) + along;
    way.points[way.count++] = end;
    if (core->below != kMostCores && bone < kMostBones) continue;
    way.points[way.count++] = end + static_cast<double>(core->tip / LengthOf(*core)) * along;
    return way;
  }
}

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

// Where a limb comes out of the garment.
struct Exit {
  Vec at;
  double left = 0;  // of the way to the tip; 0 where it does not
};

// The furthest from the tip of those after which the limb does not go in again.
Exit FindExit(const ModelView& model, bool mirrored, const Way& way, double scale, const SweptCloth& swept, uint8_t bit,
              const Surface& surface) {
  constexpr size_t kMost = 16;
  Exit exits[kMost];
  size_t count = 0;
  double in = kFar;
  const Vec tip = way.points[way.count - 1];
  const double near = (kFurthest + kLongest) * scale;
  for (size_t t = 0; t < model.triangle_count; ++t) {
    const uint16_t* face = model.faces + 3 * t;
    if ((swept.limbs[face[0]] & swept.limbs[face[1]] & swept.limbs[face[2]] & bit) == 0) continue;
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
        if (!(Dot(area, along) > 0)) in = rest < in ? rest : in;
        const bool steep = Dot(area, tip - cut) > kSteep * std::sqrt(Dot(area, area) * Dot(tip - cut, tip - cut));
        if (steep && rest < kFurthest * scale && count < kMost) exits[count++] = {cut, rest};
        break;
      }
      left += whole;
    }
  }
  Exit furthest = {};
  for (size_t i = 0; i < count; ++i) {
    if (exits[i].left < in && exits[i].left > furthest.left) furthest = exits[i];
  }
  return furthest;
}

// 1 up to `from`, 0 from `to` on.
double Fade(double x, double from, double to) {
  const double share = (to - x) / (to - from);
  return share > 1 ? 1 : share > 0 ? share * share * (3 - 2 * share) : 0;
}

}  // namespace

void TakeAlong(const ModelView& model, bool mirrored, const LimbCores& limbs, const SweptCloth& swept,
               const Surface& surface) {
  VisitLimbs(limbs, [&](const LimbCore& upper, uint32_t, uint8_t bit) {
    const double scale = static_cast<double>(upper.scale);
    const Way way = WayOf(limbs, upper);
    const Exit exit = FindExit(model, mirrored, way, scale, swept, bit, surface);
    if (!(exit.left > 0)) return;
    const Vec tip = way.points[way.count - 1] - exit.at;
    const double length = std::sqrt(Dot(tip, tip));
    if (!(length > 0)) return;
    const double beyond = kBeyond * scale;
    const Vec axis = (1 / length) * tip, move = (length + (length < beyond ? length : beyond)) * axis;
    const double flat = kFlat * scale, around = flat + kSlope * length, layers = kLayers * scale;
    for (size_t v = 0; v < model.vertex_count; ++v) {
      if ((swept.limbs[v] & bit) == 0) continue;
      float* position = surface.PositionOf(v);
      const Vec apart = VecAt(position) - exit.at;
      const double along = Dot(apart, axis), squared = Dot(apart, apart) - along * along;
      if (!(squared < around * around)) continue;
      const double share =
          Fade(std::sqrt(squared > 0 ? squared : 0), flat, around) * Fade(std::fabs(along), layers, 2 * layers);
      position[0] += static_cast<float>(share * move.x);
      position[1] += static_cast<float>(share * move.y);
      position[2] += static_cast<float>(share * move.z);
    }
  });
}

}  // namespace dcloth::engine

#include "engine/src/body/kicked_cloth.h"

#include <cmath>

#include "engine/src/body/vec.h"

namespace dcloth::engine {
namespace {

using format::ModelView;

constexpr size_t kMostBones = 2;              // shank, foot
constexpr double kFurthest = 0.2;             // metres from where a limb comes out to its tip
constexpr double kPatch = 0.08;               // metres around that place, of cloth that tells the panel's normal
constexpr double kAlong = 0.5, kSteep = 0.7;  // cosine to it: a foot that hangs down along a panel, that sticks out
constexpr double kBeyond = 0.01;  // metres, that cloth is moved beyond the tip; less where the limb comes out less
constexpr double kThick = 0.03;   // metres, likewise over the side of a foot
constexpr double kFlat = 0.045;   // metres from the limb: moved as a whole, over the toes
constexpr double kSlope = 1.5;    // metres further out a metre of the move, to where nothing moves
constexpr double kLayers = 0.1;   // metres along the move from where the limb comes out, of cloth that goes along
constexpr double kLongest = 0.1;  // metres, of a triangle's edge
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

// Whether the limb lies under all corners.
bool IsOver(const SweptCloth& swept, uint8_t bit, const uint16_t* face) {
  return (swept.limbs[face[0]] & swept.limbs[face[1]] & swept.limbs[face[2]] & bit) != 0;
}

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
        if (!(Dot(area, along) > 0)) in = rest < in ? rest : in;
        if (Dot(area, tip - cut) > 0 && rest < kFurthest * scale && count < kMost) exits[count++] = {cut, rest};
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

// Of the garment around a place, as its vector area has it: pleats do not turn that. 0 where it has none.
Vec NormalAround(const ModelView& model, bool mirrored, Vec at, double near, const SweptCloth& swept, uint8_t bit,
                 const Surface& surface) {
  Vec sum = {};
  for (size_t t = 0; t < model.triangle_count; ++t) {
    const uint16_t* face = model.faces + 3 * t;
    if (!IsOver(swept, bit, face)) continue;
    const Vec first = VecAt(surface.PositionOf(face[0])), apart = first - at;
    if (!(Dot(apart, apart) < near * near)) continue;
    sum = sum + Triangle{{first, VecAt(surface.PositionOf(face[1])), VecAt(surface.PositionOf(face[2]))}}.area();
  }
  const double length = std::sqrt(Dot(sum, sum));
  return length > 0 ? ((mirrored ? -1.0 : 1.0) / length) * sum : Vec{};
}

// The way that cloth goes for `tip`, so far from where the limb comes out: along a foot that sticks out of the panel,
// away from the panel over one that hangs down along it, as that would drag the hem. A unit vector, or 0.
Vec WayOver(Vec tip, double length, Vec normal) {
  const double share = (Dot(tip, normal) / length - kAlong) / (kSteep - kAlong);
  const double steep = share < 0 ? 0 : share < 1 ? share : 1;
  const Vec way = (1 - steep) * normal + (steep / length) * tip;
  const double size = std::sqrt(Dot(way, way));
  return size > 0 ? (1 / size) * way : Vec{};
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
    const Vec normal = NormalAround(model, mirrored, exit.at, kPatch * scale, swept, bit, surface);
    const Vec out = WayOver(tip, length, normal);
    const double reach = Dot(tip, out), height = reach > 0 ? reach : 0;
    const Vec beside = tip - reach * out;  // the limb, seen from where cloth goes
    const double wide = Dot(beside, beside);
    const double over = (kBeyond * height + kThick * std::sqrt(wide)) / length * scale;
    const double move = height + (exit.left < over ? exit.left : over);
    const double flat = kFlat * scale, around = flat + kSlope * move, layers = kLayers * scale;
    for (size_t v = 0; v < model.vertex_count; ++v) {
      if ((swept.limbs[v] & bit) == 0) continue;
      float* position = surface.PositionOf(v);
      const Vec apart = VecAt(position) - exit.at;
      const double along = Dot(apart, out), at = wide > 0 ? Dot(apart, beside) / wide : 0;
      const Vec off = apart - along * out - (at < 0 ? 0 : at < 1 ? at : 1) * beside;
      const double squared = Dot(off, off);
      if (!(squared < around * around)) continue;
      const double share = move * Fade(std::sqrt(squared), flat, around) * Fade(std::fabs(along), layers, 2 * layers);
      position[0] += static_cast<float>(share * out.x);
      position[1] += static_cast<float>(share * out.y);
      position[2] += static_cast<float>(share * out.z);
    }
  });
}

}  // namespace dcloth::engine

#include "engine/src/body/kicked_cloth.h"

#include <cmath>

#include "engine/src/body/pierced_cloth.h"

namespace dcloth::engine {
namespace {

using format::ModelView;

constexpr double kFurthest = 0.2;             // metres from where a limb comes out to its tip
constexpr double kPatch = 0.08;               // metres around that place, of cloth that tells the panel's normal
constexpr double kAlong = 0.5, kSteep = 0.7;  // cosine to it: a foot that hangs down along a panel, that sticks out
constexpr double kBeyond = 0.01;  // metres, that cloth is moved beyond the skin; less where the limb comes out less
constexpr double kThick = 0.03;   // metres, likewise over the side of a foot
constexpr double kFlat = 0.045;   // metres from the limb: moved as a whole, over the toes
constexpr double kSlope = 1.5;    // metres further out a metre of the move, to where nothing moves
// Cloth behind where the limb comes out, in a pleat, moves by that more, so many metres at most; metres further out a
// metre of the move, to where none does.
constexpr double kDeepest = 0.05, kDeepSlope = 0.5;
constexpr double kLayers = 0.1;  // metres along the move from where the limb comes out, of cloth that goes along

// The way that cloth goes for `tip`, so far from where the limb comes out: along a foot that sticks out of the panel,
// away from the panel over one that hangs down along it, as that would drag the hem. A unit vector, or 0.
Vec WayOver(Vec tip, double length, Vec normal) {
  const double share = (Dot(tip, normal) / length - kAlong) / (kSteep - kAlong);
  const double steep = share < 0 ? 0 : share < 1 ? share : 1;
  return Normalized((1 - steep) * normal + (steep / length) * tip);
}

bool GoesWith(const ModelView& model, size_t body_vertex, uint32_t joint) {
  uint16_t at = MainJointOf(model.body, body_vertex);
  while (at != joint && at != format::kNoParent) at = model.parents[at];
  return at == joint;
}

// How far from `from` along the unit vector `out` the skin reaches that goes with `joint`, at least `reach`: toes are
// beside the bone.
double ReachOf(const ModelView& model, uint32_t joint, const float* skin, Vec from, Vec out, double reach) {
  for (size_t v = 0; v < model.body.vertex_count; ++v) {
    const double at = Dot(VecAt(skin + 3 * v) - from, out);
    if (at > reach && GoesWith(model, v, joint)) reach = at;
  }
  return reach;
}

}  // namespace

bool TakeAlong(const ModelView& model, bool mirrored, const float* skin, const LimbCores& limbs,
               const SweptCloth& swept, const Surface& surface) {
  bool taken = false;
  VisitLimbs(limbs, [&](const LimbCore& upper, uint32_t, uint8_t bit) {
    const double scale = static_cast<double>(upper.scale);
    const LimbWay way = WayOf(limbs, upper);
    const Exit exit = FindExit(model, mirrored, way, kFurthest * scale, scale, swept, bit, surface);
    if (!(exit.left > 0)) return;
    const Vec tip = way.points[way.count - 1] - exit.at;
    const double length = std::sqrt(Dot(tip, tip));
    if (!(length > 0)) return;
    taken = true;
    const Vec area =
        AreaAround(model, exit.at, kPatch * scale, swept, bit, [&](size_t v) { return VecAt(surface.PositionOf(v)); });
    const Vec out = WayOver(tip, length, (mirrored ? -1.0 : 1.0) * Normalized(area));
    const double reach = Dot(tip, out), height = reach > 0 ? reach : 0;
    const Vec beside = tip - reach * out;  // the limb, seen from where cloth goes
    const double wide = Dot(beside, beside);
    const double over = ReachOf(model, way.cores[way.count - 2]->joint, skin, exit.at, out, height) - height +
                        (kBeyond * height + kThick * std::sqrt(wide)) / length * scale;
    const double move = height + (exit.left < over ? exit.left : over);
    const double flat = kFlat * scale, around = flat + kSlope * move, layers = kLayers * scale;
    const double deep_around = flat + kDeepSlope * move, most_behind = kDeepest * scale,
                 deepest = exit.left < most_behind ? exit.left : most_behind;
    for (size_t v = 0; v < model.vertex_count; ++v) {
      if ((swept.limbs[v] & bit) == 0) continue;
      float* position = surface.PositionOf(v);
      const Vec apart = VecAt(position) - exit.at;
      const double along = Dot(apart, out), at = wide > 0 ? Dot(apart, beside) / wide : 0;
      const Vec off = apart - along * out - (at < 0 ? 0 : at < 1 ? at : 1) * beside;
      const double squared = Dot(off, off);
      if (!(squared < around * around)) continue;
      const double apart_from = std::sqrt(squared), behind = along < -deepest ? deepest : along < 0 ? -along : 0;
      const double share = (move * Fade(apart_from, flat, around) + behind * Fade(apart_from, flat, deep_around)) *
                           Fade(std::fabs(along), layers, 2 * layers);
      position[0] += static_cast<float>(share * out.x);
      position[1] += static_cast<float>(share * out.y);
      position[2] += static_cast<float>(share * out.z);
    }
  });
  return taken;
}

}  // namespace dcloth::engine

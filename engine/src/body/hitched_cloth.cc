#include "engine/src/body/hitched_cloth.h"

#include <cmath>
#include <cstring>

#include "engine/src/body/pierced_cloth.h"
#include "engine/src/body/vec.h"

namespace dcloth::engine {
namespace {

using format::ModelView;

// Metres of the bind pose.
constexpr double kPatch = 0.08;     // around where a limb comes out, of cloth that tells the normal
constexpr double kEdge = 0.05;      // further than the nearest of an edge, of edges that tell the way from there
constexpr double kBefore = 0.5;     // cosine between the way from an edge and the bone: it lies before that place
constexpr double kPast = 0.015;     // from the limb to the edge, afterwards
constexpr double kMostRise = 0.35;  // of an edge
constexpr double kStep = 0.008;     // less than from a vertex to the next
constexpr double kAside = 0.6;      // of the rise: beside the limb, over which it is less
constexpr double kPressed = 2;      // of the rise: from the edge on so much cloth is pressed together
constexpr size_t kMostHitches = 8;  // limbs, of VisitLimbs
constexpr double kFar = 1e18;

// In the bind pose, metres.
struct Hitch {
  uint8_t bit;
  Vec at, up;                 // where the limb comes out, and a unit vector along the cloth there, away from the edge
  double edge, rise, beside;  // of the edge, along `up` from there; how far it goes; how far aside it goes as far
};

Vec BoundOf(const ModelView& model, size_t vertex) { return VecAt(model.template_positions + 3 * vertex); }

Vec BoundOf(const ModelView& model, const Exit& exit, const Surface& surface) {
  const uint16_t* face = model.faces + 3 * exit.triangle;
  Vec corners[3], sum = {};
  for (size_t k = 0; k < 3; ++k) corners[k] = VecAt(surface.PositionOf(face[k]));
  const Vec area = Cross(corners[1] - corners[0], corners[2] - corners[0]);
  for (size_t k = 0; k < 3; ++k) {
    const Vec from = corners[(k + 1) % 3], along = corners[(k + 2) % 3] - from;
    sum = sum + Dot(Cross(along, exit.at - from), area) / Dot(area, area) * BoundOf(model, face[k]);
  }
  return sum;
}

// Of the skin around a bone, the thickest.
double ThicknessOf(const LimbCore& core) {
  float widest = core.cap;
  for (const auto& slice : core.radii) {
    for (const float radius : slice) widest = radius > widest ? radius : widest;
  }
  return static_cast<double>(widest / kCoreOfFree);
}

// visit(way to `at`, its length) for the vertices of edges that the limb lies under, but for those before that place
// along `bone`: a hem or a slit, no waist.
template <typename Visit>
void VisitEdges(const ModelView& model, const SweptCloth& swept, const HitchedCloth& hitched, uint8_t bit, Vec at,
                Vec bone, Visit visit) {
  for (size_t v = 0; v < model.vertex_count; ++v) {
    if (hitched.at_edge[v] == 0 || (swept.limbs[v] & bit) == 0) continue;
    const Vec way = at - BoundOf(model, v);
    const double length = std::sqrt(Dot(way, way));
    if (!(Dot(way, bone) > kBefore * length)) visit(way, length);
  }
}

// False where no edge is near enough.
bool FindHitch(const ModelView& model, const SweptCloth& swept, const HitchedCloth& hitched, uint8_t bit, Vec at,
               Vec bone, double thickness, Hitch* hitch) {
  double nearest = kFar;
  Vec up = {};
  VisitEdges(model, swept, hitched, bit, at, bone,
             [&](Vec, double length) { nearest = length < nearest ? length : nearest; });
  VisitEdges(model, swept, hitched, bit, at, bone, [&](Vec way, double length) {
    if (length < nearest + kEdge) up = up + way;
  });
  const Vec normal = Normalized(AreaAround(model, at, kPatch, swept, bit, [&](size_t v) { return BoundOf(model, v); }));
  const double beside = thickness + kPast;
  *hitch = {bit, at, Normalized(up - Dot(up, normal) * normal), -nearest, nearest + beside, beside};
  return hitch->rise < kMostRise && Dot(hitch->up, hitch->up) > 0;
}

// How far a vertex is to slide: all around the limb and down to the edge as far as that, and less and less further up
// and aside.
double WayOf(const Hitch& hitch, Vec bound) {
  const Vec apart = bound - hitch.at;
  const double along = Dot(apart, hitch.up);
  const Vec aside = apart - along * hitch.up;
  return hitch.rise * Fade(std::sqrt(Dot(aside, aside)), hitch.beside, hitch.beside + kAside * hitch.rise) *
         Fade(along - hitch.edge, hitch.rise, kPressed * hitch.rise);
}

// Fills in `steps`: of the cloth that slides, along `up` in the plane across a vertex's normal. Cloth at an edge of
// which nothing lies that way stays. `normals` [n, 3] is scratch.
void FindSteps(const ModelView& model, const SweptCloth& swept, const Hitch& hitch, double count, SlideStep* steps,
               float* normals) {
  for (size_t v = 0; v < model.vertex_count; ++v) {
    const double way = (swept.limbs[v] & hitch.bit) == 0 ? 0.0 : WayOf(hitch, BoundOf(model, v));
    const auto own = static_cast<uint16_t>(v);
    steps[v] = {{own, own}, 0, static_cast<float>(way / count)};
    for (size_t c = 0; c < 3; ++c) normals[3 * v + c] = 0;
  }
  const auto visit = [&](auto look) {
    for (size_t t = 0; t < model.triangle_count; ++t) {
      const uint16_t* face = model.faces + 3 * t;
      for (size_t k = 0; k < 3; ++k) {
        const uint16_t v = face[k], next = face[(k + 1) % 3], last = face[(k + 2) % 3];
        if (!(steps[v].part > 0) || steps[v].ends[0] != v) continue;
        look(v, next, last, BoundOf(model, next) - BoundOf(model, v), BoundOf(model, last) - BoundOf(model, v));
      }
    }
  };
  visit([&](uint16_t v, uint16_t, uint16_t, Vec first, Vec second) {
    const Vec area = Cross(first, second);
    float* normal = normals + size_t{3} * v;
    normal[0] += static_cast<float>(area.x);
    normal[1] += static_cast<float>(area.y);
    normal[2] += static_cast<float>(area.z);
  });
  visit([&](uint16_t v, uint16_t next, uint16_t last, Vec first, Vec second) {
    const Vec normal = Normalized(VecAt(normals + size_t{3} * v)), way = hitch.up - Dot(hitch.up, normal) * normal;
    const double a = Dot(normal, Cross(way, second)), b = Dot(normal, Cross(first, way));
    if (!(a >= 0 && b >= 0 && a + b > 0 && Dot(normal, Cross(first, second)) > 0)) return;
    const double share = b / (a + b), rise = Dot((1 - share) * first + share * second, hitch.up);
    if (!(rise > 0)) return;
    const double part = static_cast<double>(steps[v].part) / rise;
    steps[v] = {{next, last}, static_cast<float>(share), static_cast<float>(part < 1 ? part : 1)};
  });
}

// Each vertex goes to where one further up lay, over many short steps.
void Slide(const ModelView& model, const SweptCloth& swept, const Hitch& hitch, const HitchedCloth& hitched,
           const Surface& surface) {
  const int count = static_cast<int>(hitch.rise / kStep) + 1;
  FindSteps(model, swept, hitch, count, hitched.steps, hitched.drawn);
  for (int step = 0; step < count; ++step) {
    for (size_t v = 0; v < model.vertex_count; ++v) {
      const SlideStep& way = hitched.steps[v];
      if (!(way.part > 0)) continue;
      const float *p = surface.PositionOf(v), *a = surface.PositionOf(way.ends[0]),
                  *b = surface.PositionOf(way.ends[1]);
      for (size_t c = 0; c < 3; ++c)
        hitched.drawn[3 * v + c] = p[c] + way.part * (a[c] + way.share * (b[c] - a[c]) - p[c]);
    }
    for (size_t v = 0; v < model.vertex_count; ++v) {
      for (size_t c = 0; c < 3 && hitched.steps[v].part > 0; ++c) surface.PositionOf(v)[c] = hitched.drawn[3 * v + c];
    }
  }
}

}  // namespace

HitchedCloth PlaceHitchedCloth(const ModelView& model, Arena* arena) {
  return {nullptr, arena->Take<float>(size_t{3} * model.vertex_count), arena->Take<SlideStep>(model.vertex_count)};
}

// Around a vertex inside of the garment each neighbour is the next one of a triangle and the last one of another.
void FindEdges(const ModelView& model, const HitchedCloth& hitched) {
  for (size_t v = 0; v < model.vertex_count; ++v) hitched.steps[v].ends[0] = 0;
  for (size_t i = 0; i < size_t{3} * model.triangle_count; ++i) {
    const uint16_t *face = model.faces + i / 3 * 3, next = face[(i + 1) % 3], last = face[(i + 2) % 3];
    uint16_t* sum = &hitched.steps[model.faces[i]].ends[0];
    *sum = static_cast<uint16_t>(*sum + next - last);
  }
  for (size_t v = 0; v < model.vertex_count; ++v) hitched.at_edge[v] = hitched.steps[v].ends[0] != 0 ? 1 : 0;
}

void KeepDrawn(const ModelView& model, const HitchedCloth& hitched, const Surface& surface) {
  for (size_t v = 0; v < model.vertex_count; ++v)
    std::memcpy(hitched.drawn + 3 * v, surface.PositionOf(v), 3 * sizeof(float));
}

bool HitchUp(const ModelView& model, bool mirrored, const LimbCores& limbs, uint8_t torn, const SweptCloth& swept,
             const HitchedCloth& hitched, const Surface& surface) {
  Hitch hitches[kMostHitches];
  size_t count = 0;
  VisitLimbs(limbs, [&](const LimbCore& upper, uint32_t, uint8_t bit) {
    if ((torn & bit) == 0) return;
    const LimbWay way = engine::WayOf(limbs, upper);
    const Exit exit = FindExit(model, mirrored, way, kFar, static_cast<double>(upper.scale), swept, bit, surface);
    if (!(exit.left > 0)) return;
    const Vec at = BoundOf(model, exit, surface), bone = Normalized(VecAt(upper.to) - VecAt(upper.from));
    const double thickness = ThicknessOf(*way.cores[exit.bone]);
    count += FindHitch(model, swept, hitched, bit, at, bone, thickness, &hitches[count]) ? 1 : 0;
  });
  if (count == 0) return false;
  for (size_t v = 0; v < model.vertex_count; ++v)
    std::memcpy(surface.PositionOf(v), hitched.drawn + 3 * v, 3 * sizeof(float));
  for (size_t i = 0; i < count; ++i) Slide(model, swept, hitches[i], hitched, surface);
  return true;
}

}  // namespace dcloth::engine

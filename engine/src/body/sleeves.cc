#include "engine/src/body/sleeves.h"

#include <cmath>
#include <initializer_list>

namespace dcloth::engine {
namespace {

using format::ModelView;

// Lengths in metres, of the bind pose.
constexpr float kAround = 0.2f;        // from a bone, at most: a sleeve hangs
constexpr float kBegin = 0.2f;         // share of a bone without one above it; before that cloth belongs to the trunk
constexpr size_t kRings = 32;          // from that bone's start; the last one is as long as it has to be
constexpr float kRingWidth = 0.03f;    // of the others
constexpr size_t kCorners = 16;        // of a ring
constexpr size_t kFewestCorners = 10;  // of one that is judged
constexpr float kLimb = 1.5f;          // of the lower bone: a hand or a foot are the limb, too
// Cosines of the angle by which a limb is bent: up to 110 degrees its rings are shifted, from 122 on they are not, as
// in the crook there is no room for them as they are.
constexpr float kShiftAll = -0.34f, kShiftNone = -0.53f;
// Between a ring's edge and the bones that go through it: cloth is as good as lost, and well where it is; with shifts,
// which make that room, and without.
constexpr float kRoom = 0.03f;
constexpr float kLost[2] = {0.005f, 0.02f}, kWell[2] = {0.015f, 0.03f};
constexpr int kShiftRounds = 2;  // what is shifted for one ring may leave too little room for another
constexpr size_t kShifted = 4;   // rings from a shifted one to the first that stays
constexpr int kShiftSteps = 4;   // of one shift: a ring pressed flat has not enough room on any side
constexpr float kShiftPart = 0.7f;
constexpr float kStep = 0.4f;                  // a ring beside a lost one is lost less by this
constexpr size_t kEnd = 4;                     // rings at a sleeve's end: they go with one that is lost
constexpr float kFade = 0.06f;                 // from where a sleeve begins, over which it is drawn less
constexpr float kHinge = 0.06f;                // before and after a hinge a sleeve goes around both limbs
constexpr float kNoHinge = 0.1f;               // of two directions added: folded flat, a limb has none at its hinge
constexpr float kOpposite = 0.05f;             // of two unit vectors added: they point apart
constexpr float kNear = 0.7f;                  // what a ring tells of others counts less by this for each between
constexpr float kLeastTrust = 0.01f;           // in one that is nearly lost: there may be no other
constexpr float kUnsure = 0.2f, kSure = 0.5f;  // mean of unit vectors that tells how a ring is turned
constexpr float kSnug = 0.01f;                 // over the thickest of the skin
constexpr float kSlack = 0.3f;                 // of what a sleeve is wider than that
constexpr float kPressed = 0.005f;             // over the skin of both limbs, in their crease
constexpr float kFurthestOut = 0.2f;           // from a hinge, that cloth is pressed out of its crease
constexpr int kHalvings = 8;                   // of it, to find the skin
constexpr float kFar = 1e18f;

float Clamped(float x, float most = 1) { return x < 0 ? 0.0f : x < most ? x : most; }
float Larger(float a, float b) { return a > b ? a : b; }

bool Normalize(float* vector, float least) {
  const float length = std::sqrt(Dot(vector, vector));
  if (!(length > least)) return false;
  for (size_t c = 0; c < 3; ++c) vector[c] /= length;
  return true;
}

// A limb and the one that bends with it. Places along it are metres from where they meet.
struct Chain {
  const LimbCore *upper, *lower;
  float upper_length, lower_length;
  uint32_t upper_core, lower_core;
  float shifted;  // 0 to 1: how far rings are shifted, by how far the limb is bent
  float side;     // -1 where the host's space is mirrored, else 1
  float turn[2];  // cosine and sine of the turn from the lower core's directions around to those like the upper's
};

float ShiftedPart(const LimbCore& upper, const LimbCore& lower) {
  const float lengths = std::sqrt(Dot(upper.along, upper.along) * Dot(lower.along, lower.along));
  if (!(lengths > 0)) return 0;
  return Clamped((Dot(upper.along, lower.along) / lengths - kShiftNone) / (kShiftAll - kShiftNone));
}

float Shifted(const Chain& chain, const float* with_and_without) {
  return chain.shifted * with_and_without[0] + (1 - chain.shifted) * with_and_without[1];
}

// Of a garment vertex on the bones of the bind pose.
float PlaceOf(const Chain& chain, bool in_upper, const float* bound) {
  const float along = InBindPose(in_upper ? *chain.upper : *chain.lower, bound).along;
  return in_upper ? (along - 1) * chain.upper_length : along * chain.lower_length;
}

// In rings from the upper bone's start.
float RingOf(const Chain& chain, float place) { return Clamped((place + chain.upper_length) / kRingWidth, kRings - 1); }
float MiddleOf(const Chain& chain, size_t ring) {
  return (static_cast<float>(ring) + 0.5f) * kRingWidth - chain.upper_length;
}

// A place on the posed bones, with unit vectors along them and across. Around a hinge both limbs have a share.
struct Axis {
  float share;  // of the lower limb
  float at[3], along[3], across[2][3];
};

// A unit vector across `from`, turned by the least turn that takes `from` to `to`; these are unit vectors less than
// half a turn apart.
void TurnAlong(const float* from, const float* to, float* across) {
  const float part = Dot(across, to) / (1 + Dot(from, to));
  for (size_t c = 0; c < 3; ++c) across[c] -= part * (from[c] + to[c]);
}

// From `first` to `second` by `share`, unit vectors across `along`; between opposite ones it goes around.
bool TurnBetween(const float* first, const float* second, const float* along, float share, float* out) {
  float middle[3];
  for (size_t c = 0; c < 3; ++c) middle[c] = first[c] + second[c];
  if (!Normalize(middle, kOpposite)) Cross(along, first, middle);
  const float part = 2 * share;
  for (size_t c = 0; c < 3; ++c)
    out[c] = part < 1 ? (1 - part) * first[c] + part * middle[c] : (2 - part) * middle[c] + (part - 1) * second[c];
  return Normalize(out, 0);
}

bool AxisAt(const Chain& chain, float place, Axis* axis) {
  const LimbCore &upper = *chain.upper, &lower = *chain.lower;
  const float share = axis->share = Clamped(0.5f * (1 + place / kHinge));
  const float a = 1 + place / chain.upper_length, b = place / chain.lower_length;
  float first[3], second[3], above[3], below[3];
  for (size_t c = 0; c < 3; ++c) {
    axis->at[c] =
        (1 - share) * (upper.posed_from[c] + a * upper.along[c]) + share * (lower.posed_from[c] + b * lower.along[c]);
    above[c] = upper.posed_around[0][c];
    below[c] = chain.turn[0] * lower.posed_around[0][c] + chain.turn[1] * lower.posed_around[1][c];
    first[c] = upper.along[c], second[c] = lower.along[c];
  }
  if (!Normalize(first, 0) || !Normalize(second, 0) || !Normalize(above, 0) || !Normalize(below, 0)) return false;
  for (size_t c = 0; c < 3; ++c) axis->along[c] = (1 - share) * first[c] + share * second[c];
  if (!Normalize(axis->along, kNoHinge)) return false;
  TurnAlong(first, axis->along, above);
  TurnAlong(second, axis->along, below);
  if (!TurnBetween(above, below, axis->along, share, axis->across[0])) return false;
  Cross(axis->along, axis->across[0], axis->across[1]);
  for (float& c : axis->across[1]) c *= chain.side;
  return true;
}

// The side on which a vertex was in the bind pose, a unit vector in the axis's directions across, and how far from the
// bones; false on a bone.
bool OwnSideOf(const Chain& chain, const Axis& axis, const float* bound, float* x, float* y, float* apart) {
  *x = *y = *apart = 0;
  for (const bool first : {true, false}) {
    const LimbCore& core = first ? *chain.upper : *chain.lower;
    const float share = first ? 1 - axis.share : axis.share;
    const float cosine = first ? 1.0f : chain.turn[0], sine = first ? 0.0f : chain.turn[1];
    const float relative[3] = {bound[0] - core.from[0], bound[1] - core.from[1], bound[2] - core.from[2]};
    const float u = Dot(relative, core.around[0]), w = Dot(relative, core.around[1]), length = std::sqrt(u * u + w * w);
    if (!(length > 0)) return false;
    *apart += share * length;
    *x += share * (cosine * u + sine * w) / length;
    *y += share * (cosine * w - sine * u) / length;
  }
  const float length = std::sqrt(*x * *x + *y * *y);
  if (!(length > 0)) return false;
  *x /= length;
  *y /= length;
  return true;
}

// The limb `upper`, posed, and the one below it. In the bind pose their directions around are brought together.
Chain ChainOf(const LimbCores& limbs, uint32_t upper) {
  const LimbCore &first = limbs.cores[upper], &second = limbs.cores[first.below];
  Chain chain = {&first, &second, LengthOf(first), LengthOf(second), upper, first.below, ShiftedPart(first, second),
                 1,      {1, 0}};
  float above[3], below[3], across[3], normal[3];
  for (size_t c = 0; c < 3; ++c) {
    above[c] = (first.to[c] - first.from[c]) / chain.upper_length;
    below[c] = (second.to[c] - second.from[c]) / chain.lower_length;
    across[c] = first.around[0][c];
  }
  if (Dot(above, below) > kNoHinge - 1) {
    TurnAlong(above, below, across);
    chain.turn[0] = Dot(across, second.around[0]);
    chain.turn[1] = Dot(across, second.around[1]);
  }
  Cross(first.posed_around[0], first.posed_around[1], normal);
  if (Dot(normal, first.along) < 0) chain.side = -1;
  return chain;
}

struct Ring {
  float corners[kCorners][3];  // of the cloth in a sixteenth of the directions around the bone: first sums, then means
  uint32_t counts[kCorners];
  bool judged;         // there is cloth all around
  bool kept;           // the bones go through it, not too near its edge
  float lost;          // 0 to 1: how far it is laid around the limb
  float slide;         // towards the limb's end, from where it is in the bind pose
  float cosine, sine;  // of its turn around the limb: first sums
  float turned;        // vertices in the sums
};

size_t CornerAt(float u, float w) {
  constexpr float kSlopes[kCorners / 4 - 1] = {0.41421356f, 1, 2.41421356f};
  const float a = std::fabs(u), b = std::fabs(w);
  size_t at = 0;
  while (at < kCorners / 4 - 1 && b > kSlopes[at] * a) ++at;
  if (u < 0) at = kCorners / 2 - 1 - at;
  return w < 0 ? kCorners - 1 - at : at;
}

// visit(vertex, bound, place, position)
template <typename Visit>
void VisitSleeve(const ModelView& model, const Sleeves& sleeves, const Chain& chain, const Surface& surface,
                 Visit visit) {
  for (size_t v = 0; v < model.vertex_count; ++v) {
    const uint8_t core = sleeves.cores[v];
    if (core != chain.upper_core && core != chain.lower_core) continue;
    const float* bound = model.template_positions + 3 * v;
    visit(v, bound, PlaceOf(chain, core == chain.upper_core, bound), surface.PositionOf(v));
  }
}

// 1 or -1 where the stretch goes through the triangle, by the side that it comes from, else 0; `part` of it lies
// before.
int GoesThrough(const float* from, const float* along, const float* a, const float* b, const float* c, float* part) {
  float ab[3], ac[3], to[3], across[3], turned[3];
  for (size_t i = 0; i < 3; ++i) ab[i] = b[i] - a[i], ac[i] = c[i] - a[i], to[i] = from[i] - a[i];
  Cross(along, ac, across);
  Cross(to, ab, turned);
  const float volume = Dot(ab, across);
  if (volume == 0) return 0;
  const float u = Dot(to, across) / volume, v = Dot(along, turned) / volume;
  *part = Dot(ac, turned) / volume;
  if (!(u >= 0 && v >= 0 && u + v <= 1 && *part >= 0 && *part < 1)) return 0;
  return volume < 0 ? 1 : -1;
}

// Squared distance of two stretches, each from a point along a vector.
float SquaredApart(const float* from, const float* along, const float* other_from, const float* other_along) {
  float between[3], apart[3];
  for (size_t c = 0; c < 3; ++c) between[c] = from[c] - other_from[c];
  const float a = Dot(along, along), b = Dot(along, other_along), c = Dot(other_along, other_along);
  const float d = Dot(along, between), e = Dot(other_along, between), area = a * c - b * b;
  float at = area > 0 ? Clamped((b * e - c * d) / area) : 0.0f;
  const float other_at = c > 0 ? Clamped((b * at + e) / c) : 0.0f;
  at = a > 0 ? Clamped((b * other_at - d) / a) : 0.0f;
  for (size_t i = 0; i < 3; ++i) apart[i] = between[i] + at * along[i] - other_at * other_along[i];
  return Dot(apart, apart);
}

// The bones go through a ring that holds them, once more from its one side than from the other.
void Judge(const Chain& chain, float middle_place, Ring* ring) {
  const float* corners[kCorners];
  size_t count = 0;
  float middle[3] = {};
  for (size_t k = 0; k < kCorners; ++k) {
    if (ring->counts[k] == 0) continue;
    for (float& c : ring->corners[k]) c /= static_cast<float>(ring->counts[k]);
    for (size_t c = 0; c < 3; ++c) middle[c] += ring->corners[k][c];
    corners[count++] = ring->corners[k];
  }
  ring->judged = count >= kFewestCorners;
  if (!ring->judged) return;
  for (float& c : middle) c /= static_cast<float>(count);
  int times = 0;
  float squared = kFar;
  for (const bool first : {true, false}) {
    const LimbCore& core = first ? *chain.upper : *chain.lower;
    const float length = first ? 1 : kLimb;
    const float along[3] = {length * core.along[0], length * core.along[1], length * core.along[2]};
    float part = 0;
    const int side = chain.side < 0 ? -1 : 1;
    for (size_t k = 0; k < count; ++k) {
      const int found = side * GoesThrough(core.posed_from, along, middle, corners[k], corners[(k + 1) % count], &part);
      times += found;
      const float place = first ? (part - 1) * chain.upper_length : part * length * chain.lower_length;
      if (found > 0) ring->slide = place - middle_place;
      const float* next = corners[(k + 1) % count];
      const float edge[3] = {next[0] - corners[k][0], next[1] - corners[k][1], next[2] - corners[k][2]};
      const float apart = SquaredApart(corners[k], edge, core.posed_from, core.along);
      squared = apart < squared ? apart : squared;
    }
  }
  const float apart = std::sqrt(squared) / chain.upper->scale;
  const float well = Shifted(chain, kWell), lost = Shifted(chain, kLost);
  ring->lost = times == 1 ? Clamped((well - apart) / (well - lost)) : 1.0f;
  ring->kept = !(ring->lost > 0.5f);
}

// The corners of a ring as seen along the bones, which are at the origin.
struct Outline {
  float points[kCorners][2];
  size_t count;
};

// The bones' distance from the outline moved by `offset`, negative outside of it; `nearest` receives its place nearest
// to them.
float DistanceInside(const Outline& outline, const float* offset, float* nearest) {
  float squared = kFar;
  int turns = 0;
  for (size_t k = 0; k < outline.count; ++k) {
    const float *from = outline.points[k], *to = outline.points[(k + 1) % outline.count];
    const float a[2] = {from[0] + offset[0], from[1] + offset[1]}, b[2] = {to[0] + offset[0], to[1] + offset[1]};
    const float way[2] = {b[0] - a[0], b[1] - a[1]}, length = way[0] * way[0] + way[1] * way[1];
    const float along = length > 0 ? Clamped(-(a[0] * way[0] + a[1] * way[1]) / length) : 0.0f;
    const float at[2] = {a[0] + along * way[0], a[1] + along * way[1]}, apart = at[0] * at[0] + at[1] * at[1];
    if (apart < squared) {
      squared = apart;
      nearest[0] = at[0];
      nearest[1] = at[1];
    }
    const bool rises = b[1] > 0;
    if ((a[1] > 0) != rises && rises == (a[0] * b[1] - a[1] * b[0] > 0)) turns += rises ? 1 : -1;
  }
  return turns != 0 ? std::sqrt(squared) : -std::sqrt(squared);
}

// How far the ring is to go across the bones, from `shift` on, for them to have room in it; false where they have.
bool FindShift(const Chain& chain, const Ring& ring, float place, const float* shift, float* further) {
  Axis axis;
  if (!ring.judged || !AxisAt(chain, place, &axis)) return false;
  Outline outline = {};
  for (size_t k = 0; k < kCorners; ++k) {
    if (ring.counts[k] == 0) continue;
    float away[3];
    for (size_t c = 0; c < 3; ++c) away[c] = ring.corners[k][c] + shift[c] - axis.at[c];
    for (size_t i = 0; i < 2; ++i) outline.points[outline.count][i] = Dot(away, axis.across[i]);
    ++outline.count;
  }
  float offset[2] = {}, nearest[2] = {};
  bool any = false;
  for (int step = 0; step < kShiftSteps; ++step) {
    const float inside = DistanceInside(outline, offset, nearest), lacks = kRoom * chain.upper->scale - inside;
    if (!(lacks > 0) || inside == 0) break;
    any = true;
    for (size_t i = 0; i < 2; ++i) offset[i] += kShiftPart * lacks / inside * nearest[i];
  }
  for (size_t c = 0; c < 3; ++c) further[c] = offset[0] * axis.across[0][c] + offset[1] * axis.across[1][c];
  return any;
}

// The shift of each ring, [kRings, 3]; a ring takes those beside it along, less and less. False where none shifts.
bool FindShifts(const Chain& chain, const Ring* rings, float (*shifts)[3]) {
  bool any = false;
  for (int round = 0; round < kShiftRounds; ++round) {
    for (size_t r = 0; r < kRings; ++r) {
      float further[3];
      if (!FindShift(chain, rings[r], MiddleOf(chain, r) + rings[r].slide, shifts[r], further)) continue;
      any = true;
      for (size_t k = 0; k < kRings; ++k) {
        const size_t apart = k < r ? r - k : k - r;
        if (apart >= kShifted) continue;
        for (size_t c = 0; c < 3; ++c)
          shifts[k][c] += (1 - static_cast<float>(apart) / static_cast<float>(kShifted)) * further[c];
      }
    }
  }
  return any;
}

// Before the first ring that is kept a shoulder may have drawn the cloth off the bones.
void LeaveShoulder(Ring* rings) {
  for (size_t r = 0; r < kRings && !rings[r].kept; ++r) {
    rings[r].judged = false;
    rings[r].lost = 0;
  }
}

// values[r] becomes the sum of all, each less by kNear for each ring between.
void SumNear(float* values) {
  float before[kRings], sum = 0;
  for (size_t r = 0; r < kRings; ++r) before[r] = sum = kNear * sum + values[r];
  sum = 0;
  for (size_t r = kRings; r-- > 0;) {
    const float own = values[r];
    values[r] = before[r] + kNear * sum;
    sum = kNear * sum + own;
  }
}

// Less as a ring gets lost: so nothing jumps when it is no longer kept.
float TrustIn(const Ring& ring) { return ring.kept ? Larger(1 - ring.lost, kLeastTrust) : 0.0f; }

// How far rings that are kept slid tells how far all did, the nearer the more.
void FillSlides(Ring* rings) {
  float slides[kRings], trust[kRings];
  for (size_t r = 0; r < kRings; ++r) {
    trust[r] = TrustIn(rings[r]);
    slides[r] = trust[r] * rings[r].slide;
  }
  SumNear(slides);
  SumNear(trust);
  for (size_t r = 0; r < kRings; ++r) rings[r].slide = trust[r] > 0 ? slides[r] / trust[r] : 0.0f;
}

// How they are turned, likewise.
void FillTurns(Ring* rings) {
  float cosines[kRings], sines[kRings], counts[kRings];
  for (size_t r = 0; r < kRings; ++r) {
    const float trust = TrustIn(rings[r]);
    cosines[r] = trust * rings[r].cosine;
    sines[r] = trust * rings[r].sine;
    counts[r] = trust * rings[r].turned;
  }
  for (float* values : {cosines, sines, counts}) SumNear(values);
  for (size_t r = 0; r < kRings; ++r) {
    rings[r].cosine = 1;
    rings[r].sine = 0;
    if (!(counts[r] > 0)) continue;
    const float length = std::sqrt(cosines[r] * cosines[r] + sines[r] * sines[r]);
    const float sure = Clamped((length / counts[r] - kUnsure) / (kSure - kUnsure));
    if (!(sure > 0)) continue;
    rings[r].cosine = sure * cosines[r] / length + 1 - sure;
    rings[r].sine = sure * sines[r] / length;
  }
}

// A ring at a place between the middles of two.
struct Between {
  float slide, cosine, sine, lost;
};

Between RingAt(const Chain& chain, const Ring* rings, float place) {
  const float at = Clamped(RingOf(chain, place) - 0.5f, kRings - 1.001f);
  const auto first = static_cast<size_t>(at);
  const float share = at - static_cast<float>(first);
  const Ring &a = rings[first], &b = rings[first + 1];
  return {a.slide + share * (b.slide - a.slide), a.cosine + share * (b.cosine - a.cosine),
          a.sine + share * (b.sine - a.sine), a.lost + share * (b.lost - a.lost)};
}

// Fills in `rings` as they lie, and `begin`, where the sleeve does.
void MeasureRings(const ModelView& model, const Chain& chain, const Sleeves& sleeves, const Surface& surface,
                  Ring* rings, float* begin) {
  for (size_t r = 0; r < kRings; ++r) rings[r] = {};
  *begin = chain.lower_length;
  VisitSleeve(model, sleeves, chain, surface, [&](size_t v, const float* bound, float place, const float* position) {
    *begin = place < *begin ? place : *begin;
    Ring* ring = &rings[static_cast<size_t>(RingOf(chain, place))];
    const LimbCore& core = sleeves.cores[v] == chain.upper_core ? *chain.upper : *chain.lower;
    const float relative[3] = {bound[0] - core.from[0], bound[1] - core.from[1], bound[2] - core.from[2]};
    const size_t corner = CornerAt(Dot(relative, core.around[0]), Dot(relative, core.around[1]));
    for (size_t c = 0; c < 3; ++c) ring->corners[corner][c] += position[c];
    ++ring->counts[corner];
  });
  for (size_t r = 0; r < kRings; ++r) Judge(chain, MiddleOf(chain, r), &rings[r]);
  LeaveShoulder(rings);
  for (size_t r = 1; r < kRings; ++r) {
    const bool end = rings[r].judged && (r + kEnd >= kRings || !rings[r + kEnd].judged);
    rings[r].lost = Larger(rings[r].lost, rings[r - 1].lost - (end ? 0.0f : kStep));
  }
  for (size_t r = kRings - 1; r-- > 0;) rings[r].lost = Larger(rings[r].lost, rings[r + 1].lost - kStep);
}

// Rings whose edge the limb is near, or outside of, shift across it as they are. Returns whether any does.
bool ShiftRings(const ModelView& model, const Chain& chain, const Sleeves& sleeves, const Ring* rings, float begin,
                const Surface& surface) {
  Ring filled[kRings];
  for (size_t r = 0; r < kRings; ++r) filled[r] = rings[r];
  FillSlides(filled);
  float shifts[kRings][3] = {};
  if (!FindShifts(chain, filled, shifts)) return false;
  VisitSleeve(model, sleeves, chain, surface, [&](size_t, const float*, float place, float* position) {
    const float at = Clamped(RingOf(chain, place) - 0.5f, kRings - 1.001f);
    const auto first = static_cast<size_t>(at);
    const float share = at - static_cast<float>(first), part = chain.shifted * Clamped((place - begin) / kFade);
    for (size_t c = 0; c < 3; ++c)
      position[c] += part * (shifts[first][c] + share * (shifts[first + 1][c] - shifts[first][c]));
  });
  return true;
}

// What is lost of `rings`, and how the others lie; false where the limb goes well through all of them.
bool FindLost(const ModelView& model, const Chain& chain, const Sleeves& sleeves, const Surface& surface, float begin,
              Ring* rings) {
  bool lost = false;
  for (size_t r = 0; r < kRings; ++r) lost |= rings[r].lost > 0;
  if (!lost) return false;
  FillSlides(rings);
  for (size_t r = 0; r < kRings; ++r) rings[r].lost *= Clamped((MiddleOf(chain, r) - begin) / kFade);
  VisitSleeve(model, sleeves, chain, surface, [&](size_t, const float* bound, float place, const float* position) {
    Ring* ring = &rings[static_cast<size_t>(RingOf(chain, place))];
    Axis axis;
    float x, y, apart;
    if (!ring->kept || !AxisAt(chain, place + RingAt(chain, rings, place).slide, &axis)) return;
    if (!OwnSideOf(chain, axis, bound, &x, &y, &apart)) return;
    const float away[3] = {position[0] - axis.at[0], position[1] - axis.at[1], position[2] - axis.at[2]};
    const float u = Dot(away, axis.across[0]), w = Dot(away, axis.across[1]), length = std::sqrt(u * u + w * w);
    if (!(length > 0)) return;
    ring->cosine += (x * u + y * w) / length;
    ring->sine += (x * w - y * u) / length;
    ring->turned += 1;
  });
  FillTurns(rings);
  return true;
}

// Of the skin around a bone, the thickest.
float ThicknessAt(const LimbCore& core, float along) {
  float widest = 0;
  for (const float radius : core.radii[static_cast<size_t>(Clamped(along) * (kCoreSlices - 1))])
    widest = Larger(widest, radius);
  return widest / kCoreOfFree;
}

// Where a vertex lies close around the limb, as its ring is turned; false where that has no place.
bool SnugPlace(const Chain& chain, const Between& ring, const float* bound, float place, float* out) {
  Axis axis;
  float x, y, apart;
  const float turn = std::sqrt(ring.cosine * ring.cosine + ring.sine * ring.sine);
  if (!(turn > 0) || !AxisAt(chain, place, &axis) || !OwnSideOf(chain, axis, bound, &x, &y, &apart)) return false;
  const float u = (ring.cosine * x - ring.sine * y) / turn, w = (ring.sine * x + ring.cosine * y) / turn;
  const float least = kSnug + (1 - axis.share) * ThicknessAt(*chain.upper, 1 + place / chain.upper_length) +
                      axis.share * ThicknessAt(*chain.lower, place / chain.lower_length);
  const float height = chain.upper->scale * (least + (apart > least ? kSlack * (apart - least) : 0.0f));
  for (size_t c = 0; c < 3; ++c) out[c] = axis.at[c] + height * (u * axis.across[0][c] + w * axis.across[1][c]);
  return true;
}

// Limbs bent far go into each other on the inner side of their hinge: up to the plane that halves its angle each is
// itself. Unit vectors: through the plane to the lower limb's side; and in it, away from the hinge between the limbs.
struct Crease {
  float through[3], out[3];
};

// False where the limbs are straight, or folded flat.
bool FindCrease(const Chain& chain, Crease* crease) {
  float first[3], second[3];
  for (size_t c = 0; c < 3; ++c) first[c] = chain.upper->along[c], second[c] = chain.lower->along[c];
  if (!Normalize(first, 0) || !Normalize(second, 0)) return false;
  for (size_t c = 0; c < 3; ++c) {
    crease->through[c] = second[c] + first[c];
    crease->out[c] = second[c] - first[c];
  }
  return Normalize(crease->through, kNoHinge) && Normalize(crease->out, kNoHinge);
}

bool IsUnderSkin(const LimbCore& core, const float* point) {
  const OnBone on = PlaceOnBone(core.posed_from, core.along, core.inverse_squared, point);
  float away[3], radius;
  if (!(on.along > 0)) return false;
  IsInCore(core, on, away, &radius);
  const float height = radius / kCoreOfFree + kPressed * core.scale;
  return radius > 0 && on.squared < height * height;
}

// What belongs `place` along the limbs, and came through the plane into the other one, goes back to it and along it out
// of both: there the cloth around them is pressed together.
void PressIntoCrease(const Chain& chain, const Crease& crease, float place, float* position) {
  const float* hinge = chain.lower->posed_from;
  const float away[3] = {position[0] - hinge[0], position[1] - hinge[1], position[2] - hinge[2]};
  const float beyond = Dot(away, crease.through);
  if (!(Dot(away, crease.out) > 0 && (place < 0 ? beyond : -beyond) > 0)) return;
  const auto put = [&](float along, float* at) {
    for (size_t c = 0; c < 3; ++c) at[c] = hinge[c] + away[c] - beyond * crease.through[c] + along * crease.out[c];
  };
  float inside = 0, outside = kFurthestOut * chain.upper->scale;
  for (int step = 0; step < kHalvings; ++step) {
    const float middle = 0.5f * (inside + outside);
    float at[3];
    put(middle, at);
    (IsUnderSkin(*chain.upper, at) || IsUnderSkin(*chain.lower, at) ? inside : outside) = middle;
  }
  put(outside, position);
}

}  // namespace

Sleeves PlaceSleeves(const ModelView& model, Arena* arena) { return {arena->Take<uint8_t>(model.vertex_count)}; }

void FindSleeves(const ModelView& model, const LimbCores& limbs, const Sleeves& sleeves) {
  uint8_t sectors[kMostCores][kCoreSlices] = {};
  const auto sectors_at = [&](size_t v, const OnBone& on) {
    return &sectors[sleeves.cores[v]][SliceAt(Clamped(on.along))];
  };
  for (size_t v = 0; v < model.vertex_count; ++v) {
    OnBone nearest = {};
    nearest.squared = kAround * kAround;
    uint32_t at = kMostCores;
    for (uint32_t k = 0; k < *limbs.count; ++k) {
      const OnBone on = InBindPose(limbs.cores[k], model.template_positions + 3 * v);
      if (on.squared < nearest.squared) nearest = on, at = k;
    }
    sleeves.cores[v] = kNoSleeve;
    if (at == kMostCores || !limbs.cores[at].bends) continue;
    if (limbs.cores[at].above == kMostCores && nearest.along < kBegin) continue;
    sleeves.cores[v] = static_cast<uint8_t>(at);
    *sectors_at(v, nearest) |= static_cast<uint8_t>(1u << SectorAt(limbs.cores[at].around, nearest.away));
  }
  for (uint32_t k = 0; k < *limbs.count; ++k) limbs.cores[k].in_sleeve = false;
  for (size_t v = 0; v < model.vertex_count; ++v) {
    if (sleeves.cores[v] == kNoSleeve) continue;
    const OnBone on = InBindPose(limbs.cores[sleeves.cores[v]], model.template_positions + 3 * v);
    if (*sectors_at(v, on) == 0xFF) {
      limbs.cores[sleeves.cores[v]].in_sleeve = true;
    } else {
      sleeves.cores[v] = kNoSleeve;
    }
  }
}

void ThreadSleeves(const ModelView& model, const LimbCores& limbs, const Sleeves& sleeves, const Surface& surface) {
  for (uint32_t upper = 0; upper < *limbs.count; ++upper) {
    const LimbCore& first = limbs.cores[upper];
    if (first.above != kMostCores || first.below == kMostCores) continue;
    const Chain chain = ChainOf(limbs, upper);
    if (!(first.scale > 0)) continue;
    Ring rings[kRings];
    float begin;
    MeasureRings(model, chain, sleeves, surface, rings, &begin);
    if (chain.shifted > 0 && ShiftRings(model, chain, sleeves, rings, begin, surface))
      MeasureRings(model, chain, sleeves, surface, rings, &begin);
    if (!FindLost(model, chain, sleeves, surface, begin, rings)) continue;
    Crease crease = {};
    const bool bent = FindCrease(chain, &crease);
    VisitSleeve(model, sleeves, chain, surface, [&](size_t, const float* bound, float place, float* position) {
      float snug[3];
      const Between ring = RingAt(chain, rings, place);
      if (!(ring.lost > 0) || !SnugPlace(chain, ring, bound, place + ring.slide, snug)) return;
      if (bent) PressIntoCrease(chain, crease, place + ring.slide, snug);
      for (size_t c = 0; c < 3; ++c) position[c] += ring.lost * (snug[c] - position[c]);
    });
  }
}

}  // namespace dcloth::engine

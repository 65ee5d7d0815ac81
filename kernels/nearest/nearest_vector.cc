// Lanes are balls around runs of four points, then points, or groups where a box is held against many
// (nearest_boxes-inl.h). A ball is cleared where nothing of the surface lies in it and its middle is outside: one
// look for four points. Of the bundled skirt 95 in 100 are; points of the others are closed up and looked at alone.
// A block of a few vectors looks into the group nearest to it, then into those around that may still matter to any.
// That asks how near alone; which sites they were is asked again for the few blocks that have a suspect. Rejected,
// by time or by counted looks on the bundled skirt: to clear a ball only where no site is a suspect of any point
// within, which looks into half as many groups again and clears 93 of 100, of the robe's sleeves 29; spheres in
// place of boxes (a third more groups are looked into); blocks along the mesh's own order (a quarter more); balls
// around eight points (41 % cleared); groups of eight sites; lanes that are sites of a group, for each ball the
// groups near it alone; for a point of a ball the ball's nearest site as a first bound; to rule sites out one by one
// as groups are; minima of bits as integers; to ask first whether any group may hold a suspect, by a cone or a box
// around its normals or by heights over its planes (six groups in seven may); bounds copied together for each list.
// And a descent along the body's edges from a stored start, which stays on its limb (NETWORK.md, "Contact").
#include "kernels/nearest/nearest.h"
#include "kernels/simd.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/nearest/nearest_vector.cc"
#include "hwy/foreach_target.h"
#include "hwy/highway.h"
#include "kernels/multiply_add-inl.h"
#include "kernels/nearest/nearest_boxes-inl.h"

#if DCLOTH_VECTOR_TARGET
HWY_BEFORE_NAMESPACE();
namespace dcloth::kernels::HWY_NAMESPACE {
namespace {

constexpr size_t kRun = 4;  // points of a ball
constexpr size_t kBalls = kNearestPatch / kRun;
constexpr float kNoSuspect = 3e38f;
constexpr float kMiddleRounding = 1e-6f;  // of the sum of coordinates
// Of a block. A site is loaded once for all, but the more balls, the more groups are around them.
constexpr size_t kVectors = hn::MaxLanes(d) < kMaxLanes ? 2 : 1;
constexpr bool kMasksAreRegisters = hn::MaxLanes(d) == kMaxLanes;

// The points of a run lie kBalls apart: lanes are runs.
struct Points {
  HWY_ALIGN float at[3][kRun * kBalls];
};

HWY_INLINE void LoadPoints(const NearestJob& job, Points* points) {
  for (size_t i = 0; i < kNearestPatch; ++i) {
    const size_t p = job.order[i < job.points_count ? i : job.points_count - 1];
    const auto* bytes = reinterpret_cast<const char*>(job.points) + p * job.point_stride_bytes;
    const auto* point = reinterpret_cast<const float*>(bytes);
    for (size_t c = 0; c < 3; ++c) points->at[c][i % kRun * kBalls + i / kRun] = point[c];
  }
}

// As many balls as fill a few vectors; points, which go alone, are balls of no radius.
struct Block {
  V x[kVectors], y[kVectors], z[kVectors], radius[kVectors];
  // Squared distances, less slack^2 for an excess, of suspects and of all sites.
  V nearest_squared[kVectors], suspect_excess[kVectors], least_excess[kVectors];
};

HWY_INLINE V Square(V x) { return hn::Mul(x, x); }

HWY_INLINE size_t BlockSize() { return kVectors * hn::Lanes(d); }

struct Site {
  const float* at;
  HWY_INLINE V All(size_t row) const { return hn::Set(d, at[row * kNearestGroup]); }
};

HWY_INLINE Site FirstSite(const NearestJob& job, size_t group) {
  return {job.sites + GroupPlace(job, group) * kNearestSiteFloats * kNearestGroup};
}

// The excess where a site is suspect. A blend costs less where masks are registers, a maximum elsewhere; an excess
// below 0 may count as 0, which no nearest site is below either.
HWY_INLINE V OfSuspect(hn::Mask<decltype(d)> clear, V excess) {
  const V none = hn::Set(d, kNoSuspect);
  if (kMasksAreRegisters) return hn::IfThenElse(clear, none, excess);
  return hn::Max(excess, hn::And(hn::VecFromMask(d, clear), none));
}

// How near, not which; the least excess of all sites for balls alone. What is found stays in variables of its own:
// in an array the compiler keeps it in memory, and each site waits for the one before.
template <bool kOfBalls>
HWY_INLINE void LookInto(const NearestJob& job, size_t group, Block* block) {
  constexpr size_t kLast = kVectors - 1;
  static_assert(kVectors <= 2, "");
  V nearest0 = block->nearest_squared[0], nearest1 = block->nearest_squared[kLast];
  V suspect0 = block->suspect_excess[0], suspect1 = block->suspect_excess[kLast];
  V least0 = block->least_excess[0], least1 = block->least_excess[kLast];
  Site site = FirstSite(job, group);
  for (size_t k = 0; k < kNearestGroup; ++k, ++site.at) {
    const auto look = [&](size_t v, V* nearest, V* suspect, V* least) {
      const V x = block->x[v], y = block->y[v], z = block->z[v];
      const V squared = SquaredLength(hn::Sub(x, site.All(0)), hn::Sub(y, site.All(1)), hn::Sub(z, site.All(2)));
      const V height = MultiplyAdd(site.All(3), x, MultiplyAdd(site.All(4), y, hn::Mul(site.All(5), z)));
      const V excess = hn::Sub(squared, site.All(7));
      *nearest = hn::Min(squared, *nearest);
      *suspect = hn::Min(OfSuspect(hn::Ge(height, site.All(6)), excess), *suspect);
      if (kOfBalls) *least = hn::Min(excess, *least);
    };
    look(0, &nearest0, &suspect0, &least0);
    if (kVectors == 2) look(kLast, &nearest1, &suspect1, &least1);
  }
  block->nearest_squared[0] = nearest0;
  block->suspect_excess[0] = suspect0;
  block->least_excess[0] = least0;
  if (kVectors == 1) return;
  block->nearest_squared[kLast] = nearest1;
  block->suspect_excess[kLast] = suspect1;
  block->least_excess[kLast] = least1;
}

// What the excess of suspects of points in a ball is at most, taken from its middle: the nearest site of a point is at
// most a = (the middle's nearest + radius) away, a suspect sqrt(a^2 + slack^2), and from the middle a radius more.
// Those of the middle itself would do for a surface that nowhere cuts itself; where limbs sink into each other, the
// middle may be outside one and a point inside the other. `most_slack` is squared. Rounded up.
HWY_INLINE V MostExcess(const Block& block, size_t v, float most_slack) {
  const V radius = block.radius[v], slack = hn::Set(d, most_slack);
  const V near = hn::Add(hn::Sqrt(block.nearest_squared[v]), radius), squared = hn::Mul(near, near);
  const V far = hn::Sqrt(hn::Add(squared, slack));
  const V most = MultiplyAdd(radius, hn::Add(radius, hn::Add(far, far)), squared);
  return MultiplyAdd(most, hn::Set(d, kMore), hn::Mul(slack, hn::Set(d, kMore - 1)));
}

// Whether the group may hold sites within sqrt(`squared` + slack^2) of any ball's middle.
HWY_INLINE bool MayMatter(const Boxes& boxes, size_t group, const Block& block, const V* squared) {
  const auto all = [&](size_t row) { return boxes.All(row, group); };
  const V slack = hn::Mul(all(kSlack), hn::Set(d, kMore));
  V beyond = hn::Set(d, kNoSuspect);
  for (size_t v = 0; v < kVectors; ++v) {
    const V x = Gap(all(kLow), all(kHigh), block.x[v], block.x[v]);
    const V y = Gap(all(kLow + 1), all(kHigh + 1), block.y[v], block.y[v]);
    const V z = Gap(all(kLow + 2), all(kHigh + 2), block.z[v], block.z[v]);
    const V bound = MultiplyAdd(squared[v], hn::Set(d, kMore), slack);
    beyond = hn::Min(hn::Sub(SquaredLength(x, y, z), bound), beyond);
  }
  return !hn::AllFalse(d, hn::Le(beyond, hn::Zero(d)));
}

// Sites as floats, exact up to 2^24; -1 for none.
struct Found {
  V nearest_squared, suspect_excess, nearest, suspect;
};

HWY_INLINE void LookFor(const NearestJob& job, size_t group, const Block& block, size_t v, Found* found) {
  V index = hn::Set(d, static_cast<float>(GroupPlace(job, group) * kNearestGroup));
  Site site = FirstSite(job, group);
  for (size_t k = 0; k < kNearestGroup; ++k, ++site.at) {
    const V x = block.x[v], y = block.y[v], z = block.z[v];
    const V squared = SquaredLength(hn::Sub(x, site.All(0)), hn::Sub(y, site.All(1)), hn::Sub(z, site.All(2)));
    const V height = MultiplyAdd(site.All(3), x, MultiplyAdd(site.All(4), y, hn::Mul(site.All(5), z)));
    const V excess = hn::Sub(squared, site.All(7));
    const auto nearer = hn::Lt(squared, found->nearest_squared);
    const auto suspicious = hn::And(hn::Lt(height, site.All(6)), hn::Lt(excess, found->suspect_excess));
    found->nearest_squared = hn::IfThenElse(nearer, squared, found->nearest_squared);
    found->nearest = hn::IfThenElse(nearer, index, found->nearest);
    found->suspect_excess = hn::IfThenElse(suspicious, excess, found->suspect_excess);
    found->suspect = hn::IfThenElse(suspicious, index, found->suspect);
    index = hn::Add(index, hn::Set(d, 1.0f));
  }
}

// Which sites, for the `points` in vector `v` of `block`, in the groups `around`.
HWY_INLINE void Resolve(const NearestJob& job, const List& around, const Block& block, size_t v, const uint8_t* points,
                        size_t count) {
  const V none = hn::Set(d, -1.0f);
  Found found = {hn::Set(d, job.reach * job.reach), hn::Set(d, kNoSuspect), none, none};
  for (size_t i = 0; i < around.count; ++i) LookFor(job, around.groups[i], block, v, &found);
  CountLooks(job, around.count * hn::Lanes(d));
  const auto near_enough = hn::Le(found.suspect_excess, found.nearest_squared);
  const auto suspicious = hn::And(near_enough, hn::Ge(found.nearest, hn::Zero(d)));
  HWY_ALIGN float nearest[kMaxLanes], suspect[kMaxLanes];
  hn::Store(found.nearest, d, nearest);
  hn::Store(hn::IfThenElse(suspicious, found.suspect, none), d, suspect);
  for (size_t k = 0; k < count; ++k) {
    if (!(suspect[k] >= 0)) continue;
    job.nearest[points[k]] = static_cast<uint16_t>(nearest[k]);
    job.suspect[points[k]] = static_cast<uint16_t>(suspect[k]);
  }
}

// Looks into those of `from` that may matter, but for `first`.
template <bool kOfBalls>
HWY_INLINE void LookAround(const NearestJob& job, const List& from, size_t first, const V* most_excess, Block* block,
                           List* around) {
  const Boxes boxes = BoxesOf(job);
  around->count = 0;
  for (size_t i = 0; i < from.count; ++i) {
    around->groups[around->count] = from.groups[i];
    around->count += MayMatter(boxes, from.groups[i], *block, most_excess) ? 1 : 0;
  }
  for (size_t i = 0; i < around->count; ++i) {
    if (around->groups[i] != first) LookInto<kOfBalls>(job, around->groups[i], block);
  }
  CountLooks(job, (around->count + 1) * BlockSize());
}

// The points in need of a look of their own, and which of the patch they are.
struct Rest {
  HWY_ALIGN float at[3][kNearestPatch];
  uint8_t points[kNearestPatch];
  size_t count;
};

// The group of `list` whose box' middle is nearest to a point.
HWY_INLINE size_t NearestMiddle(const NearestJob& job, const List& list, const float point[3]) {
  const Boxes boxes = BoxesOf(job);
  size_t nearest = list.groups[0];
  float least = 3e38f;
  for (size_t i = 0; i < list.count; ++i) {
    const float* bounds = boxes.rows + list.groups[i];
    float squared = 0;
    for (size_t c = 0; c < 3; ++c) {
      const float twice = 2 * point[c] - bounds[(kLow + c) * boxes.stride] - bounds[(kHigh + c) * boxes.stride];
      squared += twice * twice;
    }
    if (squared < least) {
      least = squared;
      nearest = list.groups[i];
    }
  }
  return nearest;
}

HWY_INLINE void SearchPoints(const NearestJob& job, const List& list, size_t begin, const Rest& rest) {
  const size_t lanes = hn::Lanes(d);
  Block block;
  for (size_t v = 0; v < kVectors; ++v) {
    block.x[v] = hn::Load(d, rest.at[0] + begin + v * lanes);
    block.y[v] = hn::Load(d, rest.at[1] + begin + v * lanes);
    block.z[v] = hn::Load(d, rest.at[2] + begin + v * lanes);
    block.radius[v] = hn::Zero(d);
    block.nearest_squared[v] = hn::Set(d, job.reach * job.reach);
    block.suspect_excess[v] = block.least_excess[v] = hn::Set(d, kNoSuspect);
  }
  const float point[3] = {rest.at[0][begin], rest.at[1][begin], rest.at[2][begin]};
  const size_t first = NearestMiddle(job, list, point);
  LookInto<false>(job, first, &block);
  List around;
  LookAround<false>(job, list, first, block.nearest_squared, &block, &around);
  for (size_t v = 0; v < kVectors && begin + v * lanes < rest.count; ++v) {
    if (hn::AllFalse(d, hn::Le(block.suspect_excess[v], block.nearest_squared[v]))) continue;
    const size_t from = begin + v * lanes, left = rest.count - from;
    Resolve(job, around, block, v, rest.points + from, left < lanes ? left : lanes);
  }
}

// The balls around runs of points from run `begin` on, larger by what their middles may be off. Returns the box around
// the points.
HWY_INLINE Box PlaceBalls(const NearestJob& job, const Points& points, size_t begin, Block* block) {
  Box box;
  for (size_t v = 0; v < kVectors; ++v) {
    const size_t at = begin + v * hn::Lanes(d);
    V middle[3], squared[kRun];
    for (size_t i = 0; i < kRun; ++i) squared[i] = hn::Zero(d);
    for (size_t c = 0; c < 3; ++c) {
      V low = hn::Load(d, points.at[c] + at), high = low;
      for (size_t i = 1; i < kRun; ++i) {
        const V p = hn::Load(d, points.at[c] + i * kBalls + at);
        low = hn::Min(low, p);
        high = hn::Max(high, p);
      }
      middle[c] = hn::Mul(hn::Add(low, high), hn::Set(d, 0.5f));
      for (size_t i = 0; i < kRun; ++i) {
        const V apart = hn::Sub(hn::Load(d, points.at[c] + i * kBalls + at), middle[c]);
        squared[i] = MultiplyAdd(apart, apart, squared[i]);
      }
      box.low[c] = v == 0 ? low : hn::Min(box.low[c], low);
      box.high[c] = v == 0 ? high : hn::Max(box.high[c], high);
    }
    const V radius = hn::Sqrt(hn::Max(hn::Max(squared[0], squared[1]), hn::Max(squared[2], squared[3])));
    const V size = hn::Add(hn::Add(hn::Abs(middle[0]), hn::Abs(middle[1])), hn::Abs(middle[2]));
    block->x[v] = middle[0];
    block->y[v] = middle[1];
    block->z[v] = middle[2];
    block->radius[v] = MultiplyAdd(radius, hn::Set(d, kMore), hn::Mul(size, hn::Set(d, kMiddleRounding)));
    block->nearest_squared[v] = Square(hn::Add(hn::Set(d, job.reach), block->radius[v]));
    block->suspect_excess[v] = block->least_excess[v] = hn::Set(d, kNoSuspect);
  }
  for (size_t c = 0; c < 3; ++c) {
    box.low[c] = hn::MinOfLanes(d, box.low[c]);
    box.high[c] = hn::MaxOfLanes(d, box.high[c]);
  }
  return box;
}

HWY_INLINE void TakePoints(const NearestJob& job, const Points& points, size_t ball, Rest* rest) {
  for (size_t i = 0; i < kRun && ball * kRun + i < job.points_count; ++i) {
    for (size_t c = 0; c < 3; ++c) rest->at[c][rest->count] = points.at[c][i * kBalls + ball];
    rest->points[rest->count++] = static_cast<uint8_t>(ball * kRun + i);
  }
}

HWY_INLINE void SearchBalls(const NearestJob& job, const Points& points, size_t begin) {
  const Boxes boxes = BoxesOf(job);
  Block block;
  const Box box = PlaceBalls(job, points, begin, &block);
  const size_t first = NearestBox(boxes, box);
  LookInto<true>(job, first, &block);
  V nearest_squared[kVectors], widest = hn::Zero(d);
  for (size_t v = 0; v < kVectors; ++v) {
    nearest_squared[v] = block.nearest_squared[v];
    widest = hn::Max(Square(hn::Add(hn::Sqrt(nearest_squared[v]), block.radius[v])), widest);
  }
  List list, around;
  const float most_slack = ListWithin(boxes, hn::GetLane(hn::MaxOfLanes(d, widest)), box, &list);
  LookAround<true>(job, list, first, nearest_squared, &block, &around);
  Rest rest;
  rest.count = 0;
  for (size_t v = 0; v < kVectors; ++v) {
    const V free_squared = Square(hn::Add(block.radius[v], hn::Set(d, job.clearance)));
    const V free = MultiplyAdd(free_squared, hn::Set(d, kMore), hn::Set(d, most_slack * (kMore - 1)));
    const auto near_surface = hn::Le(block.least_excess[v], free);
    const auto middle_in_doubt = hn::Le(block.suspect_excess[v], MostExcess(block, v, most_slack));
    uint32_t left = Bits(hn::Or(middle_in_doubt, near_surface));
    for (; left != 0; left &= left - 1)
      TakePoints(job, points, begin + v * hn::Lanes(d) + hwy::Num0BitsBelowLS1Bit_Nonzero32(left), &rest);
  }
  if (rest.count == 0 || list.count == 0) return;
  for (size_t i = rest.count; i % BlockSize() != 0; ++i) {
    for (size_t c = 0; c < 3; ++c) rest.at[c][i] = rest.at[c][rest.count - 1];
  }
  for (size_t i = 0; i < rest.count; i += BlockSize()) SearchPoints(job, list, i, rest);
}

}  // namespace

void Nearest(const NearestJob& job) {
  Points points;
  LoadPoints(job, &points);
  for (size_t i = 0; i < job.points_count; ++i) job.nearest[i] = job.suspect[i] = kNoSite;
  for (size_t ball = 0; ball * kRun < job.points_count; ball += BlockSize()) SearchBalls(job, points, ball);
}

}  // namespace dcloth::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif  // DCLOTH_VECTOR_TARGET

// Lanes are points, or groups where a box is held against many. The patch's box leaves a list of the groups that may
// hold its points' nearest sites or suspects; a block of two vectors of points looks into the group nearest to one of
// them, then into those of the list that may still matter to any. That asks how near alone; which sites they were is
// asked again for the few blocks that have a suspect. Rejected, by time or by counted looks on the bundled skirt:
// spheres in place of boxes (a third more groups are looked into); blocks along the mesh's own order (a quarter more);
// a shorter list for each block; groups of eight sites; to rule sites out one by one as groups are; minima of bits as
// integers; to ask first whether any group may hold a suspect, by a cone or a box around its normals; Highway's
// CompressStore, whose table is copied to the stack in every call. And a descent along the body's edges from a stored
// start, which stays on the limb it starts from (NETWORK.md, "Penetration").
#include "kernels/nearest/nearest.h"
#include "kernels/simd.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/nearest/nearest_vector.cc"
#include "hwy/foreach_target.h"
#include "hwy/highway.h"
#include "kernels/multiply_add-inl.h"

#if DCLOTH_VECTOR_TARGET
HWY_BEFORE_NAMESPACE();
namespace dcloth::kernels::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

constexpr size_t kMaxLanes = 16;
constexpr size_t kVectors = 2;      // of a block: sites and boxes are loaded once for both
constexpr size_t kMostListed = 64;  // groups that a patch has a list of its own for: the skirt's have 21 on average
constexpr float kMore = 1.00001f;   // for the rounding of a difference of squares
constexpr float kNoSuspect = 3e38f;

const hn::CappedTag<float, kMaxLanes> d;
using V = hn::Vec<decltype(d)>;

HWY_INLINE V SquaredLength(V x, V y, V z) { return MultiplyAdd(x, x, MultiplyAdd(y, y, hn::Mul(z, z))); }

// Boxes of groups by the row.
struct Boxes {
  const float* rows;  // as in NearestJob::bounds, padding up to a multiple of the lanes
  size_t stride, count;
  const uint16_t* groups;  // which they are, or null where they are all
  HWY_INLINE V At(size_t row, size_t box) const { return hn::LoadU(d, rows + row * stride + box); }
  HWY_INLINE V All(size_t row, size_t box) const { return hn::Set(d, rows[row * stride + box]); }
  HWY_INLINE size_t Group(size_t box) const { return groups != nullptr ? groups[box] : box; }
};

struct Box {
  V low[3], high[3];
};

// Between the ranges [low, high] and [from, to].
HWY_INLINE V Gap(V low, V high, V from, V to) {
  return hn::Max(hn::Max(hn::Sub(low, to), hn::Sub(from, high)), hn::Zero(d));
}
HWY_INLINE V Span(V low, V high, V from, V to) { return hn::Max(hn::Sub(high, from), hn::Sub(to, low)); }

// Of any point of `box` from any site of the boxes from `at` on: at least, at most. Squared.
HWY_INLINE V Least(const Boxes& boxes, size_t at, const Box& box) {
  V gap[3];
  for (size_t c = 0; c < 3; ++c)
    gap[c] = Gap(boxes.At(kLow + c, at), boxes.At(kHigh + c, at), box.low[c], box.high[c]);
  return SquaredLength(gap[0], gap[1], gap[2]);
}
HWY_INLINE V Most(const Boxes& boxes, size_t at, const Box& box) {
  V span[3];
  for (size_t c = 0; c < 3; ++c)
    span[c] = Span(boxes.At(kLow + c, at), boxes.At(kHigh + c, at), box.low[c], box.high[c]);
  return SquaredLength(span[0], span[1], span[2]);
}

// Of the points of `box` no nearest site is further than sqrt(`squared`), as it is no further than all of `nearest`.
struct Bound {
  float squared;
  size_t nearest;
};
HWY_INLINE Bound NearestBox(const Boxes& boxes, const Box& box) {
  V least = hn::Set(d, 3e38f), first = hn::Zero(d), index = hn::Iota(d, 0.0f);
  const V step = hn::Set(d, static_cast<float>(hn::Lanes(d)));
  for (size_t at = 0; at < boxes.count; at += hn::Lanes(d)) {
    const V most = Most(boxes, at, box);
    first = hn::IfThenElse(hn::Lt(most, least), index, first);
    least = hn::Min(most, least);
    index = hn::Add(index, step);
  }
  const V best = hn::MinOfLanes(d, least);
  const V candidates = hn::IfThenElse(hn::Eq(least, best), first, hn::Set(d, 1e9f));
  const float found = hn::GetLane(hn::MinOfLanes(d, candidates));
  return {hn::GetLane(best), found < static_cast<float>(boxes.count) ? static_cast<size_t>(found) : 0};
}

struct List {
  HWY_ALIGN float rows[kNearestBounds * kMostListed];
  uint16_t groups[kMostListed];
};

// The boxes that may matter to points of `box`, or all of them where they are many.
HWY_INLINE Boxes BoxesAround(const NearestJob& job, const Box& box, List* list) {
  const size_t stride = NearestBoundStride(job.groups);
  const Boxes all = {job.bounds, stride, job.groups, nullptr};
  const float reach = job.reach * job.reach, bound = NearestBox(all, box).squared;
  const V limit = hn::Set(d, bound < reach ? bound : reach), more = hn::Set(d, kMore);
  size_t count = 0;
  for (size_t at = 0; at < all.count; at += hn::Lanes(d)) {
    uint8_t bits[8] = {};
    hn::StoreMaskBits(d, hn::Le(Least(all, at, box), hn::Mul(hn::Add(limit, all.At(kSlack, at)), more)), bits);
    for (uint32_t left = bits[0] | static_cast<uint32_t>(bits[1]) << 8; left != 0; left &= left - 1) {
      const size_t found = at + hwy::Num0BitsBelowLS1Bit_Nonzero32(left);
      if (found >= all.count) break;  // padding, which points as far out as kNoGroup come near to
      if (count == kMostListed) return all;
      for (size_t row = 0; row < kNearestBounds; ++row)
        list->rows[row * kMostListed + count] = all.rows[row * stride + found];
      list->groups[count++] = static_cast<uint16_t>(found);
    }
  }
  for (size_t i = count; i % hn::Lanes(d) != 0; ++i) {
    for (size_t row = 0; row < kNearestBounds; ++row)
      list->rows[row * kMostListed + i] = row < kSlack ? kNoGroup : 0;
  }
  return {list->rows, kMostListed, count, list->groups};
}

struct Points {
  HWY_ALIGN float at[3][kNearestPatch];  // up to a multiple of a block's
};

HWY_INLINE size_t BlockPoints() { return kVectors * hn::Lanes(d); }

HWY_INLINE void LoadPoints(const NearestJob& job, Points* points) {
  const size_t block = BlockPoints(), filled = (job.points_count + block - 1) / block * block;
  for (size_t i = 0; i < filled; ++i) {
    const size_t p = job.order[i < job.points_count ? i : job.points_count - 1];
    const auto* bytes = reinterpret_cast<const char*>(job.points) + p * job.point_stride_bytes;
    const auto* point = reinterpret_cast<const float*>(bytes);
    for (size_t c = 0; c < 3; ++c) points->at[c][i] = point[c];
  }
}

HWY_INLINE Box BoxAround(const Points& points, size_t count) {
  Box box;
  for (size_t c = 0; c < 3; ++c) {
    V low = hn::Load(d, points.at[c]), high = low;
    for (size_t i = hn::Lanes(d); i < count; i += hn::Lanes(d)) {
      low = hn::Min(low, hn::Load(d, points.at[c] + i));
      high = hn::Max(high, hn::Load(d, points.at[c] + i));
    }
    box.low[c] = hn::MinOfLanes(d, low);
    box.high[c] = hn::MaxOfLanes(d, high);
  }
  return box;
}

HWY_INLINE Box BoxOfOne(const Points& points, size_t i) {
  Box box;
  for (size_t c = 0; c < 3; ++c) box.low[c] = box.high[c] = hn::Set(d, points.at[c][i]);
  return box;
}

// As many points as fill a few vectors.
struct Block {
  V x[kVectors], y[kVectors], z[kVectors];
  V nearest_squared[kVectors], suspect_excess[kVectors];  // squared distances, less slack^2 for the suspect
};

struct Site {
  const float* at;
  HWY_INLINE V All(size_t row) const { return hn::Set(d, at[row * kNearestGroup]); }
};

HWY_INLINE Site FirstSite(const NearestJob& job, size_t group) {
  return {job.sites + group * kNearestSiteFloats * kNearestGroup};
}

// How near, not which. An excess below 0 counts as 0, which no nearest site is below either. What is found stays in
// variables of its own: in an array the compiler keeps it in memory, and each site waits for the one before.
HWY_INLINE void LookInto(const NearestJob& job, size_t group, Block* block) {
  static_assert(kVectors == 2, "");
  const V none = hn::Set(d, kNoSuspect);
  V nearest0 = block->nearest_squared[0], nearest1 = block->nearest_squared[1];
  V suspect0 = block->suspect_excess[0], suspect1 = block->suspect_excess[1];
  Site site = FirstSite(job, group);
  for (size_t k = 0; k < kNearestGroup; ++k, ++site.at) {
    const auto look = [&](size_t v, V* nearest, V* suspect) {
      const V x = block->x[v], y = block->y[v], z = block->z[v];
      const V squared = SquaredLength(hn::Sub(x, site.All(0)), hn::Sub(y, site.All(1)), hn::Sub(z, site.All(2)));
      const V height = MultiplyAdd(site.All(3), x, MultiplyAdd(site.All(4), y, hn::Mul(site.All(5), z)));
      const V clear = hn::And(hn::VecFromMask(d, hn::Ge(height, site.All(6))), none);
      *nearest = hn::Min(squared, *nearest);
      *suspect = hn::Min(hn::Max(hn::Sub(squared, site.All(7)), clear), *suspect);
    };
    look(0, &nearest0, &suspect0);
    look(1, &nearest1, &suspect1);
  }
  block->nearest_squared[0] = nearest0;
  block->nearest_squared[1] = nearest1;
  block->suspect_excess[0] = suspect0;
  block->suspect_excess[1] = suspect1;
}

// Whether there are points that the box may matter to.
HWY_INLINE bool MayMatter(const Boxes& boxes, size_t box, const Block& block) {
  const auto all = [&](size_t row) { return hn::Set(d, boxes.rows[row * boxes.stride + box]); };
  const V slack = hn::Mul(all(kSlack), hn::Set(d, kMore));
  V beyond = hn::Set(d, kNoSuspect);
  for (size_t v = 0; v < kVectors; ++v) {
    const V x = Gap(all(kLow), all(kHigh), block.x[v], block.x[v]);
    const V y = Gap(all(kLow + 1), all(kHigh + 1), block.y[v], block.y[v]);
    const V z = Gap(all(kLow + 2), all(kHigh + 2), block.z[v], block.z[v]);
    const V bound = MultiplyAdd(block.nearest_squared[v], hn::Set(d, kMore), slack);
    beyond = hn::Min(hn::Sub(SquaredLength(x, y, z), bound), beyond);
  }
  return !hn::AllFalse(d, hn::Le(beyond, hn::Zero(d)));
}

// Sites as floats, exact up to 2^24; -1 for none.
struct Found {
  V nearest_squared, suspect_excess, nearest, suspect;
};

HWY_INLINE void LookFor(const NearestJob& job, size_t group, const Block& block, size_t v, Found* found) {
  V index = hn::Set(d, static_cast<float>(group * kNearestGroup));
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

// Which sites, for the points from `begin` on, in vector `v` of `block`, by the boxes of `around`.
HWY_INLINE void Resolve(const NearestJob& job, const Boxes& boxes, const uint16_t* around, size_t count,
                        const Block& block, size_t v, size_t begin) {
  const V none = hn::Set(d, -1.0f);
  Found found = {hn::Set(d, job.reach * job.reach), hn::Set(d, kNoSuspect), none, none};
  for (size_t i = 0; i < count; ++i) LookFor(job, boxes.Group(around[i]), block, v, &found);
  const auto near_enough = hn::Le(found.suspect_excess, found.nearest_squared);
  const auto suspicious = hn::And(near_enough, hn::Ge(found.nearest, hn::Zero(d)));
  HWY_ALIGN float nearest[kMaxLanes], suspect[kMaxLanes];
  hn::Store(found.nearest, d, nearest);
  hn::Store(hn::IfThenElse(suspicious, found.suspect, none), d, suspect);
  for (size_t k = 0; k < hn::Lanes(d) && begin + k < job.points_count; ++k) {
    if (!(suspect[k] >= 0)) continue;
    job.nearest[begin + k] = static_cast<uint16_t>(nearest[k]);
    job.suspect[begin + k] = static_cast<uint16_t>(suspect[k]);
  }
}

HWY_INLINE void SearchBlock(const NearestJob& job, const Points& points, size_t begin, const Boxes& boxes) {
  const size_t lanes = hn::Lanes(d);
  const V reach = hn::Set(d, job.reach * job.reach);
  Block block;
  for (size_t v = 0; v < kVectors; ++v) {
    block.x[v] = hn::Load(d, points.at[0] + begin + v * lanes);
    block.y[v] = hn::Load(d, points.at[1] + begin + v * lanes);
    block.z[v] = hn::Load(d, points.at[2] + begin + v * lanes);
    block.nearest_squared[v] = reach;
    block.suspect_excess[v] = hn::Set(d, kNoSuspect);
  }
  const size_t first = NearestBox(boxes, BoxOfOne(points, begin)).nearest;
  LookInto(job, boxes.Group(first), &block);
  uint16_t around[kMaxNearestGroups];
  size_t count = 0;
  for (size_t i = 0; i < boxes.count; ++i) {
    around[count] = static_cast<uint16_t>(i);
    count += MayMatter(boxes, i, block) ? 1 : 0;
  }
  for (size_t i = 0; i < count; ++i) {
    if (around[i] != first) LookInto(job, boxes.Group(around[i]), &block);
  }
  for (size_t v = 0; v < kVectors; ++v) {
    const auto reached = hn::Lt(block.nearest_squared[v], reach);
    if (hn::AllFalse(d, hn::And(reached, hn::Le(block.suspect_excess[v], block.nearest_squared[v])))) continue;
    Resolve(job, boxes, around, count, block, v, begin + v * lanes);
  }
}

}  // namespace

void Nearest(const NearestJob& job) {
  Points points;
  LoadPoints(job, &points);
  for (size_t i = 0; i < job.points_count; ++i) job.nearest[i] = job.suspect[i] = kNoSite;
  List list;
  const Boxes boxes = BoxesAround(job, BoxAround(points, job.points_count), &list);
  if (boxes.count == 0) return;
  for (size_t i = 0; i < job.points_count; i += BlockPoints()) SearchBlock(job, points, i, boxes);
}

}  // namespace dcloth::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif  // DCLOTH_VECTOR_TARGET

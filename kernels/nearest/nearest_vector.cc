// Lanes are points, or groups where a whole block of points is held against many. A block looks into the group with the
// nearest centre, then asks whether any group in reach may hold a suspect; only then it looks into all that may matter.
// Rejected: looking into all that may matter at once, three times the work; a descent along the
// body's edges from a stored start, which stays on the limb it starts from (NETWORK.md, "Penetration").
#include "kernels/simd.h"

#include "kernels/nearest/nearest.h"

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

const hn::CappedTag<float, kMaxLanes> d;
using V = hn::Vec<decltype(d)>;

struct Block {
  V x, y, z;
  V nearest_squared, suspect_squared;
  V nearest, suspect;  // as floats, exact up to 2^24; -1 for none
};

HWY_INLINE V SquaredDistance(V x, V y, V z) { return MultiplyAdd(x, x, MultiplyAdd(y, y, hn::Mul(z, z))); }

HWY_INLINE void LookInto(const NearestJob& job, size_t group, Block* block) {
  const float* site = job.sites + group * kNearestSiteFloats * kNearestGroup;
  const V x = block->x, y = block->y, z = block->z;
  V nearest_squared = block->nearest_squared, suspect_squared = block->suspect_squared;
  V nearest = block->nearest, suspect = block->suspect;
  V index = hn::Set(d, static_cast<float>(group * kNearestGroup));
  const V one = hn::Set(d, 1.0f);
  for (size_t k = 0; k < kNearestGroup; ++k, ++site) {
    const auto at = [&](size_t row) { return hn::Set(d, site[row * kNearestGroup]); };
    const V squared = SquaredDistance(hn::Sub(x, at(0)), hn::Sub(y, at(1)), hn::Sub(z, at(2)));
    const V height = MultiplyAdd(at(3), x, MultiplyAdd(at(4), y, hn::Mul(at(5), z)));
    const auto nearer = hn::Lt(squared, nearest_squared);
    const auto suspicious = hn::And(hn::Lt(height, at(6)), hn::Lt(squared, suspect_squared));
    nearest_squared = hn::IfThenElse(nearer, squared, nearest_squared);
    nearest = hn::IfThenElse(nearer, index, nearest);
    suspect_squared = hn::IfThenElse(suspicious, squared, suspect_squared);
    suspect = hn::IfThenElse(suspicious, index, suspect);
    index = hn::Add(index, one);
  }
  block->nearest_squared = nearest_squared;
  block->suspect_squared = suspect_squared;
  block->nearest = nearest;
  block->suspect = suspect;
}

// The ball around a block's points.
struct Ball {
  V x, y, z;
  float radius;
};

HWY_INLINE Ball BallAround(const Block& block) {
  Ball ball;
  V* const to[3] = {&ball.x, &ball.y, &ball.z};
  const V* const from[3] = {&block.x, &block.y, &block.z};
  float square = 0;
  for (size_t c = 0; c < 3; ++c) {
    const float low = hn::GetLane(hn::MinOfLanes(d, *from[c])), high = hn::GetLane(hn::MaxOfLanes(d, *from[c]));
    *to[c] = hn::Set(d, 0.5f * (low + high));
    square += (high - low) * (high - low);
  }
  ball.radius = 0.500005f * hn::GetLane(hn::Sqrt(hn::Set(d, square)));  // for its own rounding
  return ball;
}

// Row of the bounds of as many groups as there are lanes.
struct Groups {
  const float* bounds;
  size_t stride;
  HWY_INLINE V At(size_t row) const { return hn::LoadU(d, bounds + row * stride); }
};

HWY_INLINE V FromCentre(const Groups& groups, const Ball& ball) {
  return SquaredDistance(hn::Sub(ball.x, groups.At(kCentre)), hn::Sub(ball.y, groups.At(kCentre + 1)),
                         hn::Sub(ball.z, groups.At(kCentre + 2)));
}

// The group with the nearest centre: it rules out most of the others.
HWY_INLINE size_t FirstGroup(const NearestJob& job, const Ball& ball) {
  const size_t stride = NearestBoundStride(job.groups), lanes = hn::Lanes(d);
  V least = hn::Set(d, 3e38f), first = hn::Zero(d), index = hn::Iota(d, 0.0f);
  for (size_t g = 0; g < job.groups; g += lanes) {
    const V squared = FromCentre({job.bounds + g, stride}, ball);
    const auto nearer = hn::Lt(squared, least);
    least = hn::IfThenElse(nearer, squared, least);
    first = hn::IfThenElse(nearer, index, first);
    index = hn::Add(index, hn::Set(d, static_cast<float>(lanes)));
  }
  const V best = hn::MinOfLanes(d, least);
  const V candidates = hn::IfThenElse(hn::Eq(least, best), first, hn::Set(d, 1e9f));
  const float found = hn::GetLane(hn::MinOfLanes(d, candidates));
  return found < static_cast<float>(job.groups) ? static_cast<size_t>(found) : 0;
}

// Groups that a point within `limit` of the ball's points may be nearest in; with `under` only those below one of whose
// planes such a point may lie.
HWY_INLINE size_t GroupsAround(const NearestJob& job, const Ball& ball, float limit, bool under, uint16_t* found) {
  const size_t stride = NearestBoundStride(job.groups), lanes = hn::Lanes(d);
  const V reach = hn::Set(d, (limit + ball.radius) * 1.00001f), radius = hn::Set(d, ball.radius);
  size_t count = 0;
  for (size_t g = 0; g < job.groups; g += lanes) {
    const Groups groups = {job.bounds + g, stride};
    const V squared = FromCentre(groups, ball), bound = hn::Add(groups.At(kRadius), reach);
    auto wanted = hn::Le(squared, hn::Mul(bound, bound));
    if (hn::AllFalse(d, wanted)) continue;
    if (under) {
      const V x = hn::Sub(ball.x, groups.At(kCentre)), y = hn::Sub(ball.y, groups.At(kCentre + 1));
      const V z = hn::Sub(ball.z, groups.At(kCentre + 2));
      const V across = MultiplyAdd(groups.At(kAxis + 1), y, hn::Mul(groups.At(kAxis + 2), z));
      const V along = MultiplyAdd(groups.At(kAxis), x, across);
      const V lowest = hn::Sub(along, MultiplyAdd(groups.At(kSpread), hn::Add(hn::Sqrt(squared), radius), radius));
      wanted = hn::And(wanted, hn::Not(hn::Gt(lowest, groups.At(kRise))));
    }
    HWY_ALIGN float flags[kMaxLanes];
    hn::Store(hn::IfThenElseZero(wanted, hn::Set(d, 1.0f)), d, flags);
    for (size_t k = 0; k < lanes; ++k) {
      found[count] = static_cast<uint16_t>(g + k);
      count += flags[k] != 0;
    }
  }
  return count;
}

HWY_INLINE V Limit(const NearestJob& job, V nearest_squared) {
  return hn::Sqrt(hn::Add(nearest_squared, hn::Set(d, job.slack * job.slack)));
}

// Lanes whose points the group may matter to; with `under` only those that may lie under one of its planes.
HWY_INLINE bool MayMatter(const NearestJob& job, const Block& block, V limit, size_t group, bool under) {
  const float* bounds = job.bounds + group;
  const size_t stride = NearestBoundStride(job.groups);
  const auto at = [&](size_t row) { return hn::Set(d, bounds[row * stride]); };
  const V x = hn::Sub(block.x, at(kCentre)), y = hn::Sub(block.y, at(kCentre + 1));
  const V z = hn::Sub(block.z, at(kCentre + 2));
  const V squared = SquaredDistance(x, y, z), bound = hn::Add(limit, at(kRadius));
  auto wanted = hn::Le(squared, hn::Mul(bound, bound));
  if (under) {
    const V along = MultiplyAdd(at(kAxis), x, MultiplyAdd(at(kAxis + 1), y, hn::Mul(at(kAxis + 2), z)));
    const V lowest = hn::Sub(along, hn::Mul(at(kSpread), hn::Sqrt(squared)));
    wanted = hn::And(wanted, hn::Not(hn::Gt(lowest, at(kRise))));
  }
  return !hn::AllFalse(d, wanted);
}

HWY_INLINE bool AnySuspect(const NearestJob& job, const Block& block, const Ball& ball, V limit, float furthest,
                           uint16_t* room) {
  const size_t count = GroupsAround(job, ball, furthest, true, room);
  for (size_t r = 0; r < count; ++r) {
    if (MayMatter(job, block, limit, room[r], true)) return true;
  }
  return false;
}

HWY_INLINE void SearchBlock(const NearestJob& job, size_t begin, size_t count) {
  HWY_ALIGN float lanes[3][kMaxLanes];
  for (size_t k = 0; k < hn::Lanes(d); ++k) {
    const size_t i = begin + (k < count ? k : count - 1);
    const auto* bytes = reinterpret_cast<const char*>(job.points) + i * job.point_stride_bytes;
    const auto* p = reinterpret_cast<const float*>(bytes);
    for (size_t c = 0; c < 3; ++c) lanes[c][k] = p[c];
  }
  for (size_t k = 0; k < count; ++k) job.nearest[begin + k] = job.suspect[begin + k] = kNoSite;
  const V none = hn::Set(d, -1.0f);
  Block block = {hn::Load(d, lanes[0]), hn::Load(d, lanes[1]), hn::Load(d, lanes[2]), hn::Set(d, job.reach * job.reach),
                 hn::Set(d, 3e38f), none, none};
  const Ball ball = BallAround(block);
  const size_t first = FirstGroup(job, ball);
  LookInto(job, first, &block);
  V limit = Limit(job, block.nearest_squared);
  const float furthest = hn::GetLane(hn::MaxOfLanes(d, limit));
  uint16_t groups[kMaxNearestGroups + kMaxLanes];
  if (!AnySuspect(job, block, ball, limit, furthest, groups)) return;

  const size_t around = GroupsAround(job, ball, furthest, false, groups);
  for (size_t r = 0; r < around; ++r) {
    if (groups[r] == first || !MayMatter(job, block, limit, groups[r], false)) continue;
    LookInto(job, groups[r], &block);
    limit = Limit(job, block.nearest_squared);
  }
  const auto near_enough = hn::Le(block.suspect_squared, hn::Mul(limit, limit));
  const auto found = hn::And(near_enough, hn::Ge(block.nearest, hn::Zero(d)));
  hn::Store(hn::IfThenElse(found, block.nearest, none), d, lanes[0]);
  hn::Store(hn::IfThenElse(found, block.suspect, none), d, lanes[1]);
  for (size_t k = 0; k < count; ++k) {
    if (lanes[1][k] < 0) continue;
    job.nearest[begin + k] = static_cast<uint16_t>(lanes[0][k]);
    job.suspect[begin + k] = static_cast<uint16_t>(lanes[1][k]);
  }
}

}  // namespace

void Nearest(const NearestJob& job) {
  const size_t lanes = hn::Lanes(d);
  for (size_t i = 0; i < job.points_count; i += lanes) {
    SearchBlock(job, i, job.points_count - i < lanes ? job.points_count - i : lanes);
  }
}

}  // namespace dcloth::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif  // DCLOTH_VECTOR_TARGET

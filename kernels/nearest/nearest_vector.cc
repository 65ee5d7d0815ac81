// Lanes are points, or groups where a whole block of points is held against many. A block looks into the group with the
// nearest centre, then into all that may still matter. Rejected, all slower on the bundled skirt: to ask first whether
// any group may hold a suspect, by a cone around its normals (three blocks of four are looked into all the same);
// groups of eight sites; patches of several blocks with a list of groups of their own (along a garment's rings they are
// too long to rule anything out); Highway's CompressStore, whose table is copied to the stack in every call. And a
// descent along the body's edges from a stored start, which stays on the limb it starts from (NETWORK.md,
// "Penetration").
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

const hn::CappedTag<float, kMaxLanes> d;
using V = hn::Vec<decltype(d)>;

struct Block {
  V x, y, z;
  V nearest_squared, suspect_excess;  // squared distances, less slack^2 for the suspect
  V nearest, suspect;                 // as floats, exact up to 2^24; -1 for none
};

HWY_INLINE V SquaredDistance(V x, V y, V z) { return MultiplyAdd(x, x, MultiplyAdd(y, y, hn::Mul(z, z))); }

HWY_INLINE void LookInto(const NearestJob& job, size_t group, Block* block) {
  const float* site = job.sites + group * kNearestSiteFloats * kNearestGroup;
  const V x = block->x, y = block->y, z = block->z;
  V nearest_squared = block->nearest_squared, suspect_excess = block->suspect_excess;
  V nearest = block->nearest, suspect = block->suspect;
  V index = hn::Set(d, static_cast<float>(group * kNearestGroup));
  const V one = hn::Set(d, 1.0f);
  for (size_t k = 0; k < kNearestGroup; ++k, ++site) {
    const auto at = [&](size_t row) { return hn::Set(d, site[row * kNearestGroup]); };
    const V squared = SquaredDistance(hn::Sub(x, at(0)), hn::Sub(y, at(1)), hn::Sub(z, at(2)));
    const V height = MultiplyAdd(at(3), x, MultiplyAdd(at(4), y, hn::Mul(at(5), z)));
    const V excess = hn::Sub(squared, at(7));
    const auto nearer = hn::Lt(squared, nearest_squared);
    const auto suspicious = hn::And(hn::Lt(height, at(6)), hn::Lt(excess, suspect_excess));
    nearest_squared = hn::IfThenElse(nearer, squared, nearest_squared);
    nearest = hn::IfThenElse(nearer, index, nearest);
    suspect_excess = hn::IfThenElse(suspicious, excess, suspect_excess);
    suspect = hn::IfThenElse(suspicious, index, suspect);
    index = hn::Add(index, one);
  }
  block->nearest_squared = nearest_squared;
  block->suspect_excess = suspect_excess;
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

// Rows of the bounds of as many groups as there are lanes.
struct Groups {
  const float* bounds;
  size_t stride;
  HWY_INLINE V At(size_t row) const { return hn::LoadU(d, bounds + row * stride); }
};

// The group with the nearest centre: it rules out most of the others. Fills in how far each centre is from the ball's.
HWY_INLINE size_t FirstGroup(const NearestJob& job, const Ball& ball, float* squared_distances) {
  const size_t stride = NearestBoundStride(job.groups), lanes = hn::Lanes(d);
  V least = hn::Set(d, 3e38f), first = hn::Zero(d), index = hn::Iota(d, 0.0f);
  const V step = hn::Set(d, static_cast<float>(lanes));
  for (size_t g = 0; g < job.groups; g += lanes) {
    const Groups groups = {job.bounds + g, stride};
    const V squared = SquaredDistance(hn::Sub(ball.x, groups.At(kCentre)), hn::Sub(ball.y, groups.At(kCentre + 1)),
                                      hn::Sub(ball.z, groups.At(kCentre + 2)));
    hn::Store(squared, d, squared_distances + g);
    const auto nearer = hn::Lt(squared, least);
    least = hn::IfThenElse(nearer, squared, least);
    first = hn::IfThenElse(nearer, index, first);
    index = hn::Add(index, step);
  }
  const V best = hn::MinOfLanes(d, least);
  const V candidates = hn::IfThenElse(hn::Eq(least, best), first, hn::Set(d, 1e9f));
  const float found = hn::GetLane(hn::MinOfLanes(d, candidates));
  return found < static_cast<float>(job.groups) ? static_cast<size_t>(found) : 0;
}

// Groups that may matter to points of the ball whose nearest site is at most sqrt(`nearest_squared`) off.
HWY_INLINE size_t GroupsAround(const NearestJob& job, const Ball& ball, const float* squared_distances,
                               float nearest_squared, uint16_t* found) {
  const size_t stride = NearestBoundStride(job.groups), lanes = hn::Lanes(d);
  const V nearest = hn::Set(d, nearest_squared), radius = hn::Set(d, ball.radius), more = hn::Set(d, 1.00001f);
  const V reach = hn::Mul(hn::Add(hn::Sqrt(nearest), radius), more);
  size_t count = 0;
  for (size_t g = 0; g < job.groups; g += lanes) {
    const Groups groups = {job.bounds + g, stride};
    const V squared = hn::Load(d, squared_distances + g), slack = groups.At(kSlack);
    const V rough = hn::Add(hn::Add(groups.At(kRadius), slack), reach);  // sqrt(a^2 + b^2) is at most a + b
    if (hn::AllFalse(d, hn::Le(squared, hn::Mul(rough, rough)))) continue;
    const V limit = hn::Add(hn::Sqrt(MultiplyAdd(slack, slack, nearest)), radius);
    const V bound = MultiplyAdd(limit, more, groups.At(kRadius));
    uint8_t bits[8] = {};
    hn::StoreMaskBits(d, hn::Le(squared, hn::Mul(bound, bound)), bits);
    for (uint32_t left = bits[0] | static_cast<uint32_t>(bits[1]) << 8; left != 0; left &= left - 1)
      found[count++] = static_cast<uint16_t>(g + hwy::Num0BitsBelowLS1Bit_Nonzero32(left));
  }
  return count;
}

// Whether there are lanes whose points the group may matter to.
HWY_INLINE bool MayMatter(const NearestJob& job, const Block& block, size_t group) {
  const float* bounds = job.bounds + group;
  const size_t stride = NearestBoundStride(job.groups);
  const auto at = [&](size_t row) { return hn::Set(d, bounds[row * stride]); };
  const V x = hn::Sub(block.x, at(kCentre)), y = hn::Sub(block.y, at(kCentre + 1));
  const V z = hn::Sub(block.z, at(kCentre + 2)), slack = at(kSlack);
  const V squared = SquaredDistance(x, y, z);
  const V bound = hn::Add(hn::Sqrt(MultiplyAdd(slack, slack, block.nearest_squared)), at(kRadius));
  return !hn::AllFalse(d, hn::Le(squared, hn::Mul(bound, bound)));
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
  Block block = {hn::Load(d, lanes[0]),
                 hn::Load(d, lanes[1]),
                 hn::Load(d, lanes[2]),
                 hn::Set(d, job.reach * job.reach),
                 hn::Set(d, 3e38f),
                 none,
                 none};
  const Ball ball = BallAround(block);
  HWY_ALIGN float squared_distances[kMaxNearestGroups];
  const size_t first = FirstGroup(job, ball, squared_distances);
  LookInto(job, first, &block);
  uint16_t groups[kMaxNearestGroups];
  const float furthest = hn::GetLane(hn::MaxOfLanes(d, block.nearest_squared));
  const size_t around = GroupsAround(job, ball, squared_distances, furthest, groups);
  for (size_t r = 0; r < around; ++r) {
    const size_t group = groups[r];
    if (group != first && MayMatter(job, block, group)) LookInto(job, group, &block);
  }
  const auto near_enough = hn::Le(block.suspect_excess, block.nearest_squared);
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

// Sites and points put where one decision of the search is made.
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <vector>

#include "tests/unit/kernels/kernel_test.h"
#include "tests/unit/kernels/nearest_sites.h"

namespace dcloth::kernels {
namespace {

// Points with what they have along x along another axis.
std::vector<float> Turned(std::vector<float> points, size_t axis) {
  for (size_t i = 0; i < points.size(); i += 3) std::rotate(&points[i], &points[i] + (3 - axis), &points[i] + 3);
  return points;
}

class NearestCasesTest : public KernelTest {
 protected:
  // Of a run along `axis` the point `farthest` lies just below a plane that the run's middle is above; the others are
  // as far away where `side` is 0, or nearer.
  void CheckTouchedRun(float half, float side, float clearance, float slack, size_t farthest, size_t axis) {
    Random random(7);
    const float radius = std::sqrt(half * half + 2 * side * side);
    const float others[3][3] = {{-half, -side, 0}, {-half, 0, -side}, {-half, 0, 0}};
    const float elsewhere = farthest % 8 == 4 ? 0.0f : 50.0f;  // the other runs, in the middle or away
    const float in_reach = 0.999f, touching = in_reach * (radius + clearance);
    const float ahead = std::sqrt(touching * touching + slack * slack);
    Sites sites(2, slack, &random);
    sites.position = Turned({-2 * half, 0, 0, ahead, 0, 0}, axis);
    sites.normal = Turned({1, 0, 0, -1, 0, 0}, axis);
    sites.offset = {-1000, -in_reach * half};
    sites.slack_squared = {0, slack * slack};
    sites.Pack();
    std::vector<float> at(3 * kNearestPatch, elsewhere);
    for (size_t i = farthest / 4 * 4, other = 0; i < farthest / 4 * 4 + 4; ++i) {
      const float far[3] = {half, side, side};
      std::copy_n(i == farthest ? far : others[other++], 3, &at[3 * i]);
    }
    at = Turned(at, axis);
    std::vector<uint16_t> order(kNearestPatch), nearest(kNearestPatch), suspect(kNearestPatch);
    std::iota(order.begin(), order.end(), uint16_t{0});
    table().nearest({at.data(), 12, order.data(), order.size(), sites.packed.data(), sites.bounds.data(), sites.groups,
                     9.0f, nearest.data(), suspect.data(), clearance});
    for (size_t i = 0; i < kNearestPatch; ++i)
      ASSERT_EQ(suspect[i] != kNoSite, i == farthest) << half << " " << clearance << " " << slack << " " << i;
  }
};
DCLOTH_TEST_EVERY_TABLE(NearestCasesTest);

// The surface may just touch the ball around four points.
TEST_P(NearestCasesTest, ARunThatTheSurfaceComesNearToIsNotClear) {
  for (const float half : {1e-3f, 0.02f, 0.2f}) {
    for (const float side : {0.0f, half}) {
      for (const float clearance : {0.0f, 0.5f * half}) {
        for (const float slack : {0.0f, 0.02f, 0.3f}) {
          for (const size_t farthest : {2u, 20u, 25u, 28u, 63u}) {
            for (size_t axis = 0; axis < 3; ++axis) CheckTouchedRun(half, side, clearance, slack, farthest, axis);
          }
        }
      }
    }
  }
}

// The same far from the origin, where the ball has to be larger by what its middle is rounded by.
TEST_P(NearestCasesTest, ARunFarFromTheOriginIsNotClearSooner) {
  Random random(7);
  const float half = 0.02f, in_reach = 0.95f;
  for (size_t axis = 0; axis < 3; ++axis) {
    for (const float away : {-2000.0f, 2000.0f}) {
      Sites sites(2, 0, &random);
      sites.position = Turned({away - 2 * half, 0, 0, away + in_reach * half, 0, 0}, axis);
      sites.normal = Turned({1, 0, 0, -1, 0, 0}, axis);
      sites.offset = {-10000, -away - in_reach * half};
      sites.slack_squared = {0, 0};
      sites.Pack();
      std::vector<float> at;
      for (size_t i = 0; i < kNearestPatch; ++i) at.insert(at.end(), {away + (i % 4 == 2 ? half : -half), 0, 0});
      at = Turned(at, axis);
      std::vector<uint16_t> order(kNearestPatch), nearest(kNearestPatch), suspect(kNearestPatch);
      std::iota(order.begin(), order.end(), uint16_t{0});
      table().nearest({at.data(), 12, order.data(), order.size(), sites.packed.data(), sites.bounds.data(),
                       sites.groups, 9.0f, nearest.data(), suspect.data(), 0});
      for (size_t i = 0; i < kNearestPatch; ++i) ASSERT_EQ(suspect[i] != kNoSite, i % 4 == 2) << axis << " " << away;
    }
  }
}

// The same where the middle is rounded: half a step of the floats there is more than the site lies within the ball.
TEST_P(NearestCasesTest, ARunWhoseMiddleIsRoundedIsNotClearSooner) {
  Random random(7);
  const float step = 0x1p-13f, half = 159.75f * step, ahead = 160 * step;
  for (size_t axis = 0; axis < 3; ++axis) {
    for (const float away : {-2000.0f, 2000.0f}) {
      const float side = away < 0 ? -1.0f : 1.0f;
      Sites sites(1, 0, &random);
      sites.position = Turned({0, away + side * ahead, 0}, axis);
      sites.normal = Turned({-1, 0, 0}, axis);
      sites.offset = {-0.5f * half};
      sites.slack_squared = {0};
      sites.Pack();
      std::vector<float> at;
      for (size_t i = 0; i < kNearestPatch; ++i)
        at.insert(at.end(), {i % 4 < 2 ? half : -half, i % 2 == 0 ? away : away + side * step, 0});
      at = Turned(at, axis);
      std::vector<uint16_t> order(kNearestPatch), nearest(kNearestPatch), suspect(kNearestPatch);
      std::iota(order.begin(), order.end(), uint16_t{0});
      table().nearest({at.data(), 12, order.data(), order.size(), sites.packed.data(), sites.bounds.data(),
                       sites.groups, 9.0f, nearest.data(), suspect.data(), 0});
      for (size_t i = 0; i < kNearestPatch; ++i) ASSERT_EQ(suspect[i] != kNoSite, i % 4 < 2) << axis << " " << away;
    }
  }
}

// Two lumps of sites, the planes of one facing the points: what a patch finds.
struct TwoLumps {
  TwoLumps(const std::array<float, 3>& a, const std::array<float, 3>& b, Random* random)
      : sites(2 * kNearestGroup, 0, random) {
    for (size_t s = 0; s < sites.count; ++s) {
      const std::array<float, 3>& lump = s < kNearestGroup ? a : b;
      std::copy_n(lump.begin(), 3, &sites.position[3 * s]);
      sites.normal[3 * s] = 1;
      sites.normal[3 * s + 1] = sites.normal[3 * s + 2] = 0;
      sites.offset[s] = s < kNearestGroup ? -1000.0f : 1000.0f;
    }
    sites.Pack();
  }
  void Find(const KernelTable& table, const std::vector<float>& at) {
    std::vector<uint16_t> order(kNearestPatch);
    std::iota(order.begin(), order.end(), uint16_t{0});
    table.nearest({at.data(), 12, order.data(), order.size(), sites.packed.data(), sites.bounds.data(), sites.groups,
                   9.0f, nearest.data(), suspect.data(), 0});
  }

  Sites sites;
  std::vector<uint16_t> nearest = std::vector<uint16_t>(kNearestPatch), suspect = std::vector<uint16_t>(kNearestPatch);
};

// The nearest site of a run's middle is on one side, that of the points on the other side a little further off.
TEST_P(NearestCasesTest, ASiteOnTheFarSideOfARunIsFound) {
  Random random(7);
  for (size_t axis = 0; axis < 3; ++axis) {
    for (const float side : {-1.0f, 1.0f}) {
      std::array<float, 3> a = {}, b = {};
      a[axis] = -0.8f * side;  // in the ball around the four
      b[axis] = 0.81f * side;
      TwoLumps lumps(a, b, &random);
      std::vector<float> at;
      for (size_t i = 0; i < kNearestPatch; ++i) {
        const float corner[4][3] = {
            {0.5f, 0.5f, 0.5f}, {-0.5f, -0.5f, 0.5f}, {-0.5f, 0.5f, -0.5f}, {0.5f, -0.5f, -0.5f}};
        at.insert(at.end(), corner[i % 4], corner[i % 4] + 3);
      }
      lumps.Find(table(), at);
      for (size_t i = 0; i < kNearestPatch; ++i) {
        const bool far = at[3 * i + axis] * side > 0;
        ASSERT_EQ(lumps.suspect[i], far ? kNearestGroup : kNoSite) << axis << " " << side << " " << i;
        ASSERT_EQ(lumps.nearest[i], far ? kNearestGroup : kNoSite) << axis << " " << side << " " << i;
      }
    }
  }
}

// Where limbs sink into each other the middle of a run may be outside one and a point inside the other: a suspect
// further from the middle than the nearest site is, nearer to the point.
TEST_P(NearestCasesTest, ASuspectOfThePointAtARunsEdgeIsFound) {
  Random random(7);
  for (size_t axis = 0; axis < 3; ++axis) {
    Sites sites(2, 0, &random);
    sites.position = Turned({-1, 0, 0, 1.9f, 0, 0}, axis);
    sites.normal = {1, 0, 0, 1, 0, 0};
    sites.offset = {-1000, 1000};
    sites.slack_squared = {0, 0};
    sites.Pack();
    std::vector<float> at;
    for (size_t i = 0; i < kNearestPatch; ++i)
      at.insert(at.end(), {i % 4 == 1 ? -0.5f : i % 4 == 2 ? 0.5f : 0.0f, 0, 0});
    at = Turned(at, axis);
    std::vector<uint16_t> order(kNearestPatch), nearest(kNearestPatch), suspect(kNearestPatch);
    std::iota(order.begin(), order.end(), uint16_t{0});
    table().nearest({at.data(), 12, order.data(), order.size(), sites.packed.data(), sites.bounds.data(), sites.groups,
                     9.0f, nearest.data(), suspect.data(), 0});
    for (size_t i = 0; i < kNearestPatch; ++i) ASSERT_EQ(suspect[i], i % 4 == 2 ? 1 : kNoSite) << axis << " " << i;
  }
}

// One point of a patch is where no other is, and what it lies below is there, or so far behind it that the others' site
// is nearly as near.
TEST_P(NearestCasesTest, APointFarFromItsPatchIsFound) {
  Random random(7);
  for (size_t axis = 0; axis < 3; ++axis) {
    for (const float side : {-1.0f, 1.0f}) {
      for (const float beyond : {5.0f, 9.7f}) {
        std::array<float, 3> a = {}, b = {};
        a[axis] = 0.2f * side;  // in the ball around its run
        b[axis] = beyond * side;
        TwoLumps lumps(a, b, &random);
        for (size_t far = 0; far < kNearestPatch; ++far) {
          std::vector<float> at(3 * kNearestPatch, 0.0f);
          at[3 * far + axis] = 5 * side;
          lumps.Find(table(), at);
          for (size_t i = 0; i < kNearestPatch; ++i) {
            ASSERT_EQ(lumps.suspect[i], i == far ? kNearestGroup : kNoSite)
                << axis << " " << side << " " << beyond << " " << far << " " << i;
          }
        }
      }
    }
  }
}

// Four points deep below a plane, far from its site: the surface is nowhere near, but the middle is below it too.
TEST_P(NearestCasesTest, ARunDeepBelowThePlaneIsNotClear) {
  Random random(7);
  for (const float slack : {0.0f, 0.02f, 0.3f}) {
    Sites sites(1, slack, &random);
    sites.position = {0.5f, 0, 0};
    sites.normal = {1, 0, 0};
    sites.offset = {0.5f};
    sites.slack_squared = {slack * slack};
    sites.Pack();
    std::vector<float> at(3 * kNearestPatch);
    for (float& x : at) x = random.Uniform(-0.01f, 0.01f);
    std::vector<uint16_t> order(kNearestPatch), nearest(kNearestPatch), suspect(kNearestPatch);
    std::iota(order.begin(), order.end(), uint16_t{0});
    table().nearest({at.data(), 12, order.data(), order.size(), sites.packed.data(), sites.bounds.data(), sites.groups,
                     9.0f, nearest.data(), suspect.data(), 0.001f});
    for (size_t i = 0; i < kNearestPatch; ++i) ASSERT_EQ(suspect[i], 0) << slack << " " << i;
  }
}

// On a lattice whose numbers are exact in float: of equals the first, a plane that is touched not below it, a reach
// that is met not within it.
TEST_P(NearestCasesTest, TiesOnALatticeAreDecidedAsWritten) {
  Random random(11);
  const auto lattice = [&](uint32_t steps) {
    return (static_cast<float>(random.Below(steps)) - static_cast<float>(steps / 2)) / 8;
  };
  size_t suspects = 0;
  for (int trial = 0; trial < 3000; ++trial) {
    Sites sites(1 + random.Below(60), 0, &random);
    for (size_t s = 0; s < sites.count; ++s) {
      const size_t axis = random.Below(3);
      for (size_t c = 0; c < 3; ++c) {
        sites.position[3 * s + c] = lattice(5);
        sites.normal[3 * s + c] = c != axis ? 0.0f : random.Below(2) == 0 ? 1.0f : -1.0f;
      }
      sites.offset[s] = lattice(5);
      sites.slack_squared[s] = static_cast<float>(random.Below(3)) / 32;
    }
    sites.Pack();
    const GuardedBuffer<float> packed(sites.packed), bounds(sites.bounds);
    const GuardedBuffer<float> point(std::vector<float>{lattice(7), lattice(7), lattice(7)});
    const GuardedBuffer<uint16_t> order(std::vector<uint16_t>{0});
    GuardedBuffer<uint16_t> nearest(1), suspect(1);
    const float reach = static_cast<float>(1 + random.Below(4)) / 8;
    table().nearest({point.data(), 12, order.data(), 1, packed.data(), bounds.data(), sites.groups, reach,
                     nearest.data(), suspect.data(), 0});

    float least = reach * reach, least_excess = 1e30f;
    uint16_t near = kNoSite, below = kNoSite;
    for (size_t s = 0; s < sites.count; ++s) {
      float squared = 0, height = 0;
      for (size_t c = 0; c < 3; ++c) {
        const float apart = point[c] - sites.position[3 * s + c];
        squared += apart * apart;
        height += sites.normal[3 * s + c] * point[c];
      }
      if (squared < least) {
        least = squared;
        near = static_cast<uint16_t>(s);
      }
      const float excess = squared - sites.slack_squared[s];
      if (height < sites.offset[s] && excess < least_excess) {
        least_excess = excess;
        below = static_cast<uint16_t>(s);
      }
    }
    const bool found = near != kNoSite && least_excess <= least;
    ASSERT_EQ(nearest[0], found ? near : kNoSite) << table().name << " trial " << trial;
    ASSERT_EQ(suspect[0], found ? below : kNoSite) << table().name << " trial " << trial;
    suspects += found ? 1 : 0;
  }
  EXPECT_GT(suspects, 500u);
  EXPECT_LT(suspects, 2500u);
}

}  // namespace
}  // namespace dcloth::kernels

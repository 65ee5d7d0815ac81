#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include "tests/unit/kernels/kernel_test.h"
#include "tests/unit/kernels/nearest_sites.h"

namespace dcloth::kernels {
namespace {

class NearestTest : public KernelTest {
 protected:
  static constexpr float kScattered = -1;
  static constexpr double kDoubt = 1e-5;

  // Each four points in order lie within `spread` of each other along each axis, or anywhere.
  void Check(size_t points, size_t site_count, size_t stride_floats, float reach, float slack,
             float spread = kScattered) {
    const float clearance = slack / 4;
    SCOPED_TRACE(testing::Message() << table().name << " points " << points << " sites " << site_count << " stride "
                                    << stride_floats << " reach " << reach << " slack " << slack << " spread "
                                    << spread);
    Random random(static_cast<uint32_t>(points * 131 + site_count * 7 + stride_floats));
    const Sites sites(site_count, slack, &random);
    const Place place = points % 2 == 0 ? Place::kEnd : Place::kStart;
    const GuardedBuffer<float> packed(sites.packed, place), bounds(sites.bounds, place);
    GuardedBuffer<float> at((points - 1) * stride_floats + 3);
    for (size_t i = 0; i < points; ++i) {
      for (size_t c = 0; c < 3; ++c) at[i * stride_floats + c] = random.Uniform(-1.3f, 1.3f);
    }
    std::vector<uint16_t> shuffled(points);
    std::iota(shuffled.begin(), shuffled.end(), uint16_t{0});
    for (size_t i = 0; i < points && spread != kScattered; ++i) {
      for (size_t c = 0; c < 3 && i % 4 != 0; ++c)
        at[i * stride_floats + c] = at[i / 4 * 4 * stride_floats + c] + random.Uniform(0.0f, spread);
    }
    for (size_t i = points - 1; i > 0 && spread == kScattered; --i)
      std::swap(shuffled[i], shuffled[random.Below(static_cast<uint32_t>(i + 1))]);
    for (size_t begin = 0; begin < points; begin += kNearestPatch) {
      const size_t count = std::min(points - begin, kNearestPatch);
      const auto first = shuffled.begin() + static_cast<std::ptrdiff_t>(begin);
      const GuardedBuffer<uint16_t> order(std::vector<uint16_t>(first, first + static_cast<std::ptrdiff_t>(count)));
      GuardedBuffer<uint16_t> nearest(count), suspect(count);
      table().nearest({at.data(), 4 * stride_floats, order.data(), count, packed.data(), bounds.data(), sites.groups,
                       reach, nearest.data(), suspect.data(), clearance});
      ASSERT_TRUE(nearest.SlackUntouched() && suspect.SlackUntouched());
      for (size_t i = 0; i < count; ++i) {
        std::vector<const float*> run;
        for (size_t k = i / 4 * 4; k < std::min(i / 4 * 4 + 4, count); ++k)
          run.push_back(&at[order[k] * stride_floats]);
        CheckPoint(sites, run[i % 4], reach, nearest[i], suspect[i], MayBeClear(sites, run, clearance));
      }
    }
  }

  // Whether the run may go without suspects: nothing in a ball around it, and no sure suspect of the ball's middle.
  bool MayBeClear(const Sites& sites, const std::vector<const float*>& run, double clearance) {
    double middle[3], radius = 0, least = 1e30, least_excess = 1e30, sure = 1e30;
    for (size_t c = 0; c < 3; ++c) {
      const auto less = [&](const float* a, const float* b) { return a[c] < b[c]; };
      const auto [low, high] = std::minmax_element(run.begin(), run.end(), less);
      middle[c] = (double{(*low)[c]} + double{(*high)[c]}) / 2;
    }
    for (const float* v : run)
      radius = std::max(radius, std::hypot(v[0] - middle[0], v[1] - middle[1], v[2] - middle[2]));
    for (size_t s = 0; s < sites.count; ++s) {
      double squared = 0, above = -sites.offset[s];
      for (size_t c = 0; c < 3; ++c) {
        squared += std::pow(middle[c] - sites.position[3 * s + c], 2);
        above += sites.normal[3 * s + c] * middle[c];
      }
      const double excess = squared - double{sites.slack_squared[s]};
      least = std::min(least, squared);
      least_excess = std::min(least_excess, excess);
      if (above < -kDoubt) sure = std::min(sure, excess);
    }
    return least_excess > std::pow(radius + clearance, 2) * (1 - kDoubt) && sure > least * (1 - kDoubt);
  }

  // A squared distance has a rounded difference, product and two sums: at most gamma(5) off; a height three products
  // and two sums. Two distances compared may both be off.
  void CheckPoint(const Sites& sites, const float* v, double reach, uint16_t nearest, uint16_t suspect,
                  bool may_be_clear) {
    const double most = 1 + 2 * Gamma(8);
    std::vector<double> squared(sites.count), above(sites.count), doubt(sites.count), excess(sites.count),
        doubt_of_excess(sites.count);
    double least = 1e30, sure = 1e30;  // of the excess of suspects, at its most
    for (size_t s = 0; s < sites.count; ++s) {
      above[s] = -sites.offset[s];
      for (size_t c = 0; c < 3; ++c) {
        const double product = double{sites.normal[3 * s + c]} * v[c];
        squared[s] += std::pow(double{v[c]} - sites.position[3 * s + c], 2);
        above[s] += product;
        doubt[s] += Gamma(4) * std::fabs(product);
      }
      least = std::min(least, squared[s]);
      excess[s] = squared[s] - double{sites.slack_squared[s]};
      doubt_of_excess[s] = (most - 1) * (squared[s] + double{sites.slack_squared[s]});
      if (above[s] < -doubt[s]) sure = std::min(sure, excess[s] + doubt_of_excess[s]);
    }
    ASSERT_EQ(nearest == kNoSite, suspect == kNoSite);
    if (suspect == kNoSite) {
      const bool in_reach = least * most < reach * reach;
      ASSERT_FALSE(in_reach && sure < least / most && !may_be_clear) << "a suspect was missed";
      ++(in_reach ? clear_ : none_);
      return;
    }
    ASSERT_LT(nearest, sites.count);
    ASSERT_LE(squared[nearest], least * most);
    ASSERT_LE(least, reach * reach * most);
    ASSERT_LT(suspect, sites.count);
    ASSERT_LE(above[suspect], doubt[suspect]);
    ASSERT_LE(excess[suspect], least * most + doubt_of_excess[suspect]);
    ASSERT_LE(excess[suspect], sure + doubt_of_excess[suspect]);
    ++suspects_;
    if (suspect != nearest) ++others_;
  }

  size_t none_ = 0, clear_ = 0, suspects_ = 0, others_ = 0;
};
DCLOTH_TEST_EVERY_TABLE(NearestTest);

TEST_P(NearestTest, EveryPointCount) {
  for (size_t points : InterestingSizes()) Check(points, 150, 3, 0.6f, 0.1f);
  EXPECT_GT(none_, 0u);
  EXPECT_GT(clear_, 0u);
  EXPECT_GT(suspects_, 0u);
  EXPECT_GT(others_, 0u);
}

TEST_P(NearestTest, EverySiteCountAndStride) {
  for (size_t sites : InterestingSizes()) Check(19, sites, 3 + sites % 5, 0.5f, 0.05f);
  Check(40, kMaxNearestGroups * kNearestGroup, 3, 2.0f, 0.02f);
}

// Of four points close together all may be cleared at once: not where one of them alone has a suspect.
TEST_P(NearestTest, RunsOfPointsFromOnePlaceToApart) {
  for (float spread : {0.0f, 1e-3f, 0.02f, 0.1f, 0.5f}) {
    none_ = clear_ = suspects_ = 0;
    for (float slack : {0.0f, 0.02f, 0.3f}) {
      Check(1500, 150, 3, 1.5f, slack, spread);
      Check(1501, 800, 4, 0.05f, slack, spread);
    }
    EXPECT_GT(none_, 100u) << spread;
    EXPECT_GT(clear_, 100u) << spread;
    EXPECT_GT(suspects_, 100u) << spread;
  }
}

// A job about some groups of many, in any order, finds what one about a copy of them does.
TEST_P(NearestTest, SomeGroupsOfMany) {
  Random random(11);
  Sites all(40 * kNearestGroup, 0.1f, &random);
  std::vector<uint16_t> places;
  for (size_t g = all.groups; g > 2; g -= 3) places.push_back(static_cast<uint16_t>(g - 1));
  Sites some(places.size() * kNearestGroup, 0.1f, &random);
  constexpr size_t kFloats = kNearestSiteFloats * kNearestGroup;
  const size_t stride = NearestBoundStride(some.groups), all_stride = NearestBoundStride(all.groups);
  for (size_t g = 0; g < some.groups; ++g) {
    std::copy_n(&all.packed[places[g] * kFloats], kFloats, &some.packed[g * kFloats]);
    for (size_t row = 0; row < kNearestBounds; ++row)
      some.bounds[row * stride + g] = all.bounds[row * all_stride + places[g]];
  }
  std::vector<float> at(3 * kNearestPatch);
  for (float& x : at) x = random.Uniform(-1.0f, 1.0f);
  std::vector<uint16_t> order(kNearestPatch), nearest(kNearestPatch), suspect(kNearestPatch), expected(kNearestPatch),
      expected_suspect(kNearestPatch);
  std::iota(order.begin(), order.end(), uint16_t{0});
  NearestJob job = {at.data(),          12,          order.data(), order.size(),    some.packed.data(),
                    some.bounds.data(), some.groups, 9.0f,         expected.data(), expected_suspect.data()};
  table().nearest(job);
  const GuardedBuffer<uint16_t> guarded(places);
  job.sites = all.packed.data();
  job.group_places = guarded.data();
  job.nearest = nearest.data();
  job.suspect = suspect.data();
  table().nearest(job);
  size_t found = 0;
  for (size_t i = 0; i < kNearestPatch; ++i) {
    for (std::vector<uint16_t>* sites : {&expected, &expected_suspect}) {
      uint16_t& site = (*sites)[i];
      if (site == kNoSite) continue;
      site = static_cast<uint16_t>(places[site / kNearestGroup] * kNearestGroup + site % kNearestGroup);
      ++found;
    }
  }
  EXPECT_EQ(nearest, expected);
  EXPECT_EQ(suspect, expected_suspect);
  EXPECT_GT(found, kNearestPatch);
}

TEST_P(NearestTest, ReachAndSlackFromNothingToEverything) {
  for (float reach : {0.0f, 0.01f, 0.3f, 1e9f}) {
    for (float slack : {0.0f, 0.2f, 1e9f}) Check(53, 200, 4, reach, slack);
  }
}

TEST_P(NearestTest, PointsThatAreNoNumbersHaveNoSite) {
  Random random(5);
  const Sites sites(64, 0.1f, &random);
  std::vector<float> at(3 * 40, 0.0f);
  at[3 * 7 + 1] = NAN;
  at[3 * 30] = INFINITY;
  std::vector<uint16_t> order(40), nearest(40, 1), suspect(40, 1);
  std::iota(order.begin(), order.end(), uint16_t{0});
  table().nearest({at.data(), 12, order.data(), 40, sites.packed.data(), sites.bounds.data(), sites.groups, 9.0f,
                   nearest.data(), suspect.data()});
  for (size_t i : {size_t{7}, size_t{30}}) {
    EXPECT_EQ(nearest[i], kNoSite) << i;
    EXPECT_EQ(suspect[i], kNoSite) << i;
  }
}

// Damaged weights throw points anywhere, also to where the boxes of padding lie: no site beyond the last is read.
TEST_P(NearestTest, PointsAsFarOutAsThePaddingReadNoSitesBeyondTheLast) {
  for (size_t site_count : {1u, 150u, 300u}) {
    for (float far : {kNoGroup, 1e19f, 3e38f, std::numeric_limits<float>::infinity()}) {
      Random random(5);
      const Sites sites(site_count, 0.1f, &random);
      const GuardedBuffer<float> packed(sites.packed), bounds(sites.bounds);
      GuardedBuffer<float> at(3 * kNearestPatch);
      std::vector<uint16_t> in_turn(kNearestPatch);
      std::iota(in_turn.begin(), in_turn.end(), uint16_t{0});
      for (size_t i = 0; i < at.size(); ++i) at[i] = i % 7 < 4 ? random.Uniform(-1.0f, 1.0f) : i % 2 == 0 ? far : -far;
      const GuardedBuffer<uint16_t> order(in_turn);
      GuardedBuffer<uint16_t> nearest(kNearestPatch), suspect(kNearestPatch);
      table().nearest({at.data(), 12, order.data(), kNearestPatch, packed.data(), bounds.data(), sites.groups, 1e9f,
                       nearest.data(), suspect.data()});
      ASSERT_TRUE(nearest.SlackUntouched() && suspect.SlackUntouched());
      for (size_t i = 0; i < kNearestPatch; ++i) {
        ASSERT_TRUE(nearest[i] == kNoSite || nearest[i] < sites.groups * kNearestGroup) << nearest[i];
        ASSERT_TRUE(suspect[i] == kNoSite || suspect[i] < sites.groups * kNearestGroup) << suspect[i];
      }
    }
  }
}

// A body that is no number either: no place is read that is not there, with the list of its groups short or not.
TEST_P(NearestTest, SitesThatAreNoNumbersAreNoFault) {
  Random random(6);
  for (const size_t count : {size_t{64}, size_t{2000}}) {
    for (const float bad : {NAN, INFINITY, -INFINITY}) {
      Sites sites(count, 0.1f, &random);
      const size_t stride = NearestBoundStride(sites.groups);
      for (float& x : sites.packed) x = bad;
      for (size_t g = 0; g < sites.groups; ++g) {
        for (size_t row = 0; row < kNearestBounds; ++row) sites.bounds[row * stride + g] = bad;
      }
      const GuardedBuffer<float> packed(sites.packed), bounds(sites.bounds);
      std::vector<float> at(3 * 9, 0.2f);
      at[5] = bad;
      const std::vector<uint16_t> order = {0, 1, 2, 3, 4, 5, 6, 7, 8};
      std::vector<uint16_t> nearest(9), suspect(9);
      table().nearest({at.data(), 12, order.data(), 9, packed.data(), bounds.data(), sites.groups, 9.0f, nearest.data(),
                       suspect.data()});
      for (size_t i = 0; i < 9; ++i) {
        EXPECT_TRUE(suspect[i] == kNoSite || suspect[i] < sites.groups * kNearestGroup);
        EXPECT_TRUE(nearest[i] == kNoSite || nearest[i] < sites.groups * kNearestGroup);
      }
    }
  }
}

}  // namespace
}  // namespace dcloth::kernels

// A leg that was drawn outside of its skirt takes the skirt along.
#include "engine/src/body/swept_limbs.h"

#include <gtest/gtest.h>

#include <cmath>
#include <utility>
#include <vector>

#include "tests/unit/engine/body/limbs.h"

namespace dcloth::testing {
namespace {

struct Drawn {
  float hip, knee;  // radians
  float slope;      // of the skirt
};

class SweptLimbsTest : public LegInSkirt {
 protected:
  std::pair<std::vector<float>, std::vector<float>> LaidAndSwept(const Drawn& drawn) {
    Lift(drawn.hip, drawn.knee);
    std::vector<float> laid = Skirt(drawn.slope), swept = laid;
    Lay(&laid);
    LayOrSweep(&swept);
    return {laid, swept};
  }
};

// Legs hung, lifted forward and kicked up; skirts that hang and that are blown back through them.
const std::vector<Drawn>& AllDrawn() {
  static const std::vector<Drawn> drawn = [] {
    std::vector<Drawn> all;
    for (const float hip : {0.0f, 0.3f, 0.6f, 0.9f, 1.2f, 1.5f, 1.8f, 2.4f}) {
      for (const float knee : {0.0f, 1.0f, 2.0f}) {
        for (const float slope : {0.0f, 0.2f, 0.4f, 0.8f}) all.push_back({hip, knee, slope});
      }
    }
    return all;
  }();
  return drawn;
}
constexpr Drawn kNotMended = {0.3f, 2, 0.8f};

bool IsNotMended(const Drawn& drawn) {
  return drawn.hip == kNotMended.hip && drawn.knee == kNotMended.knee && drawn.slope == kNotMended.slope;
}

// Where each vertex alone is taken out of the leg, the bones still go through the cloth.
TEST_F(SweptLimbsTest, ClothThatLayingTearsIsTakenAlong) {
  int torn = 0;
  for (const Drawn& drawn : AllDrawn()) {
    const auto [laid, swept] = LaidAndSwept(drawn);
    if (IsNotMended(drawn) || TornOn(laid) == 0) continue;
    EXPECT_EQ(TornOn(swept), 0) << drawn.hip << " " << drawn.knee << " " << drawn.slope;
    EXPECT_EQ(CrossedBy(swept), 0) << drawn.hip << " " << drawn.knee << " " << drawn.slope;
    ++torn;
  }
  EXPECT_GE(torn, 50);
}

TEST_F(SweptLimbsTest, ClothThatWasLaidWellKeepsItsBits) {
  int well = 0;
  for (const Drawn& drawn : AllDrawn()) {
    const auto [laid, swept] = LaidAndSwept(drawn);
    if (TornOn(laid) != 0) continue;
    EXPECT_EQ(swept, laid) << drawn.hip << " " << drawn.knee << " " << drawn.slope;
    ++well;
  }
  EXPECT_GE(well, 40);
}

// And drawn together, unless that would tear it further.
TEST_F(SweptLimbsTest, WhatNothingMendsIsLaid) {
  const auto [laid, drawn] = LaidAndSwept(kNotMended);
  EXPECT_GT(TornOn(laid), 0);
  EXPECT_NE(drawn, laid);
  EXPECT_LE(TornOn(drawn), TornOn(laid));
  EXPECT_LE(CrossedBy(drawn), CrossedBy(laid));
  const auto [left, still] = LaidAndSwept({0, 2.6f, 0.8f});
  EXPECT_GT(TornOn(left), 0);
  EXPECT_EQ(still, left);
}

TEST_F(SweptLimbsTest, WhereShortSweepsDoNotHelpTheLegComesFromWhereItHung) {
  const auto [laid, swept] = LaidAndSwept({0, 2.4f, 0.8f});
  ASSERT_GE(TornOn(laid), 5);
  EXPECT_LE(TornOn(swept), 1);
  EXPECT_LE(CrossedBy(swept), 1);
}

// A leg kicked up out of a skirt that was drawn hanging: the skirt lies on it, as far as it is long, and not around the
// ankle. Its sides, which hang, draw the hem back by more than a tenth.
TEST_F(SweptLimbsTest, ClothFallsOntoTheLegWhereItIsWorn) {
  const auto [laid, swept] = LaidAndSwept({1.5f, 0, 0});
  const engine::LimbCore& thigh = limbs_.cores[0];
  int in_front = 0;
  for (size_t v = 0; v < order_.size(); ++v) {
    const float* bound = &bound_[3 * v];
    if (bound[1] > -0.1f || std::fabs(bound[0]) > 0.01f || bound[2] < 0) continue;
    const float* on_leg = &swept[3 * v];
    const engine::OnBone on = engine::PlaceOnBone(thigh.posed_from, thigh.along, thigh.inverse_squared, on_leg);
    EXPECT_NEAR(on.along * kLength, -bound[1], 0.15f) << v;
    EXPECT_GT(on_leg[1], laid[3 * v + 1] + 0.15f) << v;
    ++in_front;
  }
  EXPECT_GE(in_front, 20);
}

TEST_F(SweptLimbsTest, TellsWhereBonesGoThroughCloth) {
  int most = 0, none = 0;
  for (const Drawn& drawn : AllDrawn()) {
    const std::vector<float> skirt = LaidAndSwept(drawn).first;
    int found = 0;
    for (uint32_t k = 0; k < *limbs_.count; ++k) {
      for (size_t t = 0; t < faces_.size(); t += 3) {
        const float *a = &skirt[3 * faces_[t]], *b = &skirt[3 * faces_[t + 1]], *c = &skirt[3 * faces_[t + 2]];
        found += engine::GoesThrough(limbs_.cores[k], a, b, c);
      }
    }
    EXPECT_EQ(found, CrossedBy(skirt)) << drawn.hip << " " << drawn.knee << " " << drawn.slope;
    most = found > most ? found : most;
    none += found == 0;
  }
  EXPECT_GE(most, 2);
  EXPECT_GE(none, 10);
}

TEST_F(SweptLimbsTest, NoFrameRemembersTheLast) {
  Lift(0.9f, 2);
  std::vector<float> first = Skirt(0);
  LayOrSweep(&first);
  Lift(0.3f, 2);
  std::vector<float> other = Skirt(0.2f);
  LayOrSweep(&other);
  Lift(0.9f, 2);
  std::vector<float> again = Skirt(0);
  LayOrSweep(&again);
  EXPECT_EQ(again, first);
}

TEST_F(SweptLimbsTest, AFootLiesUnderWhatItsShankDoes) {
  ASSERT_EQ(*limbs_.count, 3u);
  uint32_t nearest;
  const float hem[3] = {kSkirt, -0.6f, 0}, waist[3] = {kSkirt, -0.05f, 0};
  EXPECT_EQ(engine::CoresUnder(limbs_, hem, 0, &nearest), 7u);
  EXPECT_EQ(engine::CoresUnder(limbs_, waist, 0, &nearest), 1u) << "0.4 m from the shank";
  for (const uint8_t legs : std::vector<uint8_t>(swept_.limbs, swept_.limbs + order_.size())) ASSERT_EQ(legs, 1);
}

TEST_F(ArmInSleeve, SleevesAreNotSwept) {
  std::vector<uint8_t> memory(32 * order_.size() + 65536);
  engine::Arena arena(memory.data() + (64 - reinterpret_cast<uintptr_t>(memory.data()) % 64) % 64);
  const engine::SweptCloth swept = engine::PlaceSweptCloth(model_, &arena);
  engine::FindSleeves(model_, limbs_, sleeves_);
  engine::FindSweptCloth(model_, limbs_, sleeves_, swept);
  for (size_t v = 0; v < order_.size(); ++v) ASSERT_EQ(swept.limbs[v], 0) << v;
}

TEST_F(SweptLimbsTest, MirroredSpacesGiveTheMirrorImage) {
  Lift(0.6f, 2);
  std::vector<float> skirt = Skirt(0), host = skirt;
  const std::vector<float> before = skirt;
  LayOrSweep(&skirt);
  EXPECT_NE(skirt, before);
  MirrorSpace(&host);
  LayOrSweep(&host, true);
  size_t apart = 0;
  for (size_t i = 0; i < host.size(); ++i)
    apart += !(std::fabs(0.01f * host[i] * (i % 3 == 0 ? -1.0f : 1.0f) - skirt[i]) < 1e-4f);
  EXPECT_EQ(apart, 0u);
}

TEST_F(SweptLimbsTest, BrokenPosesEnd) {
  Lift(0.9f, 2);
  ExpectBrokenPosesEnd([this](std::vector<float>* skirt) { LayOrSweep(skirt); });
}

}  // namespace
}  // namespace dcloth::testing

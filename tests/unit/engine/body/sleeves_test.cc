// Sleeves that have lost their arm are laid around it.
#include "engine/src/body/sleeves.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <vector>

#include "tests/unit/engine/body/limbs.h"

namespace dcloth::testing {
namespace {

constexpr float kPi = 3.14159265f, kRoom = 0.028f;  // the shift is found in steps

class SleevesTest : public ArmInSleeve {
 protected:
  SleevesTest() { engine::FindSleeves(model_, limbs_, sleeves_); }

  // The sleeve as its bones hold it, turned about them; each ring is moved by `aside`(its place in the bind pose along
  // the arm, from the shoulder), across the arm. What is moved has the share `wide` of its width.
  template <typename Aside>
  std::vector<float> Worn(float turn, Aside aside, float wide = 1) const {
    std::vector<float> sleeve(bound_.size());
    for (size_t i = 0; i < bound_.size(); i += 3) {
      const float moved = aside(-bound_[i + 1]), width = moved == 0 ? 1 : wide;
      const float c = width * std::cos(turn), s = width * std::sin(turn);
      const float at[3] = {c * bound_[i] - s * bound_[i + 2] + moved, bound_[i + 1], s * bound_[i] + c * bound_[i + 2]};
      const float* matrix = matrices_.data() + (bound_[i + 1] > -kBone ? 0 : 12);
      for (size_t r = 0; r < 3; ++r) {
        sleeve[i + r] = matrix[4 * r + 3];
        for (size_t k = 0; k < 3; ++k) sleeve[i + r] += matrix[4 * r + k] * at[k];
      }
    }
    return sleeve;
  }

  void Thread(std::vector<float>* sleeve) {
    engine::PoseLimbCores(matrices_.data(), limbs_);
    engine::Surface surface = {};
    surface.positions = sleeve->data();
    surface.position_stride_bytes = 12;
    engine::ThreadSleeves(model_, limbs_, sleeves_, surface);
  }

  // How often a ring of the sleeve goes around its bone, and how near it comes to it.
  void Around(const std::vector<float>& sleeve, size_t ring, int* times, float* nearest) const {
    float sum = 0, place[3], next[3];
    *nearest = 1;
    for (size_t k = 0; k < kAround; ++k) {
      const size_t i = 3 * (ring * kAround + k), j = 3 * (ring * kAround + (k + 1) % kAround);
      Unbend(i, &sleeve[i], place);
      Unbend(j, &sleeve[j], next);
      sum += std::atan2(place[0] * next[2] - place[2] * next[0], place[0] * next[0] + place[2] * next[2]);
      *nearest = std::fmin(*nearest, std::hypot(place[0], place[2]));
    }
    *times = static_cast<int>(std::lround(sum / (2 * kPi)));
  }
};

TEST_F(SleevesTest, ASleeveGoesAroundItsLimbOnAllSides) {
  size_t upper = 0, fore = 0;
  for (size_t v = 0; v < order_.size(); ++v) {
    upper += sleeves_.cores[v] == 0;
    fore += sleeves_.cores[v] == 1;
  }
  EXPECT_EQ(upper + fore, order_.size());
  EXPECT_GT(upper, 8 * kAround);
  EXPECT_GT(fore, 8 * kAround);
  for (size_t i = 0; i < bound_.size(); i += 3) bound_[i] = std::fabs(bound_[i]);
  engine::FindSleeves(model_, limbs_, sleeves_);
  for (size_t v = 0; v < order_.size(); ++v) EXPECT_EQ(sleeves_.cores[v], engine::kNoSleeve) << "open on one side";
}

// Loose, turned, bent: as long as the arm is in it.
TEST_F(SleevesTest, ASleeveThatHoldsItsArmKeepsItsBits) {
  for (const float angle : {0.0f, 0.4f, 0.8f}) {
    Bend(angle);
    for (const float turn : {0.0f, 1.5f}) {
      for (const float aside : {0.0f, 0.01f, -0.02f}) {
        std::vector<float> sleeve = Worn(turn, [&](float) { return aside; });
        const std::vector<float> before = sleeve;
        Thread(&sleeve);
        EXPECT_EQ(sleeve, before) << angle << " turned by " << turn << " aside " << aside;
      }
    }
  }
}

// The forearm has come out through the sleeve's side. Each ring goes around it again, as far along and turned as the
// rest of the sleeve, and no further off than it has room; what was well stays.
TEST_F(SleevesTest, AForearmOutsideOfItsSleeveComesToLieInIt) {
  const auto aside = [](float along) { return std::fmin(0.1f, std::fmax(0.0f, along - 0.31f)); };
  for (const float angle : {0.0f, 1.0f, 1.9f, -1.9f}) {
    Bend(angle);
    for (const float turn : {0.0f, 1.2f}) {
      std::vector<float> sleeve = Worn(turn, [&](float along) { return 2 * aside(along); });
      const std::vector<float> before = sleeve, right = Worn(turn, [](float) { return 0.0f; });
      Thread(&sleeve);
      int lost = 0;
      for (size_t ring = 0; ring < kRings; ++ring) {
        int times;
        float nearest;
        Around(before, ring, &times, &nearest);
        lost += times == 0;
        Around(sleeve, ring, &times, &nearest);
        EXPECT_EQ(std::abs(times), 1) << angle << " turned by " << turn << " ring " << ring;
        const bool hinge = std::fabs(bound_[3 * ring * kAround + 1] + kBone) < 0.06f;
        for (size_t k = 0; k < kAround && !hinge; ++k) {
          const size_t i = 3 * (ring * kAround + k);
          if (ring < 1) {
            EXPECT_EQ(std::memcmp(&sleeve[i], &before[i], 12), 0) << angle << " ring " << ring;
            continue;
          }
          if (times == 0 || ring < 18) continue;
          EXPECT_GT(nearest, kRoom) << angle << " ring " << ring;
          const float off =
              std::hypot(sleeve[i] - right[i], sleeve[i + 1] - right[i + 1], sleeve[i + 2] - right[i + 2]);
          EXPECT_LT(off, kSleeve - kRoom) << angle << " turned by " << turn << " ring " << ring;
        }
      }
      EXPECT_GE(lost, 5) << angle;
    }
  }
}

// A wide sleeve that hangs beside its arm goes back as it is.
TEST_F(SleevesTest, RingsKeepTheirShapeAsTheyShift) {
  for (const float angle : {0.0f, 0.6f, 1.2f}) {
    Bend(angle);
    std::vector<float> sleeve = Worn(0.3f, [](float along) { return std::fmax(0.0f, along - 0.25f); });
    const std::vector<float> before = sleeve;
    Thread(&sleeve);
    float moved = 0;
    for (size_t ring = 0; ring < kRings; ++ring) {
      for (size_t k = 0; k < kAround; ++k) {
        for (size_t c = 0; c < 3; ++c) {
          const size_t i = 3 * (ring * kAround + k) + c, first = 3 * ring * kAround + c;
          moved = std::fmax(moved, std::fabs(sleeve[i] - before[i]));
          EXPECT_NEAR(sleeve[i] - sleeve[first], before[i] - before[first], 1e-6f) << angle << " ring " << ring;
        }
      }
    }
    EXPECT_GT(moved, 0.02f) << angle;
  }
}

// A fist turned up turns the forearm by half a turn, and the elbow is in between.
TEST_F(SleevesTest, ASleeveStaysWholeWhereTheForearmIsTurned) {
  constexpr float kAside = 0.15f, kStretched = 0.3f * kAside;  // torn, it is apart by as much as it was aside
  for (const float angle : {0.3f, 1.5f, 2.1f}) {
    for (const float turn : {1.6f, 2.9f, kPi, -2.9f}) {
      Bend(angle);
      std::vector<float> sleeve = Worn(
          0, [](float along) { return along < 0.25f ? 0.0f : kAside; }, 0.5f);
      TurnForearm(turn);
      Thread(&sleeve);
      for (size_t i = 0; i < sleeve.size(); i += 3) {
        const size_t ring = i / 3 / kAround;
        if (ring < 9) continue;  // from here on it is lost as a whole
        float squared = 1;
        for (const engine::LimbCore* bone : {&limbs_.cores[0], &limbs_.cores[1]}) {
          const auto on = engine::PlaceOnBone(bone->posed_from, bone->along, bone->inverse_squared, &sleeve[i]);
          squared = std::fmin(squared, on.squared);
        }
        EXPECT_LT(std::sqrt(squared), kArm + 0.03f) << angle << " turned by " << turn << " ring " << ring;
        const size_t above = i - 3 * kAround;
        const float apart =
            std::hypot(sleeve[i] - sleeve[above], sleeve[i + 1] - sleeve[above + 1], sleeve[i + 2] - sleeve[above + 2]);
        EXPECT_LT(apart, kStretched) << angle << " turned by " << turn << " ring " << ring;
      }
    }
  }
}

// Bent far, upper arm and forearm go into each other, and a way around one leads through the other.
TEST_F(SleevesTest, InTheCrookOfAnElbowItLiesOutsideOfBothLimbs) {
  constexpr float kCrushed = 0.05f;  // no shift makes room in it
  constexpr size_t kWhole = 9;       // rings from which on it is laid close as a whole
  for (const float angle : {1.8f, 2.1f, 2.4f, -2.4f}) {
    Bend(angle);
    std::vector<float> sleeve = Worn(
        0.4f, [](float along) { return along < 0.25f ? 0.0f : 0.15f; }, kCrushed);
    Thread(&sleeve);
    size_t crossed = 0;
    for (size_t i = 3 * kWhole * kAround; i < sleeve.size(); i += 3) {
      float from[2] = {};
      for (size_t bone = 0; bone < 2; ++bone) {
        const engine::LimbCore& core = limbs_.cores[bone];
        from[bone] =
            std::sqrt(engine::PlaceOnBone(core.posed_from, core.along, core.inverse_squared, &sleeve[i]).squared);
        EXPECT_GT(from[bone], kArm) << angle << " ring " << i / 3 / kAround << " vertex " << i / 3 % kAround;
      }
      crossed += from[0] < kArm + 0.02f && from[1] < kArm + 0.02f;
    }
    EXPECT_GT(crossed, kAround) << angle << ": cloth between the limbs";
  }
}

TEST_F(SleevesTest, BendingFurtherMovesItSmoothly) {
  constexpr float kBend = 0.002f;
  std::vector<float> last;
  float most = 0;
  for (float angle = 1.2f; angle < 2.4f; angle += kBend) {
    Bend(angle);
    std::vector<float> sleeve = Worn(0.2f, [](float along) { return along < 0.25f ? 0.0f : 0.15f; });
    Thread(&sleeve);
    for (size_t i = 0; i < sleeve.size() && !last.empty(); ++i) most = std::fmax(most, std::fabs(sleeve[i] - last[i]));
    last = sleeve;
  }
  EXPECT_LT(most, 0.01f) << "the hand moves by 0.6 mm a step";
}

// Nothing jumps as the arm leaves the sleeve.
TEST_F(SleevesTest, DriftingAsideMovesItSmoothly) {
  constexpr float kDrift = 0.0005f;
  Bend(1.2f);
  std::vector<float> last;
  float most = 0, moved = 0;
  for (int step = 0; step < 200; ++step) {
    std::vector<float> sleeve =
        Worn(0.3f, [&](float along) { return along < 0.3f ? 0.0f : kDrift * static_cast<float>(step); });
    const std::vector<float> before = sleeve;
    Thread(&sleeve);
    for (size_t i = 0; i < sleeve.size(); ++i) {
      if (step > 0) most = std::fmax(most, std::fabs(sleeve[i] - last[i]));
      moved = std::fmax(moved, std::fabs(sleeve[i] - before[i]));
    }
    last = sleeve;
  }
  EXPECT_GT(moved, 0.05f);
  EXPECT_LT(most, 0.01f);
}

// A cuff that swings back over its arm, slid along it, where all rings before it are lost.
TEST_F(SleevesTest, ARingAmongLostOnesMovesNoOther) {
  constexpr float kDrift = 0.0005f, kSlid = 0.06f;
  constexpr size_t kCuff = 3 * (kRings - 3) * kAround;
  Bend(1.2f);
  std::vector<float> last;
  float most = 0;
  for (int step = 0; step < 200; ++step) {
    const float cuff = 0.1f - kDrift * static_cast<float>(step);
    std::vector<float> sleeve = Worn(0, [&](float along) {
      return along < 0.3f ? 0.0f : along < 0.39f ? 0.15f : cuff;
    });
    const float* forearm = matrices_.data() + 12;
    for (size_t i = kCuff; i < sleeve.size(); ++i) sleeve[i] -= kSlid * forearm[4 * (i % 3) + 1];
    Thread(&sleeve);
    for (size_t i = 0; i < kCuff && step > 0; ++i) most = std::fmax(most, std::fabs(sleeve[i] - last[i]));
    last = sleeve;
  }
  EXPECT_LT(most, 0.003f);
}

TEST_F(SleevesTest, MirroredSpacesGiveTheMirrorImage) {
  Bend(1.4f);
  const auto aside = [](float along) { return along < 0.3f ? 0.0f : 0.1f; };
  std::vector<float> sleeve = Worn(0.5f, aside), host = sleeve;
  const std::vector<float> before = sleeve;
  Thread(&sleeve);
  EXPECT_NE(sleeve, before);
  for (size_t i = 0; i < host.size(); i += 3) host[i] *= -100, host[i + 1] *= 100, host[i + 2] *= 100;
  for (size_t i = 0; i < matrices_.size(); i += 4) {
    const float scale = i % 12 == 0 ? -100.0f : 100.0f;
    for (size_t c = 0; c < 4; ++c) matrices_[i + c] *= scale;
  }
  Thread(&host);
  for (size_t i = 0; i < host.size(); ++i)
    EXPECT_NEAR(0.01f * host[i] * (i % 3 == 0 ? -1.0f : 1.0f), sleeve[i], 2e-5f) << i;
}

// Joints without size or torn apart, cloth that is nowhere: an end, and nothing that is no number where there was none.
TEST_F(SleevesTest, BrokenPosesEnd) {
  const std::vector<float> matrices = matrices_;
  for (const float scale : {0.0f, 1e-30f, 1e18f}) {
    matrices_ = matrices;
    for (size_t i = 12; i < 24; ++i) matrices_[i] *= scale;
    for (const float size : {0.0f, 1.0f, 1e15f}) {
      std::vector<float> sleeve = bound_;
      for (float& x : sleeve) x *= size;
      Thread(&sleeve);
      for (const float x : sleeve) ASSERT_TRUE(std::isfinite(x)) << scale << " " << size;
    }
  }
}

}  // namespace
}  // namespace dcloth::testing

#include "converter/clip_metrics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/unit/converter/converter_testing.h"

namespace dcloth::converter {
namespace {

// A regular grid of triangles that closes in both directions: six neighbours everywhere.
constexpr size_t kRows = 24, kVertices = kRows * kRows;

std::vector<uint16_t> Torus() {
  std::vector<uint16_t> out;
  const auto at = [](size_t r, size_t c) { return static_cast<uint16_t>((r % kRows) * kRows + c % kRows); };
  for (size_t r = 0; r < kRows; ++r) {
    for (size_t c = 0; c < kRows; ++c) {
      const uint16_t a = at(r, c), b = at(r + 1, c), d = at(r, c + 1), e = at(r + 1, c + 1);
      for (const uint16_t v : {a, b, d, d, b, e}) out.push_back(v);
    }
  }
  return out;
}

// Hips that turn about +Y and travel.
ClipTruth::Hips HipsAt(size_t t) {
  const float s = std::sin(0.2f * static_cast<float>(t)), c = std::cos(0.2f * static_cast<float>(t));
  return {c, 0, s, 0.1f * static_cast<float>(t), 0, 1, 0, 1, -s, 0, c, 0.5f};
}

// Frames [count, n, 3] of `local(t, vertex)` in the hips' frame, in world space.
template <typename Local>
std::vector<float> World(size_t count, Local local) {
  std::vector<float> out;
  for (size_t t = 0; t < count; ++t) {
    const ClipTruth::Hips h = HipsAt(t);
    for (size_t i = 0; i < kVertices; ++i) {
      const std::array<float, 3> p = local(t, i);
      for (size_t r = 0; r < 3; ++r) {
        out.push_back(h[4 * r] * p[0] + h[4 * r + 1] * p[1] + h[4 * r + 2] * p[2] + h[4 * r + 3]);
      }
    }
  }
  return out;
}

// Neighbours a hundredth of a metre apart, whatever the seams.
std::array<float, 3> Rest(size_t i) {
  return {0.01f * static_cast<float>(i % kRows), 0.01f * static_cast<float>(i / kRows), 0.0f};
}

std::vector<float> RestShape() {
  std::vector<float> out;
  for (size_t i = 0; i < kVertices; ++i) {
    for (const float x : Rest(i)) out.push_back(x);
  }
  return out;
}

class ClipMetricsTest : public ::testing::Test {
 protected:
  ClipMetricsTest() : mesh_(Torus(), RestShape()) {}

  ClipError Compare(const std::vector<float>& predicted, const std::vector<float>& truth) const {
    std::vector<ClipTruth::Frame> frames;
    std::vector<ClipTruth::Hips> hips;
    for (size_t t = 0; t < truth.size() / (3 * kVertices); ++t) {
      frames.push_back(std::span(truth).subspan(3 * kVertices * t, 3 * kVertices));
      hips.push_back(HipsAt(t));
    }
    return ClipTruth(mesh_, frames, hips).Compare(predicted);
  }

  ClothMesh mesh_;
};

constexpr size_t kFrames = kWarmUpFrames + 6;

// Sways by 20 mm as a whole, times `share`, about the rest shape moved by `offset`.
auto Swaying(float share, float offset = 0) {
  return [=](size_t t, size_t i) {
    std::array<float, 3> p = Rest(i);
    p[0] += share * (t % 2 == 0 ? 0.02f : -0.02f);
    p[1] += offset;
    return p;
  };
}

TEST_F(ClipMetricsTest, GarmentBoltedToTheHipsMissesAllThatMoves) {
  const ClipError found = Compare(World(kFrames, Swaying(0)), World(kFrames, Swaying(1)));
  EXPECT_NEAR(found.alive_mm, 20, 1e-3);
  EXPECT_NEAR(found.motion_error_mm, 20, 1e-3);
  EXPECT_NEAR(found.offset_mm, 0, 1e-3);
  EXPECT_NEAR(found.predicted_alive_mm, 0, 1e-3);
  EXPECT_NEAR(found.fine_motion_mm, 0, 2e-3);
  EXPECT_NEAR(found.jitter_truth_rms_mm, 80, 1e-2);
  EXPECT_NEAR(found.jitter_rms_mm, 0, 1e-2);
  EXPECT_NEAR(found.strain_p99, 0, 1e-4);
  EXPECT_NEAR(found.bands[0].error_mm, 20, 2e-3);
  EXPECT_NEAR(found.bands[0].truth_rms_mm, 20, 2e-3);
  EXPECT_NEAR(found.bands[2].error_mm, 0, 2e-3);
  EXPECT_FALSE(found.calm_mm);
}

TEST_F(ClipMetricsTest, OffsetAndMotionAreSplit) {
  const ClipError found = Compare(World(kFrames, Swaying(0.5f, 0.005f)), World(kFrames, Swaying(1)));
  EXPECT_NEAR(found.offset_mm, 5, 1e-3);
  EXPECT_NEAR(found.motion_error_mm, 10, 1e-3);
  EXPECT_NEAR(found.bands[0].error_mm, std::sqrt(125.0), 2e-3);
  EXPECT_NEAR(found.bands[0].rms_mm, 10, 2e-3);
  EXPECT_NEAR(found.jitter_rms_mm, 40, 1e-2);
}

TEST_F(ClipMetricsTest, FirstFramesDoNotCountButInAShortClip) {
  const std::vector<float> truth = World(kFrames, Swaying(1));
  std::vector<float> predicted = truth;
  for (size_t i = 0; i < kWarmUpFrames * 3 * kVertices; ++i) predicted[i] += 1;
  EXPECT_NEAR(Compare(predicted, truth).bands[0].error_mm, 0, 1e-6);
  const size_t shorter = kWarmUpFrames * 3 * kVertices;
  EXPECT_GT(Compare({predicted.begin(), predicted.begin() + shorter}, {truth.begin(), truth.begin() + shorter})
                .bands[0]
                .error_mm,
            1000);
  predicted.pop_back();
  EXPECT_THROW(Compare(predicted, truth), Error);
}

// Waves over a closed grid are eigenvectors of the averaging: each step multiplies them by a known number.
TEST_F(ClipMetricsTest, BandsAreWhatRepeatedAveragingLeaves) {
  for (const auto& [p, q] : {std::pair(1, 0), std::pair(3, 1), std::pair(12, 0)}) {
    const double u = 2 * std::numbers::pi * p / kRows, v = 2 * std::numbers::pi * q / kRows;
    const double factor = 0.5 + (std::cos(u) + std::cos(v) + std::cos(u - v)) / 6;
    const double coarse = std::pow(factor, 40), little = std::pow(factor, 8);
    const std::array<double, 3> shares = {coarse, little - coarse, 1 - little};
    double length = 0, square = 0;
    const auto wave = [&](size_t i) {
      return 0.01 * std::cos(u * static_cast<double>(i / kRows) + v * static_cast<double>(i % kRows));
    };
    for (size_t i = 0; i < kVertices; ++i) length += std::abs(wave(i)), square += wave(i) * wave(i);
    const double mean_mm = 1000 * length / kVertices, rms_mm = 1000 * std::sqrt(square / kVertices);
    const auto waving = [&](size_t t, size_t i) {
      std::array<float, 3> out = Rest(i);
      out[2] += static_cast<float>(t % 2 == 0 ? wave(i) : -wave(i));
      return out;
    };
    const ClipError found = Compare(World(kFrames, Swaying(0)), World(kFrames, waving));
    for (size_t b = 0; b < 3; ++b) {
      EXPECT_NEAR(found.bands[b].error_mm, shares[b] * mean_mm, 2e-3) << p << " " << q << " band " << b;
      EXPECT_NEAR(found.bands[b].truth_rms_mm, shares[b] * rms_mm, 2e-3) << p << " " << q << " band " << b;
    }
    EXPECT_NEAR(found.fine_motion_mm, (1 - coarse) * mean_mm, 2e-3);
  }
}

TEST_F(ClipMetricsTest, CalmGarmentMustNotBreathe) {
  const ClipError found = Compare(World(kFrames, Swaying(0.2f)), World(kFrames, Swaying(0.05f)));
  ASSERT_TRUE(found.calm_mm);
  EXPECT_NEAR(*found.calm_mm, 3, 1e-3);
}

TEST_F(ClipMetricsTest, StrainIsAgainstTheRestShape) {
  const auto larger = [](size_t, size_t i) {
    std::array<float, 3> p = Rest(i);
    for (float& x : p) x *= 1.1f;
    return p;
  };
  EXPECT_NEAR(Compare(World(kFrames, larger), World(kFrames, Swaying(1))).strain_p99, 0.1, 1e-4);
}

TEST(OverClipsTest, ClipsWeighTheSameAndSquaresAreSummed) {
  ClipError a, b, none;
  a.clip_count = b.clip_count = 1;
  a.alive_mm = 10, b.alive_mm = 50;
  a.bands[2].rms_mm = 3, b.bands[2].rms_mm = 4, b.calm_mm = -1;
  const std::array<ClipError, 3> clips = {a, none, b};
  const ClipError found = OverClips(clips);
  EXPECT_EQ(found.clip_count, 2u);
  EXPECT_DOUBLE_EQ(found.alive_mm, 30);
  EXPECT_DOUBLE_EQ(found.bands[2].rms_mm, 5 / std::sqrt(2.0));
  EXPECT_DOUBLE_EQ(*found.calm_mm, -1);
  EXPECT_FALSE(found.held_mm);
  EXPECT_EQ(OverClips({}).clip_count, 0u);
}

}  // namespace
}  // namespace dcloth::converter

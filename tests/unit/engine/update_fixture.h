// Clothes that are updated frame by frame, and ways to look at the displacement alone.
#ifndef DCLOTH_TESTS_UNIT_ENGINE_UPDATE_FIXTURE_H_
#define DCLOTH_TESTS_UNIT_ENGINE_UPDATE_FIXTURE_H_

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "tests/unit/engine/cloth_fixture.h"

namespace dcloth::testing {

constexpr uint32_t kAll = DCLOTH_STAGES_MESH;
constexpr double kTick = 1.0 / 30;

// A frame time of a steady host or, at rate 0, of one that wobbles between 4 and 40 ms.
inline std::vector<float> FrameSeconds(double rate, double seconds) {
  std::mt19937 random(11);
  std::uniform_real_distribution<float> uneven(0.004f, 0.04f);
  std::vector<float> frames = {0};
  for (double time = 0; time < seconds; time += static_cast<double>(frames.back()))
    frames.push_back(rate > 0 ? static_cast<float>(1 / rate) : uneven(random));
  return frames;
}

inline double LargestDistance(const std::vector<float>& a, const std::vector<float>& b) {
  double largest = 0;
  for (size_t i = 0; i + 2 < a.size(); i += 3) {
    double square = 0;
    for (size_t c = 0; c < 3; ++c) {
      const double d = static_cast<double>(a[i + c]) - static_cast<double>(b[i + c]);
      square += d * d;
    }
    largest = std::max(largest, std::sqrt(square));
  }
  return largest;
}

class UpdateTest : public ::testing::Test {
 protected:
  static TestModel Build(uint32_t rings = 6) {
    ModelSpec spec;
    spec.rings = rings;
    return BuildModel(spec);
  }
  std::vector<float> Pose(double seconds) const { return PoseAt(model_.numbers, seconds); }

  // Without drawing unless `output` says so.
  static dcloth_status Update(OwnedCloth* cloth, const std::vector<float>& matrices, float seconds, uint32_t flags = 0,
                              const dcloth_output* output = nullptr) {
    const dcloth_pose pose = OwnedCloth::Pose(matrices);
    const dcloth_frame frame = {sizeof(frame), kAll, seconds, flags, nullptr};
    return dcloth_cloth_update(cloth->get(), &pose, &frame, output, nullptr);
  }

  // Draws what the last update left, on another pose: time stands still.
  static std::vector<float> DrawOn(OwnedCloth* cloth, const std::vector<float>& matrices,
                                   const std::vector<float>& back, uint32_t flags = 0) {
    EXPECT_EQ(cloth->Update(matrices, 0, kAll, flags), DCLOTH_OK);
    const std::vector<float> drawn = cloth->positions();
    EXPECT_EQ(Update(cloth, back, 0, flags), DCLOTH_OK);
    return drawn;
  }

  // The newest tick on a pose.
  static std::vector<float> Newest(OwnedCloth* cloth, const std::vector<float>& matrices) {
    EXPECT_EQ(cloth->Skin(matrices, 1), DCLOTH_OK);
    return cloth->positions();
  }

  static dcloth_cloth_info Describe(OwnedCloth* cloth) {
    dcloth_cloth_info info = {};
    info.struct_size = sizeof(info);
    EXPECT_EQ(dcloth_cloth_describe(cloth->get(), &info), DCLOTH_OK);
    return info;
  }

  // How many ticks the last direct update ran.
  static int TicksRun(OwnedCloth* cloth) {
    return static_cast<int>(std::lround(static_cast<double>(Describe(cloth).tick_share)));
  }

  TestModel model_ = Build();
  OpenedModel opened_{model_};
};

}  // namespace dcloth::testing

#endif  // DCLOTH_TESTS_UNIT_ENGINE_UPDATE_FIXTURE_H_

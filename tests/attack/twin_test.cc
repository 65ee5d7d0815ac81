// Frames that keep cloth outside of the body hang on nothing but the saved state: a cloth that takes the state of
// another draws on as that one does, to the bit, whatever its own memory held before. Poses are wild, and vertices not
// always numbers. The kept files are mutants that broke this: in one a place in scratch was read before it was written,
// in the other a coordinate that is not a number was made an integer (UndefinedBehaviorSanitizer stops there).
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <vector>

#include "tests/attack/corruption.h"
#include "tests/attack/open_and_run.h"
#include "tests/attack/variants.h"
#include "tests/unit/engine/cloth_fixture.h"

namespace dcloth::testing {
namespace {

struct File {
  std::string name;
  AlignedBytes bytes;
};

void PrintTo(const File& file, std::ostream* out) { *out << file.name; }

std::vector<File> Files() {
  std::vector<File> files;
  for (const char* name : {"stale_scratch", "not_a_number"}) {
    const std::filesystem::path folder = DCLOTH_KEPT_MODELS;
    std::ifstream in(folder / (std::string(name) + ".dcloth"), std::ios::binary);
    const std::vector<char> bytes((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
    files.push_back({name, AlignedBytes(bytes.data(), bytes.size())});
  }
  for (const Variant& variant : Variants()) {
    if (variant.spec.body) files.push_back({variant.name, BuildModel(variant.spec).Bytes()});
  }
  ModelSpec spec;
  spec.parents = spec.body = true;
  files.push_back({"large_body", BuildModel(spec).Bytes()});
  spec.touch = true;
  files.push_back({"large_touch", BuildModel(spec).Bytes()});
  return files;
}

// Joints turn a little about the upright axis and stand anywhere within half a metre.
std::vector<float> TurnedPose(uint32_t joint_count, uint32_t seed) {
  std::vector<float> matrices;
  std::mt19937 random(seed);
  const auto between = [&](float most) { return std::uniform_real_distribution<float>(-most, most)(random); };
  for (uint32_t j = 0; j < joint_count; ++j) {
    const float turn = between(0.4f), c = std::cos(turn), s = std::sin(turn);
    const float x = between(0.3f), y = 1 + between(0.1f);
    matrices.insert(matrices.end(), {c, 0, s, x, 0, 1, 0, y, -s, 0, c, 0, 0, 0, 0, 1});
  }
  return matrices;
}

// Any floats that a pose may hold: one kind for all joints, up to the largest, subnormal, of random bits.
std::vector<float> WildPose(uint32_t joint_count, uint32_t seed) {
  std::mt19937 random(seed);
  const uint32_t kind = random() % 4;
  std::vector<float> matrices(size_t{16} * joint_count);
  for (float& value : matrices) {
    const uint32_t bits = static_cast<uint32_t>(random());
    if (kind == 0) value = std::uniform_real_distribution<float>(-1e9f, 1e9f)(random);
    if (kind == 1) value = (bits % 2 == 0 ? 1e9f : 0.0f) * (bits % 3 == 0 ? -1.0f : 1.0f);
    if (kind == 2) value = bits % 2 == 0 ? 1e-40f : -1e-40f;
    if (kind != 3) continue;
    std::memcpy(&value, &bits, sizeof(value));
    if (!(std::fabs(value) <= 1e9f)) value = 0;
  }
  return matrices;
}

class TwinTest : public ::testing::TestWithParam<File> {
 protected:
  // All of it as `seed` has it.
  std::vector<float> Draw(OwnedCloth* cloth, uint32_t seed) {
    std::mt19937 random(seed);
    const uint32_t joints = opened_.info().joint_count;
    const uint32_t kind = random() % 8;
    const std::vector<float> matrices = kind == 0   ? TwistedPose(joints, random(), 0.3f)
                                        : kind == 1 ? WildPose(joints, random())
                                                    : TurnedPose(joints, random());
    constexpr uint32_t kStages[] = {DCLOTH_STAGES_STATIC, DCLOTH_STAGES_SKELETON, DCLOTH_STAGES_MESH};
    const uint32_t stages = kStages[random() % 3], flags = random() % 5 < 3 ? 0 : random() % 32;
    const float seconds = random() % 10 == 0 ? 0 : 1.0f / static_cast<float>(30 + random() % 115);
    std::vector<float> positions(3 * size_t{opened_.info().vertex_count});
    dcloth_output output = FloatOutput(positions.size() / 3, positions.data(), 12, nullptr);
    output.flags = DCLOTH_OUTPUT_OUTSIDE_BODY;
    const dcloth_pose pose = OwnedCloth::Pose(matrices);
    const dcloth_frame frame = {sizeof(frame), stages, seconds, flags, nullptr};
    EXPECT_EQ(dcloth_cloth_update(cloth->get(), &pose, &frame, &output, nullptr), DCLOTH_OK);
    return positions;
  }

  OpenedModel opened_{GetParam().bytes};
};

TEST_P(TwinTest, ARestoredClothDrawsAsTheSavedOneDoes) {
  ASSERT_EQ(opened_.status(), DCLOTH_OK) << opened_.error().text;
  ASSERT_GT(dcloth_model_body_vertex_count(opened_.get()), 0u);
  std::mt19937 random(2);
  for (int trial = 0; trial < 60; ++trial) {
    SCOPED_TRACE(trial);
    OwnedCloth saved(opened_), restored(opened_);
    for (size_t k = 0, count = random() % 8; k < count; ++k) Draw(&saved, random());
    for (size_t k = 0, count = random() % 6; k < count; ++k) Draw(&restored, random());
    std::vector<uint8_t> state(dcloth_cloth_state_size(saved.get()));
    ASSERT_EQ(dcloth_cloth_save(saved.get(), state.data(), state.size(), nullptr), DCLOTH_OK);
    ASSERT_EQ(dcloth_cloth_restore(restored.get(), state.data(), state.size(), 0, nullptr), DCLOTH_OK);
    for (int frame = 0; frame < 4; ++frame) {
      const uint32_t seed = random();
      const std::vector<float> one = Draw(&saved, seed), other = Draw(&restored, seed);
      ASSERT_EQ(std::memcmp(one.data(), other.data(), one.size() * sizeof(float)), 0) << "frame " << frame;
    }
  }
}

TEST_P(TwinTest, IsPlayedWithEveryFlag) {
  const Outcome outcome = OpenAndRun(GetParam().bytes.data(), GetParam().bytes.size());
  EXPECT_EQ(outcome.status, DCLOTH_OK) << outcome.text;
  EXPECT_EQ(outcome.broken_promise, "");
}

INSTANTIATE_TEST_SUITE_P(Every, TwinTest, ::testing::ValuesIn(Files()),
                         [](const auto& test) { return test.param.name; });

}  // namespace
}  // namespace dcloth::testing

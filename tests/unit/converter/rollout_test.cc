#include "converter/rollout.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <regex>
#include <vector>

#include "converter/convert.h"
#include "tests/unit/converter/converter_testing.h"

namespace dcloth::converter {
namespace {

AlignedBytes Model(const BundleSpec& spec) { return Convert(ParseBundle(spec), {}).bytes; }

TEST(RolloutTest, VisitsEveryFrameAndForgetsBetweenRuns) {
  BundleSpec spec;
  const OpenModel model(Model(spec));
  const Sequence sequence = ParseSequence(spec, 9);
  std::vector<std::vector<float>> runs(2);
  for (std::vector<float>& run : runs) {
    size_t next = 0;
    Rollout(model, sequence, DCLOTH_STAGES_MESH,
            [&](size_t frame, std::span<const float> positions, std::span<const float> normals) {
              EXPECT_EQ(frame, next++);
              EXPECT_EQ(positions.size(), 3 * spec.vertices);
              EXPECT_EQ(normals.size(), 3 * spec.vertices);
              run.insert(run.end(), positions.begin(), positions.end());
            });
    EXPECT_EQ(next, 9u);
  }
  EXPECT_EQ(runs[0], runs[1]);
}

// Each frame a tick and its skinning at the pose itself, as a host would call them.
TEST(RolloutTest, FramesAreTicksOfTheEngine) {
  BundleSpec spec;
  const OpenModel model(Model(spec));
  const Sequence sequence = ParseSequence(spec, 12);
  AlignedBytes memory(dcloth_cloth_storage_size(model.model()));
  dcloth_cloth* cloth = nullptr;
  ASSERT_EQ(dcloth_cloth_create(model.model(), memory.data(), memory.size(), &cloth, nullptr), DCLOTH_OK);
  const std::vector<uint32_t> map = MapJoints(sequence, model.joint_names());
  std::vector<float> matrices(16 * map.size()), positions(3 * spec.vertices), normals(positions.size());
  Rollout(model, sequence, DCLOTH_STAGES_MESH,
          [&](size_t frame, std::span<const float> found, std::span<const float> found_normals) {
            GatherPose(sequence, frame, map, matrices);
            dcloth_pose pose = {};
            pose.struct_size = sizeof(pose);
            pose.joint_count = static_cast<uint32_t>(map.size());
            pose.joint_matrices = matrices.data();
            dcloth_output output = {};
            output.struct_size = sizeof(output);
            output.vertex_count = spec.vertices;
            output.positions = positions.data();
            output.normals = normals.data();
            output.position_stride_bytes = output.normal_stride_bytes = 12;
            ASSERT_EQ(dcloth_cloth_tick(cloth, &pose, DCLOTH_STAGES_MESH, nullptr), DCLOTH_OK);
            ASSERT_EQ(dcloth_cloth_skin(cloth, &pose, 1, &output, nullptr), DCLOTH_OK);
            EXPECT_TRUE(std::ranges::equal(found, positions)) << frame;
            EXPECT_TRUE(std::ranges::equal(found_normals, normals)) << frame;
          });
}

TEST(RolloutTest, OtherRatesAndCharactersAreRefused) {
  BundleSpec spec;
  const OpenModel model(Model(spec));
  const auto ignore = [](size_t, std::span<const float>, std::span<const float>) {};
  EXPECT_TRUE(
      Mentions(ErrorText([&] { Rollout(model, ParseSequence(spec, 2, 60), 1, ignore); }), "resample the sequence"));
  EXPECT_EQ(ErrorText([&] { Rollout(model, ParseSequence(spec, 2, 29.97), 1, ignore); }), "");
  const BundleSpec other{.joints = 4};
  EXPECT_TRUE(
      Mentions(ErrorText([&] { Rollout(model, ParseSequence(other, 2), 1, ignore); }), "no joints joint_4, joint_5"));
  EXPECT_TRUE(Mentions(ErrorText([&] { Rollout(model, ParseSequence(spec, 2), 2, ignore); }),
                       "a failure of the tick of frame 0: ARGUMENT"));
}

// A hundredth more or less than the model's rate is the last that may be.
TEST(RolloutTest, RatesMayDifferByAHundredth) {
  for (const double rate : {23.25, 28.875, 30.0, 60.0}) {
    Bundle bundle = ParseBundle({});
    bundle.tick_rate = rate;
    const OpenModel model(Convert(bundle, {}).bytes);
    const double ticks = 1 / static_cast<double>(model.info().tick_seconds);
    for (const double sign : {-1.0, 1.0}) {
      const auto refused = [&](double fps) {
        Sequence sequence = ParseSequence({}, 1);
        sequence.fps = fps;
        return !ErrorText([&] {
                  Rollout(model, sequence, 1, [](size_t, std::span<const float>, std::span<const float>) {});
                }).empty();
      };
      const double last = ticks + sign * 0.01 * ticks;
      if (rate < 30) {  // for these no rounding is in between
        ASSERT_EQ(std::abs(last - ticks), 0.01 * ticks);
        EXPECT_FALSE(refused(last)) << rate;
      }
      EXPECT_FALSE(refused(last - sign * 1e-9)) << rate;
      EXPECT_TRUE(refused(last + sign * 1e-9)) << rate;
    }
  }
}

TEST(RolloutTest, BadBytesCarryTheEnginesWords) {
  AlignedBytes bytes = Model({});
  bytes.resize(bytes.size() - 64);
  const std::string text = ErrorText([&] { OpenModel(std::move(bytes), "m.dcloth"); });
  EXPECT_TRUE(Mentions(text, "m.dcloth: found "));
  EXPECT_GT(text.size(), 30u);
}

// The engine's text, part by part, for whatever may be wrong with a file.
TEST(RolloutTest, ErrorsAreTheEnginesPartByPart) {
  const AlignedBytes whole = Model({});
  const std::regex form(R"((?:(.*?): )?found (.*?); allowed: (.*?)(?:; (.*))?)");
  size_t placed = 0, unplaced = 0, mended = 0, with_offset = 0;
  const auto check = [&](const AlignedBytes& bytes) {
    AlignedBytes memory(dcloth_model_storage_size());
    dcloth_model* model = nullptr;
    dcloth_error error{};
    error.struct_size = sizeof(error);
    const std::byte* const start = bytes.empty() ? memory.data() : bytes.data();
    if (dcloth_model_open(start, bytes.size(), memory.data(), memory.size(), &model, &error) == DCLOTH_OK) return;
    std::string expected = "m.dcloth: found " + std::string(error.text);
    if (std::cmatch parts; std::regex_match(error.text, parts, form)) {
      expected = "m.dcloth: found " + parts[2].str();
      if (parts[1].matched) expected += " in " + parts[1].str();
      if (error.offset_bytes != UINT64_MAX) expected += " at byte " + std::to_string(error.offset_bytes);
      expected += ", expected " + parts[3].str();
      if (parts[4].matched) expected += "; " + parts[4].str();
      ++(parts[1].matched ? placed : unplaced);
      mended += parts[4].matched ? 1 : 0;
      with_offset += error.offset_bytes != UINT64_MAX ? 1 : 0;
    }
    EXPECT_EQ(ErrorText([&] { OpenModel(bytes, "m.dcloth"); }), expected);
  };
  for (size_t size = 0; size < whole.size(); size += size < 100 ? 1 : 997) {
    check(AlignedBytes(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size)));
  }
  for (size_t at = 0; at < whole.size(); at += at < 4000 ? 3 : 997) {
    AlignedBytes changed = whole;
    changed[at] ^= std::byte{0x41};
    check(changed);
  }
  EXPECT_GT(placed, 0u);
  EXPECT_GT(unplaced, 0u);
  EXPECT_GT(mended, 0u);
  EXPECT_GT(with_offset, 0u);
}

TEST(RolloutTest, AModelDiffersFromItselfByNothing) {
  BundleSpec spec;
  const OpenModel a(Model(spec)), b(Model(spec));
  const std::vector<Sequence> motion = {ParseSequence(spec, 5), ParseSequence(spec, 4)};
  const MeshError same = CompareModels(a, b, motion);
  EXPECT_EQ(same.frame_count, 9u);
  EXPECT_EQ(same.position_mm.max, 0);
  BundleSpec other = spec;
  other.seed = 5;
  EXPECT_GT(CompareModels(OpenModel(Model(other)), a, motion).position_mm.mean, 1);
  other.vertices = 61;
  EXPECT_TRUE(
      Mentions(ErrorText([&] { CompareModels(OpenModel(Model(other)), a, motion); }), "61 vertices in the prediction"));
}

}  // namespace
}  // namespace dcloth::converter

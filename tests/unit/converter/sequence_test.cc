#include "converter/sequence.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "kernels/half.h"
#include "tests/unit/converter/converter_testing.h"

namespace dcloth::converter {
namespace {

std::string SequenceRefusal(const RawFile& raw) {
  return ErrorText([&] { ParseRawSequence(raw); });
}

TEST(SequenceTest, ReadsPosesAndTruth) {
  BundleSpec spec;
  RawFile raw = BuildSequence(spec, 5, true);
  raw.Replace("comment", {2}, {NAN, 1});  // other tensors are ignored
  const Sequence sequence = ParseRawSequence(raw);
  EXPECT_EQ(sequence.frame_count, 5u);
  EXPECT_EQ(sequence.fps, 30);
  EXPECT_EQ(sequence.joint_names.size(), spec.joints);
  EXPECT_EQ(sequence.truth_vertex_count, spec.vertices);
  EXPECT_EQ(sequence.FrameTruth(4).size(), 3 * spec.vertices);
  const Sequence bare = ParseSequence(spec, 1);
  EXPECT_FALSE(bare.has_truth());
}

TEST(SequenceTest, HalfTruthIsAddedToItsOrigin) {
  const BundleSpec spec{.vertices = 9};
  RawFile raw = BuildSequence(spec, 2, true);
  auto& truth = raw.At("truth");
  std::vector<uint16_t> halves(2 * 9 * 3);
  for (size_t i = 0; i < halves.size(); ++i) halves[i] = kernels::HalfFromFloat(static_cast<float>(i) / 64);
  truth.type = SafeType::kF16;
  const auto bytes = std::as_bytes(std::span(halves));
  truth.bytes.assign(bytes.begin(), bytes.end());
  EXPECT_TRUE(Mentions(SequenceRefusal(raw), "F16 without truth_origin"));
  raw.Replace("truth_origin", {2, 3}, {1, 2, 3, 4, 5, 6});
  const Sequence sequence = ParseRawSequence(raw);
  EXPECT_EQ(sequence.truth[0], 1.0f);
  EXPECT_EQ(sequence.truth[4], 2 + 4 / 64.0f);
  EXPECT_EQ(sequence.truth[27], 4 + 27 / 64.0f);
  EXPECT_EQ(sequence.truth[53], 6 + 53 / 64.0f);
  auto& large = raw.At("truth");
  large.type = SafeType::kF32;
  const std::vector<float> huge(2 * 9 * 3, 3e38f);
  const auto huge_bytes = std::as_bytes(std::span(huge));
  large.bytes.assign(huge_bytes.begin(), huge_bytes.end());
  raw.Replace("truth_origin", {2, 3}, {0, 0, 0, 0, 3e38f, 0});
  EXPECT_TRUE(
      Mentions(SequenceRefusal(raw), "truth_origin: found a sum with truth that a float cannot hold at element 28"));
  raw.Replace("truth_origin", {3, 3}, std::vector<float>(9));
  EXPECT_TRUE(Mentions(SequenceRefusal(raw), "truth_origin: found shape [3, 3], expected [2, 3]"));
}

TEST(SequenceTest, FaultsAreRefused) {
  BundleSpec spec;
  const RawFile whole = BuildSequence(spec, 3, true);
  ASSERT_EQ(SequenceRefusal(whole), "");
  RawFile raw = whole;
  raw.Erase("joint_matrices");
  EXPECT_TRUE(Mentions(SequenceRefusal(raw), "tensor joint_matrices: found no such tensor"));
  raw = whole;
  raw.At("joint_matrices").shape = {3, 6, 16};
  EXPECT_TRUE(Mentions(SequenceRefusal(raw), "shape [3, 6, 16], expected [T, 6, 4, 4]"));
  raw = whole;
  raw.Replace("joint_matrices", {0, 6, 4, 4}, {});
  EXPECT_TRUE(Mentions(SequenceRefusal(raw), "T of 1 or more"));
  raw = whole;
  raw.Replace("truth", {2, spec.vertices, 3}, std::vector<float>(6 * spec.vertices));
  EXPECT_TRUE(Mentions(SequenceRefusal(raw), "tensor truth: found shape [2, 60, 3], expected [3, n, 3]"));
  raw = whole;
  raw.SetFloat("joint_matrices", 17, NAN);
  EXPECT_TRUE(Mentions(SequenceRefusal(raw), "NaN at element 17"));
  raw = whole;
  raw.SetFloat("truth", 3, INFINITY);
  EXPECT_TRUE(Mentions(SequenceRefusal(raw), "infinity at element 3"));
  raw = whole;
  raw.SetFloat("joint_matrices", 16 * 7 + 12, 0.4f);  // a translation where a transposed matrix has it
  EXPECT_TRUE(Mentions(SequenceRefusal(raw), "frame 1, joint 'joint_1'"));
  for (const char* fps : {"0", "-30", "inf", "", "30 Hz"}) {
    raw = whole;
    raw.metadata["fps"] = fps;
    EXPECT_TRUE(Mentions(SequenceRefusal(raw), "metadata 'fps'")) << fps;
  }
  raw = whole;
  raw.metadata["joint_names"] = R"(["a","a"])";
  EXPECT_TRUE(Mentions(SequenceRefusal(raw), "'a' twice"));
}

TEST(SequenceTest, ShapesAreRefusedAxisByAxis) {
  const RawFile whole = BuildSequence({}, 2, true);
  const auto refusal = [&](const char* name, const Shape& shape) {
    RawFile raw = whole;
    size_t count = 1;
    for (const uint64_t extent : shape) count *= extent;
    raw.Replace(name, shape, std::vector<float>(count));
    return SequenceRefusal(raw);
  };
  for (const Shape& shape : {Shape{2, 6, 4}, Shape{2, 6, 4, 4, 1}, Shape{2, 5, 4, 4}, Shape{2, 7, 4, 4},
                             Shape{2, 6, 5, 4}, Shape{2, 6, 4, 5}}) {
    EXPECT_TRUE(Mentions(refusal("joint_matrices", shape), "shape " + ShapeText(shape) + ", expected [T, 6, 4, 4]"));
  }
  for (const Shape& shape : {Shape{2, 60}, Shape{2, 60, 3, 1}, Shape{1, 60, 3}, Shape{2, 0, 3}, Shape{2, 60, 4}}) {
    EXPECT_TRUE(Mentions(refusal("truth", shape), "shape " + ShapeText(shape) + ", expected [2, n, 3]"));
  }
  for (const Shape& shape : {Shape{2}, Shape{2, 4}, Shape{1, 3}, Shape{2, 3, 1}}) {
    EXPECT_TRUE(Mentions(refusal("truth_origin", shape), ShapeText(shape) + ", expected [2, 3]"));
  }
  EXPECT_EQ(refusal("truth", {2, 1, 3}), "");
  RawFile halves = whole;
  halves.Replace("truth_origin", {2, 3}, std::vector<float>(6));
  EXPECT_EQ(SequenceRefusal(halves), "");
  halves.At("truth_origin").type = SafeType::kF16;
  halves.At("truth_origin").bytes.resize(12);
  EXPECT_TRUE(Mentions(SequenceRefusal(halves), "truth_origin: found dtype F16, expected F32"));
  halves = whole;
  halves.At("joint_matrices").type = SafeType::kF16;
  halves.At("joint_matrices").bytes.resize(2 * 6 * 16 * 2);
  EXPECT_TRUE(Mentions(SequenceRefusal(halves), "dtype F16, expected F32"));
}

// By less than 1e-5, in any number of the row, in any joint and frame.
TEST(SequenceTest, LastRowsMayMissByRoundings) {
  const RawFile whole = BuildSequence({}, 3);
  for (const size_t matrix : {0, 7, 17}) {
    for (const size_t column : {0, 1, 2, 3}) {
      for (const float sign : {-1.0f, 1.0f}) {
        const auto refusal = [&](float off) {
          RawFile raw = whole;
          raw.SetFloat("joint_matrices", 16 * matrix + 12 + column, (column == 3 ? 1.0f : 0.0f) + sign * off);
          return SequenceRefusal(raw);
        };
        EXPECT_EQ(refusal(column == 3 ? 0x53p-23f : 1e-5f), "");  // beside 1 floats are 2^-23 or 2^-24 apart
        const std::string place =
            "in frame " + std::to_string(matrix / 6) + ", joint 'joint_" + std::to_string(matrix % 6) + "'";
        EXPECT_TRUE(Mentions(refusal(column == 3 ? 0x54p-23f : std::nextafter(1e-5f, 1.0f)), place));
      }
    }
  }
}

TEST(SequenceTest, MapsByNameAndListsAllMissing) {
  const Sequence sequence = ParseSequence({}, 2);
  const std::string wanted[] = {"joint_4", "joint_0"};
  const std::vector<uint32_t> map = MapJoints(sequence, wanted);
  EXPECT_EQ(map, (std::vector<uint32_t>{4, 0}));
  std::vector<float> pose(48, -7.0f);
  const uint32_t one_more[] = {map[0], map[1], 2};
  GatherPose(sequence, 1, std::span(one_more).first(2), pose);
  EXPECT_EQ(std::count(pose.begin() + 32, pose.end(), -7.0f), 16) << "as many matrices as joints";
  pose.resize(32);
  EXPECT_TRUE(std::equal(pose.begin(), pose.begin() + 16, sequence.joint_matrices.begin() + 16 * (6 + 4)));
  EXPECT_TRUE(std::equal(pose.begin() + 16, pose.end(), sequence.joint_matrices.begin() + 16 * 6));
  const std::string more[] = {"tail", "joint_1", "wing"};
  EXPECT_TRUE(Mentions(ErrorText([&] { MapJoints(sequence, more); }), "no joints tail, wing,",
                       "has joint_0, joint_1, joint_2, joint_3, joint_4, joint_5;"));
}

TEST(SequenceTest, RunOutputReadsBack) {
  const std::vector<float> positions = {0, 1, 2, 3, 4, 5, 6, 7, 8};
  const std::vector<uint16_t> triangles = {0, 2, 1, 1, 2, 0};
  const std::filesystem::path path = std::filesystem::path(::testing::TempDir()) / "dcloth_run_output_test";
  WriteRunOutput(path, {"skirt", 29.97, 1, 3, positions, triangles});
  const SafeFile file = SafeFile::Read(path);
  std::filesystem::remove(path);
  EXPECT_EQ(file.RequireMetadata("fps"), "29.97");
  EXPECT_EQ(file.RequireMetadata("format"), "dcloth-run");
  EXPECT_EQ(file.Require("positions").shape, (Shape{1, 3, 3}));
  EXPECT_EQ(FloatsOf(file, file.Require("positions")), positions);
  EXPECT_EQ(file.Require("faces").shape, (Shape{2, 3}));
  EXPECT_EQ(file.Require("faces").bytes[4], std::byte{2});
  EXPECT_TRUE(Mentions(ErrorText([&] {
                         WriteRunOutput(path, {"skirt", 30, 2, 3, positions, triangles});
                       }),
                       "positions: found 36 bytes"));
  EXPECT_FALSE(std::filesystem::exists(path));
}

}  // namespace
}  // namespace dcloth::converter

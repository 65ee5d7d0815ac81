#include "converter/convert.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <numeric>
#include <utility>
#include <vector>

#include "converter/assemble.h"
#include "converter/rollout.h"
#include "converter/stages.h"
#include "dcloth/dcloth.h"
#include "tests/unit/converter/converter_testing.h"

namespace dcloth::converter {
namespace {

TEST(ConvertTest, EngineOpensEverySizeAndPrecision) {
  std::vector<BundleSpec> specs(8);
  specs[1].mesh = false;
  specs[2].mesh = specs[2].skeleton = false;
  specs[3].vertices = 331, specs[3].joints = 20, specs[3].bones = 17, specs[3].skeleton_basis = 33,
  specs[3].mesh_basis = 1;
  specs[4].feature_width = 24, specs[4].layers = 1, specs[4].mesh_width = 1;
  specs[4].root_motion = RootMotion::kAir;
  specs[5].root_motion = RootMotion::kNone, specs[5].bones = 1, specs[5].skeleton_basis = 1;
  specs[6].half_weights = true, specs[6].static_width = 1, specs[6].feature_joints = 1;
  specs[7].feature_width = 64, specs[7].layers = 8;
  for (const BundleSpec& spec : specs) {
    const Bundle bundle = ParseBundle(spec);
    uint64_t last = UINT64_MAX;
    for (const Precision precision : kPrecisions) {
      const ConvertResult result = Convert(bundle, {.precision = precision});
      const OpenModel model(result.bytes);
      EXPECT_EQ(model.info().vertex_count, spec.vertices);
      EXPECT_STREQ(model.info().precision, PrecisionName(precision));
      EXPECT_STREQ(model.info().name, "tube");
      EXPECT_EQ(model.info().stages, spec.mesh ? 7u : spec.skeleton ? 3u : 1u);
      EXPECT_EQ(model.info().tick_seconds, 1.0f / 30);
      EXPECT_EQ(result.report.model_bytes, result.bytes.size());
      EXPECT_EQ(result.bytes.size() % 64, 0u);
      EXPECT_LE(result.report.model_bytes, last);
      last = result.report.model_bytes;
    }
  }
}

TEST(ConvertTest, SameInputGivesSameBytes) {
  const Bundle bundle = ParseBundle({});
  for (const Precision precision : kPrecisions) {
    const AlignedBytes a = Convert(bundle, {.precision = precision}).bytes,
                       b = Convert(ParseBundle({}), {.precision = precision}).bytes;
    ASSERT_EQ(a.size(), b.size());
    EXPECT_EQ(std::memcmp(a.data(), b.data(), a.size()), 0);
  }
  const std::vector<Sequence> motion = {ParseSequence({}, 10)};
  const ConvertOptions ranked{.precision = Precision::kInt8, .rank = {RankMode::kFixed, 7}, .calibration = motion};
  EXPECT_EQ(Convert(bundle, ranked).bytes, Convert(ParseBundle({}), ranked).bytes);
  const BundleSpec other{.seed = 2};
  const AlignedBytes a = Convert(bundle, {}).bytes, c = Convert(ParseBundle(other), {}).bytes;
  EXPECT_TRUE(a.size() != c.size() || std::memcmp(a.data(), c.data(), a.size()) != 0);
}

// All networks at zero: what remains is skinning, and every joint lookup, bind inverse, folding and layout with it.
TEST(ConvertTest, PlainSkinningAgreesWithDouble) {
  for (const uint32_t vertices : {9u, 60u, 331u}) {
    const BundleSpec spec{.vertices = vertices, .joints = 11, .bones = 5};
    Bundle bundle = ParseBundle(spec);
    bundle.static_increments.weight.setZero();
    bundle.static_increments.bias.setZero();
    bundle.skeleton->basis.setZero();
    bundle.mesh->basis.setZero();
    const Sequence sequence = ParseSequence(spec, 12);
    for (const Precision precision : kPrecisions) {
      ConvertOptions options{.precision = precision};
      options.influences = 5;  // all of them: nothing is pruned
      const ConvertResult result = Convert(bundle, options);
      EXPECT_EQ(result.report.influences.removed_worst, 0);
      const OpenModel model(result.bytes);
      Rollout(model, sequence, DCLOTH_STAGES_MESH,
              [&](size_t frame, std::span<const float> positions, std::span<const float>) {
                const MatrixD expected = SkinFrame(bundle, sequence, frame);
                for (Eigen::Index i = 0; i < expected.rows(); ++i) {
                  for (Eigen::Index axis = 0; axis < 3; ++axis) {
                    const auto got = static_cast<double>(positions[static_cast<size_t>(3 * i + axis)]);
                    // Numbers below 4 in size (world within 3 m, entries of G B^-1 likewise), 5 bones of 4 products
                    // each and a few roundings before and after: 40 roundings of half an ulp of 4.
                    ASSERT_NEAR(got, expected(i, axis), 40 * 4 * 0x1p-24) << "frame " << frame << " vertex " << i;
                  }
                }
              });
    }
  }
}

TEST(ConvertTest, NetworksMoveTheCloth) {
  const Bundle bundle = ParseBundle({});
  const Sequence sequence = ParseSequence({}, 8);
  const ConvertResult result = Convert(bundle, {});
  const OpenModel model(result.bytes);
  std::vector<double> distance;
  for (const uint32_t stages : {DCLOTH_STAGES_STATIC, DCLOTH_STAGES_SKELETON, DCLOTH_STAGES_MESH}) {
    double sum = 0;
    Rollout(model, sequence, stages,
            [&](size_t frame, std::span<const float> positions, std::span<const float> normals) {
              const MatrixD plain = SkinFrame(bundle, sequence, frame);
              for (Eigen::Index i = 0; i < plain.rows(); ++i) {
                const float* const p = positions.data() + 3 * i;
                sum += (plain.row(i) - Eigen::RowVector3d(p[0], p[1], p[2])).norm();
                const float* const normal = normals.data() + 3 * i;
                ASSERT_NEAR(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2], 1, 1e-5);
              }
            });
    distance.push_back(sum);
  }
  EXPECT_GT(distance[0], 0);
  EXPECT_NE(distance[0], distance[1]);
  EXPECT_NE(distance[1], distance[2]);
}

TEST(ConvertTest, ReportsTensorsJointsAndPruning) {
  const BundleSpec spec{.joints = 30, .body_vertices = 5};
  const Bundle bundle = ParseBundle(spec);
  ConvertOptions options{.precision = Precision::kInt8};
  options.influences = options.body_influences = 2;
  const std::vector<Sequence> motion = {ParseSequence(spec, 40)};
  options.motion = motion;
  const ConvertReport report = Convert(bundle, options).report;
  const FoldedBundle folded = FoldBundle(bundle, 2, 2);
  EXPECT_EQ(report.joint_count, folded.joints.joints.size());
  EXPECT_EQ(report.dropped_joints, 30 - report.joint_count);
  EXPECT_EQ(report.rank.full, 17u);
  EXPECT_EQ(report.rank.rank, 17u);
  EXPECT_FALSE(report.rank.reduced);
  EXPECT_GT(report.instance_bytes, 0u);
  EXPECT_TRUE(report.influences.measured);
  EXPECT_EQ(report.influences.influences, 2u);
  EXPECT_GT(report.influences.worst_mm, report.influences.mean_mm);
  EXPECT_GT(report.influences.mean_mm, 0);
  EXPECT_GT(report.body_influences.worst_mm, 0);
  uint64_t total = 0;
  bool basis = false, pivots = false, increments = false;
  for (const TensorReport& tensor : report.tensors) {
    total += tensor.size_bytes;
    if (tensor.name == "displacement.basis.weights") {
      basis = tensor.dtype == "i8" && tensor.loss.relative_rms > 0 && tensor.loss.relative_rms < 0.02;
    }
    if (tensor.name == "static_stage.pivots") pivots = tensor.dtype == "f32" && tensor.loss.relative_max == 0;
    if (tensor.name == "static_stage.increments.weights") increments = tensor.dtype == "f16";
  }
  EXPECT_TRUE(basis && pivots && increments);
  EXPECT_LT(total, report.model_bytes);
  EXPECT_GT(total + (uint64_t{1} << 14), report.model_bytes);  // tables, names and gaps
  ASSERT_EQ(report.trials.size(), 1u);
  EXPECT_GT(report.trials[0].error.position_mm.max, 0);
  EXPECT_EQ(report.trials[0].error.frame_count, 40u);
}

// Pruning is measured on up to 256 poses, evenly spaced over all frames, each sequence from its first one on.
TEST(ConvertTest, PruningIsMeasuredOnPosesByHand) {
  const BundleSpec spec{.vertices = 9};
  const Bundle bundle = ParseBundle(spec);
  const std::vector<std::vector<uint32_t>> motions = {{256}, {257}, {3, 2}, {400, 113}, {510, 3}};
  for (const std::vector<uint32_t>& lengths : motions) {
    std::vector<Sequence> motion;
    for (const uint32_t length : lengths) motion.push_back(ParseSequence(spec, length));
    const uint32_t frames = std::accumulate(lengths.begin(), lengths.end(), 0u);
    const uint32_t stride = frames <= 256 ? 1 : frames <= 512 ? 2 : 3;
    ConvertOptions options;
    options.influences = options.body_influences = 2;
    options.motion = motion;
    const ConvertReport report = Convert(bundle, options).report;

    std::vector<std::vector<Eigen::Matrix4d>> bones, joints;
    for (const Sequence& sequence : motion) {
      for (size_t frame = 0; frame < sequence.frame_count; frame += stride) {
        std::vector<Eigen::Matrix4d>& pose = joints.emplace_back();
        for (size_t joint = 0; joint < 6; ++joint) pose.push_back(SkinMatrix(bundle, sequence, frame, joint));
        bones.push_back({pose.begin() + 2, pose.end()});
      }
    }
    const FoldedBundle folded = FoldBundle(bundle, 2, 2);
    const PruneReport cloth = MeasurePruning(folded.skin_weights, folded.skin, bundle.template_positions,
                                             BindPositions(bundle, bundle.bones), bones);
    const PruneReport body = MeasurePruning(folded.body_weights, folded.body, bundle.mesh->nearest_points,
                                            BindPositions(bundle, std::vector<uint32_t>{0, 1, 2, 3, 4, 5}), joints);
    for (const auto& [found, expected] : {std::pair(report.influences, cloth), {report.body_influences, body}}) {
      EXPECT_TRUE(found.measured);
      EXPECT_EQ(found.influences, 2u);
      EXPECT_NEAR(found.mean_mm, expected.mean_mm, 1e-9 * expected.mean_mm) << frames;
      EXPECT_NEAR(found.worst_mm, expected.worst_mm, 1e-9 * expected.worst_mm) << frames;
      EXPECT_EQ(found.bound_worst_mm, expected.bound_worst_mm);
      EXPECT_EQ(found.removed_mean, expected.removed_mean);
    }
  }
}

TEST(ConvertTest, BadOptionsAreRefused) {
  BundleSpec spec;
  const Bundle bundle = ParseBundle(spec);
  auto refusal = [&](auto change) {
    ConvertOptions options;
    change(&options);
    return ErrorText([&] { Convert(bundle, options); });
  };
  EXPECT_TRUE(
      Mentions(refusal([](ConvertOptions* o) { o->influences = 0; }), "0 influences per vertex, expected 1 to 8"));
  for (uint32_t ConvertOptions::*each : {&ConvertOptions::influences, &ConvertOptions::body_influences}) {
    EXPECT_EQ(refusal([&](ConvertOptions* o) { o->*each = 1; }), "");
    EXPECT_EQ(refusal([&](ConvertOptions* o) { o->*each = 8; }), "");
    EXPECT_TRUE(Mentions(refusal([&](ConvertOptions* o) { o->*each = 0; }), "0 influences"));
    EXPECT_TRUE(Mentions(refusal([&](ConvertOptions* o) { o->*each = 9; }), "9 influences"));
  }
  EXPECT_TRUE(Mentions(refusal([](ConvertOptions* o) { o->max_error_mm = 1; }), "pass --motion"));
  EXPECT_TRUE(Mentions(refusal([](ConvertOptions* o) { o->max_error_mm = -1; }), "0 or more"));
  EXPECT_TRUE(Mentions(refusal([](ConvertOptions* o) { o->max_error_mm = NAN; }), "0 or more"));
  EXPECT_TRUE(Mentions(refusal([](ConvertOptions* o) { o->max_error_mm = INFINITY; }), "0 or more"));
  const std::vector<Sequence> own = {ParseSequence(spec, 1)};
  for (const double bound : {0.0, 0.5}) {
    EXPECT_EQ(refusal([&](ConvertOptions* o) { o->max_error_mm = bound, o->motion = own; }), "");
    EXPECT_EQ(refusal([&](ConvertOptions* o) { o->max_error_mm = bound, o->calibration = own; }), "");
  }
  EXPECT_TRUE(Mentions(refusal([](ConvertOptions* o) { o->precision.reset(); }), "--max-error-mm"));
  BundleSpec other = spec;
  other.joints = 5;
  const std::vector<Sequence> motion = {ParseSequence(other, 3)};
  EXPECT_TRUE(Mentions(refusal([&](ConvertOptions* o) { o->motion = motion; }), "no joints joint_5"));
}

TEST(ConvertTest, HalfOverflowNamesBundleTensorAndWayOut) {
  Bundle bundle = ParseBundle({});
  bundle.mesh->basis(2, 5) = 7e4f;
  EXPECT_TRUE(Mentions(ErrorText([&] { Convert(bundle, {.precision = Precision::kFp16}); }), "b.safetensors",
                       "mesh.basis", "[2, 1, 2]", "--precision fp32"));
  EXPECT_EQ(ErrorText([&] { Convert(bundle, {.precision = Precision::kFp32}); }), "");
}

constexpr uint32_t kStages[] = {DCLOTH_STAGES_STATIC, DCLOTH_STAGES_SKELETON, DCLOTH_STAGES_MESH};

Bundle Holding(uint32_t stages) {
  const BundleSpec spec{.skeleton = stages != DCLOTH_STAGES_STATIC, .mesh = stages == DCLOTH_STAGES_MESH};
  return ParseBundle(spec);
}

ConvertOptions Keeping(uint32_t stages) { return {.rank = {.mode = RankMode::kFull}, .stages = stages}; }

TEST(StagesTest, KeepsWhatTheBundleHoldsAndNoMore) {
  for (const uint32_t held : kStages) {
    const Bundle bundle = Holding(held);
    EXPECT_EQ(StagesOf(bundle), held);
    EXPECT_EQ(ParseStages(StagesName(held)), held);
    for (const uint32_t asked : kStages) {
      if (asked <= held) {
        EXPECT_EQ(StagesOf(KeepStages(bundle, asked)), asked);
      } else {
        EXPECT_TRUE(Mentions(ErrorText([&] { KeepStages(bundle, asked); }), "b.safetensors", StagesName(asked),
                             std::string("at most '") + StagesName(held) + "'", "--stages"));
      }
    }
  }
}

// To the bit what the whole model draws when its ticks stop there.
TEST(StagesTest, DrawsWhatTheWholeModelDrawsUpToThere) {
  const Bundle bundle = ParseBundle({});
  const Sequence motion = ParseSequence({}, 20);
  const ConvertResult whole = Convert(bundle, Keeping(DCLOTH_STAGES_MESH));
  const OpenModel all(whole.bytes);
  uint64_t more = whole.report.model_bytes;
  uint32_t joints = whole.report.joint_count;
  for (const uint32_t stages : {DCLOTH_STAGES_SKELETON, DCLOTH_STAGES_STATIC}) {
    const ConvertResult result = Convert(bundle, Keeping(stages));
    const OpenModel model(result.bytes);
    EXPECT_EQ(model.info().stages, stages);
    EXPECT_EQ(result.report.stages, stages);
    EXPECT_EQ(Played(model, motion, stages), Played(all, motion, stages));
    EXPECT_NE(Played(model, motion, stages), Played(all, motion, DCLOTH_STAGES_MESH));
    EXPECT_LT(result.report.model_bytes, more);
    EXPECT_LE(result.report.joint_count, joints);
    more = result.report.model_bytes;
    joints = result.report.joint_count;
  }
}

// What is left out counts as error.
TEST(StagesTest, ErrorsAreAgainstAllStages) {
  const Bundle bundle = ParseBundle({});
  const std::vector<Sequence> motion = {ParseSequence({}, 20)};
  const OpenModel all(Convert(bundle, {}).bytes);
  ConvertOptions options = Keeping(DCLOTH_STAGES_SKELETON);
  options.motion = motion;
  const ConvertResult result = Convert(bundle, options);
  const double missing_mm = result.report.trials.at(0).error.position_mm.max;
  EXPECT_GT(missing_mm, 1) << "the mesh stage of this garment does too little to tell";
  EXPECT_EQ(missing_mm, CompareModels(OpenModel(result.bytes), all, motion).position_mm.max);
  options.max_error_mm = missing_mm;
  EXPECT_EQ(Convert(bundle, options).report.stages, uint32_t{DCLOTH_STAGES_SKELETON});
  options.max_error_mm = 0.99 * missing_mm;
  EXPECT_THROW(Convert(bundle, options), ThresholdError);
  EXPECT_TRUE(Mentions(ErrorText([&] { Convert(bundle, options); }), "fp32", "keep all stages"));
  options.precision.reset();
  EXPECT_THROW(Convert(bundle, options), ThresholdError) << "no format makes up for a stage";
}

}  // namespace
}  // namespace dcloth::converter

// Counted work against the sizes in the report of the conversion, and against formulas written a second time.
#include "converter/model_work.h"

#include <gtest/gtest.h>

#include <initializer_list>
#include <map>
#include <string>

#include "converter/convert.h"
#include "dcloth/dcloth.h"
#include "tests/unit/converter/converter_testing.h"

namespace dcloth::converter {
namespace {

ConvertResult Converted(const BundleSpec& spec, Precision precision) {
  const ConvertOptions options{.precision = precision, .rank = {.mode = RankMode::kFull}};
  return Convert(ParseBundle(spec), options);
}

const PartWork& At(const ModelWork& work, WorkPart part) { return work[static_cast<size_t>(part)]; }

BundleSpec Spec() { return {.vertices = 300, .skeleton_basis = 21, .mesh_basis = 11, .layers = 3}; }

TEST(ModelWorkTest, ProductsReadWhatIsStored) {
  const BundleSpec spec = Spec();
  for (const Precision precision : kPrecisions) {
    const ConvertResult converted = Converted(spec, precision);
    std::map<std::string, uint64_t> stored;
    for (const TensorReport& t : converted.report.tensors) stored[t.name] = t.size_bytes;
    const auto linear = [&](const std::string& name) {
      return stored[name + ".weights"] + stored[name + ".row_scales"] + stored[name + ".column_scales"] +
             stored[name + ".bias"];
    };
    const ModelWork work = CountWork(converted.bytes);
    const auto same = [&](WorkPart part, uint64_t bytes) {
      EXPECT_GT(bytes, 0u);
      EXPECT_EQ(At(work, part).weight_bytes, bytes) << WorkPartName(part) << " " << PrecisionName(precision);
      // The static stage's weights are halves in int8 models.
      EXPECT_EQ(At(work, part).int8, precision == Precision::kInt8 && part != WorkPart::kStatic) << WorkPartName(part);
    };
    same(WorkPart::kSkeletonInput, linear("skeleton_stage.input"));
    same(WorkPart::kSkeletonHidden, linear("skeleton_stage.hidden"));
    same(WorkPart::kMeshHidden, linear("mesh_stage.hidden"));
    same(WorkPart::kMeshCoefficients, linear("mesh_stage.coefficients"));
    same(WorkPart::kBasis, linear("displacement.basis"));
    same(WorkPart::kStatic, linear("static_stage.hidden") + linear("static_stage.increments"));
    uint64_t weights = 0;
    for (const PartWork& part : work) weights += part.weight_bytes;
    weights -= At(work, WorkPart::kMeshLayers).weight_bytes;  // each layer reads the graph again
    EXPECT_LT(weights, converted.bytes.size());
    EXPECT_GT(2 * weights, converted.bytes.size()) << "a tick reads most of a model";
  }
}

TEST(ModelWorkTest, OperationsFollowTheSizes) {
  const BundleSpec spec = Spec();
  const ModelWork work = CountWork(Converted(spec, Precision::kFp32).bytes);
  const uint64_t n = spec.vertices, d = spec.features(), k = spec.skeleton_basis, h = spec.mesh_width;
  EXPECT_EQ(At(work, WorkPart::kSkeletonInput).flops, 2 * d * 3 * k);
  EXPECT_EQ(At(work, WorkPart::kSkeletonHidden).flops, 2 * k * 3 * k);
  // Integers twice: by the state and by what rounding leaves of it.
  EXPECT_EQ(At(CountWork(Converted(spec, Precision::kInt8).bytes), WorkPart::kSkeletonHidden).flops, 4 * k * 3 * k);
  EXPECT_EQ(At(work, WorkPart::kMeshHidden).flops, 2 * n * h);
  EXPECT_EQ(At(work, WorkPart::kMeshCoefficients).flops, 2 * h * spec.mesh_basis);
  // Odd row counts are stored with a row of zeros, which is multiplied too.
  EXPECT_EQ(At(work, WorkPart::kBasis).flops, 2 * (22 + 12) * 3 * n);
  EXPECT_EQ(At(work, WorkPart::kHead).bytes(), 0u);
}

TEST(ModelWorkTest, BytesFollowTheSizes) {
  const BundleSpec spec = Spec();
  const ConvertResult converted = Converted(spec, Precision::kFp32);
  std::map<std::string, uint64_t> stored;
  for (const TensorReport& t : converted.report.tensors) stored[t.name] = t.size_bytes;
  const ModelWork work = CountWork(converted.bytes);
  const uint64_t n = spec.vertices, f = spec.feature_width;
  ASSERT_EQ(spec.layers, 3u);
  // Points in rows of four; a layer reads its input and state and writes state and the next input, the last one number.
  EXPECT_EQ(At(work, WorkPart::kBodyPoints).state_bytes, n * 4 * 4);
  EXPECT_EQ(At(work, WorkPart::kMeshLayers).state_bytes, 4 * n * ((4 + 3 * f) + 4 * f + (3 * f + 1)));
  BundleSpec one_layer = spec;
  one_layer.layers = 1;
  EXPECT_EQ(At(CountWork(Converted(one_layer, Precision::kFp32).bytes), WorkPart::kMeshLayers).state_bytes,
            4 * n * (4 + 2 * f + 1));
  EXPECT_EQ(At(work, WorkPart::kSkeletonGates).state_bytes, 4 * 8 * spec.skeleton_basis);
  // Displacements of two ticks and positions; then positions, two sums of normals, two sets of normals.
  EXPECT_EQ(At(work, WorkPart::kSkinning).state_bytes, 4 * n * 9);
  EXPECT_EQ(At(work, WorkPart::kNormals).state_bytes, 4 * n * 15);
  const auto tensors = [&](std::initializer_list<const char*> names) {
    uint64_t bytes = 0;
    for (const char* name : names) {
      EXPECT_GT(stored[name], 0u) << name;
      bytes += stored[name];
    }
    return bytes;
  };
  EXPECT_EQ(At(work, WorkPart::kBodyPoints).weight_bytes,
            tensors({"mesh_stage.body_points", "mesh_stage.body_joints", "mesh_stage.body_weights"}));
  EXPECT_EQ(At(work, WorkPart::kSkinning).weight_bytes,
            tensors({"garment.template_positions", "static_stage.influence_bones", "static_stage.influence_weights"}));
  EXPECT_EQ(At(work, WorkPart::kNormals).weight_bytes, tensors({"garment.faces"}));
}

// A vertex or unit at a time, as the kernels go.
TEST(ModelWorkTest, EveryOperationIsCounted) {
  for (const auto& [width, layers] : {std::pair(8u, 3u), {16u, 3u}, {16u, 1u}}) {
    BundleSpec spec = Spec();
    spec.feature_width = width;
    spec.layers = layers;
    const ConvertResult converted = Converted(spec, Precision::kInt8);
    const ModelWork work = CountWork(converted.bytes);
    std::map<std::string, TensorReport> stored;
    for (const TensorReport& t : converted.report.tensors) stored[t.name] = t;
    constexpr uint64_t kActivation = 25;
    constexpr uint64_t kGates = 3 * kActivation + 8;  // two logistic functions, a tanh and what mixes them
    const uint64_t n = spec.vertices, f = spec.feature_width, d = spec.features(), bones = spec.bones;
    const uint64_t edges = stored.at("mesh_stage.columns").shape[0], faces = stored.at("garment.faces").shape[0];
    const uint64_t influences = stored.at("static_stage.influence_bones").shape[1];
    const uint64_t body_influences = stored.at("mesh_stage.body_joints").shape[1];

    EXPECT_EQ(At(work, WorkPart::kStatic).flops, 2 * d * spec.static_width + 2 * spec.static_width * 3 * bones);
    EXPECT_EQ(At(work, WorkPart::kStatic).state_bytes,
              4 * (d + spec.static_width) + 4 * (spec.static_width + 3 * bones));
    EXPECT_EQ(At(work, WorkPart::kSkeletonGates).flops, spec.skeleton_basis * kGates);
    EXPECT_EQ(At(work, WorkPart::kSkeletonGates).weight_bytes, 0u);
    EXPECT_EQ(At(work, WorkPart::kMeshHidden).state_bytes, 4 * (n + spec.mesh_width));
    EXPECT_EQ(At(work, WorkPart::kBodyPoints).flops, n * (24 * body_influences + 18));
    EXPECT_EQ(At(work, WorkPart::kSkinning).flops, n * (24 * influences + 18 + 12));
    EXPECT_EQ(At(work, WorkPart::kNormals).flops, faces * 24 + n * 10);

    uint64_t flops = 0;
    for (uint32_t l = 0; l < spec.layers; ++l) {
      const uint64_t w = l == 0 ? 3 : f;
      flops += edges * w;  // sums over neighbours
      for (uint64_t i = 0; i < n; ++i) {
        flops += w;                                      // by the number of neighbours
        flops += 2 * w * 3 * f;                          // gates of the input
        flops += 2 * f * 2 * f + 2 * f * f + 2 * f * f;  // gates of the state, candidate, output
        flops += f * kGates + f * (4 + 4 + 2);           // then LayerNorm's two passes and the PReLU
      }
    }
    flops += 2 * n * f;  // the embedding
    EXPECT_EQ(At(work, WorkPart::kMeshLayers).flops, flops);

    // Every layer reads its tensors and the graph.
    uint64_t bytes = 0;
    for (const auto& [name, tensor] : stored) {
      if (name.starts_with("mesh_stage.layers.")) bytes += tensor.size_bytes;
    }
    bytes += spec.layers * (stored.at("mesh_stage.row_starts").size_bytes + stored.at("mesh_stage.columns").size_bytes);
    EXPECT_EQ(At(work, WorkPart::kMeshLayers).weight_bytes, bytes) << width;
    EXPECT_EQ(At(work, WorkPart::kMeshLayers).int8, width >= 16) << "narrow layers stay float";
    for (const WorkPart part :
         {WorkPart::kSkeletonGates, WorkPart::kBodyPoints, WorkPart::kSkinning, WorkPart::kNormals}) {
      EXPECT_FALSE(At(work, part).int8) << WorkPartName(part);
    }
  }
}

TEST(ModelWorkTest, ModelsThatStopEarlyDoLess) {
  BundleSpec spec = Spec();
  spec.mesh = false;
  const ModelWork skeleton = CountWork(Converted(spec, Precision::kFp16).bytes);
  EXPECT_EQ(At(skeleton, WorkPart::kMeshLayers).bytes(), 0u);
  EXPECT_GT(At(skeleton, WorkPart::kBasis).bytes(), 0u);
  spec.skeleton = false;
  const ModelWork still = CountWork(Converted(spec, Precision::kFp16).bytes);
  for (size_t p = 0; p < kWorkPartCount; ++p) {
    const auto part = static_cast<WorkPart>(p);
    const bool runs = part == WorkPart::kStatic || part >= WorkPart::kSkinning;
    EXPECT_EQ(still[p].flops > 0, runs) << WorkPartName(part);
    EXPECT_EQ(still[p].bytes() > 0, runs) << WorkPartName(part);
  }
}

TEST(ModelWorkTest, StepsAreThoseOfTheTimer) {
  EXPECT_EQ(StepOf(WorkPart::kStatic), DCLOTH_STEP_STATIC);
  EXPECT_EQ(StepOf(WorkPart::kSkeletonGates), DCLOTH_STEP_SKELETON);
  EXPECT_EQ(StepOf(WorkPart::kBodyPoints), DCLOTH_STEP_MESH);
  EXPECT_EQ(StepOf(WorkPart::kMeshCoefficients), DCLOTH_STEP_MESH);
  EXPECT_EQ(StepOf(WorkPart::kHead), DCLOTH_STEP_DISPLACEMENT);
  EXPECT_EQ(StepOf(WorkPart::kBasis), DCLOTH_STEP_DISPLACEMENT);
  EXPECT_EQ(StepOf(WorkPart::kSkinning), DCLOTH_STEP_SKINNING);
  EXPECT_EQ(StepOf(WorkPart::kNormals), DCLOTH_STEP_NORMALS);
}

}  // namespace
}  // namespace dcloth::converter

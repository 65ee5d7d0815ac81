// The engine against the reference network, on every instruction set and in every precision, over several ticks.
#include <algorithm>
#include <cmath>

#include "tests/unit/engine/cloth_fixture.h"
#include "tests/unit/engine/reference_network.h"

namespace dcloth::testing {
namespace {

struct Worst {
  double error = 0, bound = 0, ratio = 0;
};

// Every element within its bound; returns the largest error and bound.
Worst ExpectWithin(const std::vector<float>& found, const Vector& expected, const std::string& what) {
  Worst worst;
  EXPECT_EQ(found.size(), expected.size()) << what;
  size_t outside = 0;
  for (size_t i = 0; i < std::min(found.size(), expected.size()); ++i) {
    const double error = std::abs(static_cast<double>(found[i]) - expected[i].value);
    if (!(error <= expected[i].error) && outside++ == 0) {
      ADD_FAILURE() << what << " element " << i << ": " << found[i] << ", expected " << expected[i].value << " +- "
                    << expected[i].error;
    }
    worst.error = std::max(worst.error, error);
    worst.bound = std::max(worst.bound, expected[i].error);
  }
  EXPECT_EQ(outside, 0u) << what << ", bound up to " << worst.bound;
  return worst;
}

struct Case {
  const char* name;
  ModelSpec spec;
  double position_bound;  // m: what float or 16-bit activations may cost at most, so that the bounds stay meaningful
};

void PrintTo(const Case& test, std::ostream* out) { *out << test.name; }

ModelSpec With(format::DType precision, void (*change)(ModelSpec*) = nullptr) {
  ModelSpec spec;
  spec.precision = precision;
  if (change != nullptr) change(&spec);
  return spec;
}

// A wrong formula moves vertices by millimetres here: displacements and pivot increments reach centimetres.
constexpr double kFloatBound = 1e-4, kInt8Bound = 5e-4;

std::vector<Case> Cases() {
  return {
      {"f32", With(format::DType_F32), kFloatBound},
      {"f16", With(format::DType_F16), kFloatBound},
      {"i8", With(format::DType_I8), kInt8Bound},
      {"one_layer_width_8",
       With(format::DType_F32,
            [](ModelSpec* s) {
              s->layers = 1;
              s->feature_width = 8;
              s->seed = 2;
            }),
       kFloatBound},
      {"two_layers_width_32",
       With(format::DType_F32,
            [](ModelSpec* s) {
              s->layers = 2;
              s->feature_width = 32;
              s->seed = 3;
            }),
       kFloatBound},
      {"four_layers_width_24",
       With(format::DType_F16,
            [](ModelSpec* s) {
              s->layers = 4;
              s->feature_width = 24;
              s->rings = 9;
              s->seed = 4;
            }),
       kFloatBound},
      {"even_sizes_no_root",
       With(format::DType_I8,
            [](ModelSpec* s) {
              s->units = 32;
              s->mesh_basis = 8;
              s->root_motion = format::RootMotion_None;
              s->seed = 5;
            }),
       kInt8Bound},
      {"air",
       With(format::DType_F32,
            [](ModelSpec* s) {
              s->root_motion = format::RootMotion_Air;
              s->seed = 14;
            }),
       kFloatBound},
      {"twenty_vertices",
       With(format::DType_F32,
            [](ModelSpec* s) {
              s->rings = 4;
              s->segments = 5;
              s->influences = 1;
              s->body_influences = 8;
              s->seed = 6;
            }),
       kFloatBound},
      {"two_hundred_vertices",
       With(format::DType_I8,
            [](ModelSpec* s) {
              s->rings = 20;
              s->influences = 8;
              s->seed = 7;
            }),
       kInt8Bound},
      {"skeleton_only",
       With(format::DType_I8,
            [](ModelSpec* s) {
              s->mesh = false;
              s->seed = 8;
            }),
       kInt8Bound},
      {"reduced_f32",
       With(format::DType_F32,
            [](ModelSpec* s) {
              s->rank = 12;
              s->seed = 10;
            }),
       kFloatBound},
      {"reduced_f16",
       With(format::DType_F16,
            [](ModelSpec* s) {
              s->rank = 34;  // more than a panel, more than k_S
              s->seed = 11;
            }),
       kFloatBound},
      {"reduced_i8",
       With(format::DType_I8,
            [](ModelSpec* s) {
              s->rank = 14;
              s->seed = 12;
            }),
       kInt8Bound},
      {"reduced_skeleton_only",
       With(format::DType_I8,
            [](ModelSpec* s) {
              s->mesh = false;
              s->rank = 2;
              s->seed = 13;
            }),
       kInt8Bound},
      {"static_only",
       With(format::DType_F16,
            [](ModelSpec* s) {
              s->mesh = s->skeleton = false;
              s->seed = 9;
            }),
       kFloatBound},
  };
}

class NetworkTest : public ::testing::TestWithParam<std::tuple<Case, std::string>> {
 protected:
  void SetUp() override {
    ASSERT_EQ(dcloth_isa_select(std::get<1>(GetParam()).c_str()), DCLOTH_OK);
    ASSERT_STREQ(dcloth_isa_name(), std::get<1>(GetParam()).c_str());
  }
  void TearDown() override { ASSERT_EQ(dcloth_isa_select(nullptr), DCLOTH_OK); }
};

uint32_t StagesOf(const ModelSpec& spec) {
  return spec.mesh && spec.skeleton ? DCLOTH_STAGES_MESH
         : spec.skeleton            ? DCLOTH_STAGES_SKELETON
                                    : DCLOTH_STAGES_STATIC;
}

TEST_P(NetworkTest, TicksAndFramesStayWithinTheBound) {
  const Case& test = std::get<0>(GetParam());
  const TestModel model = BuildModel(test.spec);
  const OpenedModel opened(model);
  ASSERT_EQ(opened.status(), DCLOTH_OK) << opened.error().text;
  ASSERT_EQ(opened.info().stages, StagesOf(test.spec));
  OwnedCloth cloth(opened);
  ReferenceNetwork reference(model.numbers);
  Worst positions, normals;
  for (int tick = 0; tick < 8; ++tick) {
    const std::string at = std::string(test.name) + " tick " + std::to_string(tick);
    const std::vector<float> pose = PoseAt(model.numbers, tick / 30.0);
    const std::array<float, 3> wind = {0.25f * static_cast<float>(tick), -0.125f, 1};
    ASSERT_EQ(dcloth_cloth_set_wind(cloth.get(), wind.data(), nullptr), DCLOTH_OK);
    reference.SetWind({wind[0], wind[1], wind[2]});
    ASSERT_EQ(cloth.Tick(pose, StagesOf(test.spec)), DCLOTH_OK);
    reference.Tick(pose, StagesOf(test.spec));
    for (const float blend : {1.0f, 0.0f, 0.3f}) {
      const std::vector<float> drawn = PoseAt(model.numbers, (tick + 0.4) / 30.0);
      ASSERT_EQ(cloth.Skin(drawn, blend), DCLOTH_OK);
      const ReferenceNetwork::Frame frame = reference.Skin(drawn, static_cast<double>(blend));
      const Worst p = ExpectWithin(cloth.positions(), frame.world, at + " positions");
      const Worst n = ExpectWithin(cloth.normals(), reference.Normals(frame.relative), at + " normals");
      positions = {std::max(positions.error, p.error), std::max(positions.bound, p.bound)};
      normals = {std::max(normals.error, n.error), std::max(normals.bound, n.bound)};
    }
  }
  EXPECT_LT(positions.bound, test.position_bound) << "the bound has grown past what could catch a fault";
  RecordProperty("position_error_um", std::to_string(positions.error * 1e6));
  RecordProperty("position_bound_um", std::to_string(positions.bound * 1e6));
  RecordProperty("normal_error", std::to_string(normals.error));
}

// The test above would be empty if the network moved nothing.
TEST_P(NetworkTest, EveryStageMovesTheGarment) {
  const Case& test = std::get<0>(GetParam());
  const TestModel model = BuildModel(test.spec);
  const OpenedModel opened(model);
  ASSERT_EQ(opened.status(), DCLOTH_OK) << opened.error().text;
  std::vector<std::vector<float>> frames;
  const std::vector<float> pose = PoseAt(model.numbers, 0.2);
  for (const uint32_t stages : {0u, 1u, 3u, 7u}) {
    if (stages > StagesOf(test.spec)) break;
    OwnedCloth cloth(opened);
    for (int tick = 0; tick < 3 && stages != 0; ++tick) ASSERT_EQ(cloth.Tick(pose, stages), DCLOTH_OK);
    ASSERT_EQ(cloth.Skin(pose, 1.0f), DCLOTH_OK);
    frames.push_back(cloth.positions());
  }
  ASSERT_GE(frames.size(), 2u);
  for (size_t f = 1; f < frames.size(); ++f) {
    double moved = 0;
    for (size_t i = 0; i < frames[f].size(); ++i)
      moved = std::max(moved, std::abs(static_cast<double>(frames[f][i] - frames[f - 1][i])));
    EXPECT_GT(moved, 2 * test.position_bound) << "stage " << f;
  }
}

// Levels of detail that come and go: with a reduced basis what the mesh stage left behind must not show in the
// skeleton stage's level, whose coefficients share the same rows.
TEST_P(NetworkTest, LevelsMayChangeFromTickToTick) {
  const Case& test = std::get<0>(GetParam());
  const TestModel model = BuildModel(test.spec);
  const OpenedModel opened(model);
  ASSERT_EQ(opened.status(), DCLOTH_OK) << opened.error().text;
  OwnedCloth cloth(opened);
  ReferenceNetwork reference(model.numbers);
  const uint32_t mesh = DCLOTH_STAGES_MESH, skeleton = DCLOTH_STAGES_SKELETON, still = DCLOTH_STAGES_STATIC;
  int tick = 0;
  for (const uint32_t wanted :
       {mesh, mesh, skeleton, mesh, still, still, mesh, skeleton, skeleton, still, skeleton, mesh}) {
    const uint32_t stages = wanted & StagesOf(test.spec);
    const std::vector<float> pose = PoseAt(model.numbers, tick / 30.0);
    ASSERT_EQ(cloth.Tick(pose, stages), DCLOTH_OK);
    reference.Tick(pose, stages);
    ASSERT_EQ(cloth.Skin(pose, 0.75f), DCLOTH_OK);
    const std::string at = std::string(test.name) + " tick " + std::to_string(tick++) + " positions";
    EXPECT_LT(ExpectWithin(cloth.positions(), reference.Skin(pose, 0.75).world, at).bound, test.position_bound);
  }
}

INSTANTIATE_TEST_SUITE_P(EveryIsa, NetworkTest,
                         ::testing::Combine(::testing::ValuesIn(Cases()), ::testing::ValuesIn(UsableIsas())),
                         [](const auto& test) {
                           return std::string(std::get<0>(test.param).name) + "_" + std::get<1>(test.param);
                         });

TEST(Isa, ScalarAlwaysExistsAndUnknownNamesAreRefused) {
  EXPECT_FALSE(UsableIsas().empty());
  const std::string before = dcloth_isa_name();
  EXPECT_EQ(dcloth_isa_select("pentium"), DCLOTH_ERROR_ARGUMENT);
  EXPECT_EQ(dcloth_isa_name(), before);
}

}  // namespace
}  // namespace dcloth::testing

// A tick cut into portions of any size is the tick in one piece, to the bit.
#include "engine/src/network/schedule.h"

#include <algorithm>
#include <random>

#include "engine/src/base/arithmetic.h"
#include "engine/src/update.h"
#include "tests/unit/engine/cloth_fixture.h"

namespace dcloth::testing {
namespace {

using engine::Cloth;

Cloth* Inside(OwnedCloth* cloth) { return reinterpret_cast<Cloth*>(cloth->get()); }

// Begins a tick and runs it in portions of `budget`, each picosecond count drawn between 1 and it.
size_t TickInPortions(Cloth* cloth, const std::vector<float>& matrices, uint32_t stages, uint64_t budget,
                      std::mt19937_64* random) {
  engine::Stopwatch watch(nullptr);
  engine::SkinPose skin = {cloth->skin_joints, {}};
  engine::ReadPose(*cloth->model, cloth->rig, OwnedCloth::Pose(matrices), cloth->pose_now);
  engine::MakeSkinPose(*cloth->model, cloth->pose_now, &skin);
  engine::BeginTick(cloth, skin, {stages}, 1, &watch);
  size_t portions = 0;
  uint64_t spent = 0;
  for (; engine::TickInWork(*cloth); ++portions) {
    spent += engine::ContinueTick(cloth, std::uniform_int_distribution<uint64_t>(1, budget)(*random), &watch);
  }
  EXPECT_EQ(spent, engine::TickCost(*cloth->model, {stages}));
  return portions;
}

class ScheduleTest : public ::testing::TestWithParam<format::DType> {};

TEST_P(ScheduleTest, PortionsGiveTheSameBits) {
  ModelSpec spec;
  spec.precision = GetParam();
  spec.rings = 21;  // 210 vertices: 14 blocks, the last one not full
  const TestModel model = BuildModel(spec);
  const OpenedModel opened(model);
  for (const std::string& isa : UsableIsas()) {
    ASSERT_EQ(dcloth_isa_select(isa.c_str()), DCLOTH_OK);
    for (const uint64_t budget : {uint64_t{1}, uint64_t{3000000}, uint64_t{100000000}}) {
      OwnedCloth whole(opened), cut(opened);
      std::mt19937_64 random(budget);
      size_t portions = 0;
      const uint32_t plan[] = {7, 7, 3, 7, 1, 7, 7};
      for (int tick = 0; tick < 7; ++tick) {
        const std::vector<float> pose = PoseAt(model.numbers, tick / 30.0);
        ASSERT_EQ(whole.Tick(pose, plan[tick]), DCLOTH_OK);
        portions += TickInPortions(Inside(&cut), pose, plan[tick], budget, &random);
        ASSERT_EQ(whole.Skin(pose, 0.5f), DCLOTH_OK);
        ASSERT_EQ(cut.Skin(pose, 0.5f), DCLOTH_OK);
        ASSERT_EQ(whole.positions(), cut.positions()) << isa << " tick " << tick << " budget " << budget;
      }
      EXPECT_GT(portions, budget == 1 ? 200u : 7u) << "nothing was cut";
    }
  }
  dcloth_isa_select(nullptr);
}

// A portion overshoots its budget by less than one item, and a model without a stage has a tick without its
// parts.
TEST_P(ScheduleTest, PortionsKeepTheirBudget) {
  for (const bool mesh : {true, false}) {
    ModelSpec spec;
    spec.precision = GetParam();
    spec.rings = 200;
    spec.mesh = mesh;
    const TestModel model = BuildModel(spec);
    const OpenedModel opened(model);
    OwnedCloth cloth(opened);
    Cloth* inside = Inside(&cloth);
    const uint32_t stages = opened.info().stages;
    ASSERT_EQ(cloth.Tick(PoseAt(model.numbers, 0), stages), DCLOTH_OK);
    const uint64_t cost = engine::TickCost(*inside->model, {stages});
    // The widest items are panels: of the layer over all vertices, or of the static stage, which is one item.
    const uint64_t widest = 40 * 32 * 4 * std::max<uint64_t>(mesh ? model.numbers.n : 0, model.numbers.d + 21 * 1 + 21);
    engine::Stopwatch watch(nullptr);
    engine::SkinPose skin = {inside->skin_joints, {}};
    engine::MakeSkinPose(*inside->model, inside->pose_before, &skin);
    for (const uint64_t parts : {2, 3, 7, 20}) {
      engine::BeginTick(inside, skin, {stages}, 1, &watch);
      uint64_t frames = 0;
      while (engine::TickInWork(*inside)) {
        const uint64_t budget = (cost + parts - 1) / parts, spent = engine::ContinueTick(inside, budget, &watch);
        EXPECT_LT(spent, budget + widest) << parts;
        ++frames;
      }
      EXPECT_LE(frames, parts);
      EXPECT_GE(frames * (cost / parts + widest), cost);
    }
    EXPECT_LT(engine::TickCost(*inside->model, DCLOTH_STAGES_STATIC), cost);
  }
}

// Saved states hold these floats in this order, wherever in a tick they were saved.
TEST(TickPartsTest, ASavedTickKeepsItsOrder) {
  ModelSpec spec;
  spec.rings = 21;
  const TestModel model = BuildModel(spec);
  const OpenedModel opened(model);
  OwnedCloth cloth(opened);
  const Cloth& inside = *Inside(&cloth);
  const auto at = [&](engine::TickPart part, uint32_t items_done, uint32_t stages) {
    engine::StateSpans spans;
    engine::ListTickSpans(inside, stages, {part, items_done, 1.0f}, &spans);
    std::string names;
    for (uint32_t i = 0; i < spans.count; ++i) names += std::string(i == 0 ? "" : " ") + spans.spans[i].name;
    return names;
  };
  using engine::TickPart;
  constexpr uint32_t kMesh = DCLOTH_STAGES_MESH, kSkeleton = DCLOTH_STAGES_SKELETON;
  EXPECT_EQ(at(TickPart::kStatic, 0, kMesh), "body_matrices");
  EXPECT_EQ(at(TickPart::kStatic, 0, kSkeleton), "");
  EXPECT_EQ(at(TickPart::kSkeletonInput, 1, kMesh), "input_gates body_matrices");
  EXPECT_EQ(at(TickPart::kSkeletonHidden, 0, kMesh), "input_gates body_matrices");
  EXPECT_EQ(at(TickPart::kSkeletonHidden, 1, kSkeleton), "input_gates hidden_gates");
  EXPECT_EQ(at(TickPart::kSkeletonGates, 0, kMesh), "input_gates hidden_gates body_matrices");
  EXPECT_EQ(at(TickPart::kBodyPoints, 1, kMesh), "body_matrices layer_input");
  EXPECT_EQ(at(TickPart::kMeshLayers, 1, kMesh), "layer_input layer_output");
  EXPECT_EQ(at(TickPart::kMeshHidden, 1, kMesh), "embedded mesh_hidden");
  EXPECT_EQ(at(TickPart::kMeshCoefficients, 0, kMesh), "mesh_hidden");
  EXPECT_EQ(at(TickPart::kHead, 0, kMesh), "mesh_coefficients");
  EXPECT_EQ(at(TickPart::kBasis, 0, kMesh), "mesh_coefficients");
  EXPECT_EQ(at(TickPart::kBasis, 1, kSkeleton), "");
  EXPECT_EQ(at(TickPart::kBasis, 0, DCLOTH_STAGES_STATIC), "");
}

TEST(TickPartsTest, ASavedTickOfPatchesKeepsItsOrder) {
  ModelSpec spec;
  spec.patches = 4;
  const OpenedModel opened(BuildModel(spec));
  OwnedCloth cloth(opened);
  const Cloth& inside = *Inside(&cloth);
  const auto at = [&](engine::TickPart part, uint32_t items_done, uint32_t stages) {
    engine::StateSpans spans;
    engine::ListTickSpans(inside, stages, {part, items_done, 1.0f}, &spans);
    std::string names;
    for (uint32_t i = 0; i < spans.count; ++i) names += std::string(i == 0 ? "" : " ") + spans.spans[i].name;
    return names;
  };
  using engine::TickPart;
  for (const uint32_t stages : {DCLOTH_STAGES_MESH, DCLOTH_STAGES_SKELETON}) {
    EXPECT_EQ(at(TickPart::kStatic, 0, stages), "patch_pose");
    EXPECT_EQ(at(TickPart::kPatchInputs, 1, stages), "patch_pose patch_frames patch_inputs");
    EXPECT_EQ(at(TickPart::kPatchLayers, 0, stages), "patch_pose patch_frames patch_inputs");
    EXPECT_EQ(at(TickPart::kPatchLayers, 1, stages), "patch_pose patch_frames patch_inputs patch_features");
    EXPECT_EQ(at(TickPart::kPatchLayers, spec.mixes + 1, stages),
              "patch_pose patch_frames patch_inputs patch_features");
    EXPECT_EQ(at(TickPart::kPatchLayers, spec.mixes + 2, stages), "patch_pose patch_frames patch_inputs");
    EXPECT_EQ(at(TickPart::kPatchMap, 1, stages), "");
  }
  EXPECT_EQ(at(TickPart::kPatchMap, 0, DCLOTH_STAGES_STATIC), "");
}

// Numbers in saved states belong to one part each.
TEST(TickPartsTest, NumbersOfParts) {
  for (size_t p = 0; p <= format::kTickPartCount; ++p) {
    engine::TickPart part{};
    ASSERT_TRUE(format::FindTickPart(format::kTickParts[p].number, &part));
    EXPECT_EQ(static_cast<size_t>(part), p) << "given twice";
  }
  engine::TickPart part{};
  EXPECT_FALSE(format::FindTickPart(0xFFFF, &part));
}

INSTANTIATE_TEST_SUITE_P(EveryPrecision, ScheduleTest,
                         ::testing::Values(format::DType_F32, format::DType_F16, format::DType_I8),
                         [](const auto& type) { return std::string(format::EnumNameDType(type.param)); });

}  // namespace
}  // namespace dcloth::testing

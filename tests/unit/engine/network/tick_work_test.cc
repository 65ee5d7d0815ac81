// A tick cut into portions of any size is the tick in one piece, to the bit.
#include "engine/src/network/tick_work.h"

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
  engine::BoundPose bound = {cloth->bound, {}};
  engine::ReadPose(*cloth->model, cloth->binding, OwnedCloth::Pose(matrices), cloth->pose_now);
  engine::BindPose(*cloth->model, cloth->pose_now, &bound);
  engine::BeginTick(cloth, bound, {stages}, 1, &watch);
  size_t portions = 0;
  uint64_t spent = 0;
  for (; engine::TickInWork(*cloth); ++portions) {
    spent += engine::ContinueTick(cloth, std::uniform_int_distribution<uint64_t>(1, budget)(*random), &watch);
  }
  EXPECT_EQ(spent, engine::TickCost(*cloth->model, {stages}));
  return portions;
}

class TickWorkTest : public ::testing::TestWithParam<format::DType> {};

TEST_P(TickWorkTest, PortionsGiveTheSameBits) {
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
TEST_P(TickWorkTest, PortionsKeepTheirBudget) {
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
    const uint64_t widest =
        40 * 32 * 4 * std::max<uint64_t>(mesh ? model.numbers.n : 0, model.numbers.d + 21 * 1 + 21);
    engine::Stopwatch watch(nullptr);
    engine::BoundPose bound = {inside->bound, {}};
    engine::BindPose(*inside->model, inside->pose_before, &bound);
    for (const uint64_t parts : {2, 3, 7, 20}) {
      engine::BeginTick(inside, bound, {stages}, 1, &watch);
      uint64_t frames = 0;
      while (engine::TickInWork(*inside)) {
        const uint64_t budget = (cost + parts - 1) / parts, spent = engine::ContinueTick(inside, budget, &watch);
        EXPECT_LT(spent, budget + widest) << parts;
        ++frames;
      }
      EXPECT_LE(frames, parts);
      EXPECT_GE(frames * (cost / parts + widest), cost);
    }
    EXPECT_LT(engine::TickCost(*inside->model, {DCLOTH_STAGES_STATIC}), cost);
  }
}

INSTANTIATE_TEST_SUITE_P(EveryPrecision, TickWorkTest,
                         ::testing::Values(format::DType_F32, format::DType_F16, format::DType_I8),
                         [](const auto& type) { return std::string(format::EnumNameDType(type.param)); });

}  // namespace
}  // namespace dcloth::testing

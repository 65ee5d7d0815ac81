// DCLOTH_FRAME_HALF_RATE_MESH: the mesh stage in every second tick, its wrinkles on a straight way between.
#include "engine/src/network/displacement.h"
#include "engine/src/network/schedule.h"
#include "tests/unit/engine/update_fixture.h"

namespace dcloth::testing {
namespace {

constexpr auto kSeconds = static_cast<float>(kTick);

class HalfRateTest : public UpdateTest {
 protected:
  static const engine::Cloth& Inside(OwnedCloth* cloth) {
    return *reinterpret_cast<const engine::Cloth*>(cloth->get());
  }
  // The newest displacement [n, 3].
  static std::vector<float> Displacement(OwnedCloth* cloth) {
    const engine::Cloth& inside = Inside(cloth);
    const float* newest = inside.displacement[inside.newest];
    return {newest, newest + 3 * size_t{inside.model->vertex_count}};
  }
  // Q of the newest tick.
  static std::vector<float> Coefficients(OwnedCloth* cloth) {
    const engine::Cloth& inside = Inside(cloth);
    const float* q = inside.coefficients + engine::MeshCoefficientsAt(*inside.model);
    return {q, q + inside.model->mesh_stage.coefficients.columns};
  }
  // Whether the tick that an update ran had the mesh stage in it, by a clock that counts.
  bool RunsMesh(OwnedCloth* cloth, double time, uint32_t flags) {
    const std::vector<float> matrices = Pose(time);
    const dcloth_pose pose = OwnedCloth::Pose(matrices);
    const dcloth_frame frame = {sizeof(frame), kAll, kSeconds, flags, nullptr};
    dcloth_timer timer = {};
    timer.struct_size = sizeof(timer);
    uint64_t count = 0;
    timer.context = &count;
    timer.now = [](void* context) { return ++*static_cast<uint64_t*>(context); };
    EXPECT_EQ(dcloth_cloth_update(cloth->get(), &pose, &frame, nullptr, &timer), DCLOTH_OK);
    EXPECT_GT(timer.elapsed[DCLOTH_STEP_SKELETON], 0u);
    return timer.elapsed[DCLOTH_STEP_MESH] != 0;
  }
};

TEST_F(HalfRateTest, EverySecondTickRunsTheMesh) {
  OwnedCloth cloth(opened_);
  double time = 0;
  const auto runs = [&](uint32_t flags) { return RunsMesh(&cloth, time += kTick, flags); };
  for (int tick = 0; tick < 8; ++tick) ASSERT_EQ(runs(DCLOTH_FRAME_HALF_RATE_MESH), tick % 2 == 0) << tick;
  for (int tick = 0; tick < 3; ++tick) ASSERT_TRUE(runs(0));  // full rate at once
  for (int tick = 0; tick < 4; ++tick) ASSERT_EQ(runs(DCLOTH_FRAME_HALF_RATE_MESH), tick % 2 == 0) << tick;
  ASSERT_EQ(dcloth_cloth_reset(cloth.get()), DCLOTH_OK);
  for (int tick = 0; tick < 4; ++tick) ASSERT_EQ(runs(DCLOTH_FRAME_HALF_RATE_MESH), tick % 2 == 0) << tick;
}

// What is defined: with Q_k the coefficients of the k-th run, its tick has (Q_{k-1} + Q_k) / 2 and the rest after it
// Q_k. Q_k is told by a cloth whose mesh stage runs in every tick, and whose mesh state is put back after those in
// which it should have rested. To the bit: Q does not depend on the stages before.
TEST_F(HalfRateTest, CoefficientsGoStraightFromRunToRun) {
  OwnedCloth half(opened_), full(opened_);
  const engine::Cloth& inside = Inside(&full);
  const ModelSpec& spec = model_.numbers.spec;
  const size_t floats = spec.layers * kernels::GsgruStateFloats(model_.numbers.n, spec.feature_width);
  std::vector<float> last, newest;
  size_t different = 0;
  for (int tick = 0; tick < 20; ++tick) {
    const std::vector<float> pose = Pose(tick * kTick);
    const std::vector<float> state(inside.mesh.state, inside.mesh.state + floats);
    ASSERT_EQ(Update(&half, pose, kSeconds, DCLOTH_FRAME_HALF_RATE_MESH), DCLOTH_OK);
    ASSERT_EQ(full.Tick(pose, kAll), DCLOTH_OK);
    if (tick % 2 == 0) {
      last = tick == 0 ? Coefficients(&full) : newest;
      newest = Coefficients(&full);
    } else {
      std::copy(state.begin(), state.end(), inside.mesh.state);
    }
    const std::vector<float> found = Coefficients(&half);
    ASSERT_EQ(found.size(), spec.mesh_basis);
    for (size_t i = 0; i < found.size(); ++i) {
      ASSERT_EQ(found[i], tick % 2 == 0 ? 0.5f * (last[i] + newest[i]) : newest[i]) << "tick " << tick << ", " << i;
      different += newest[i] != last[i];
    }
  }
  EXPECT_GT(different, 100u) << "the coefficients did not move, nothing was tested";
}

// By the engine's cost model: the mean of two ticks is a full tick less half of the mesh stage.
TEST_F(HalfRateTest, CostsHalfOfTheMeshStage) {
  OwnedCloth cloth(opened_);
  const format::ModelView& model = *Inside(&cloth).model;
  const uint64_t full = engine::TickCost(model, {kAll}), skeleton = engine::TickCost(model, {DCLOTH_STAGES_SKELETON});
  const uint64_t run = engine::TickCost(model, {kAll, engine::MeshPace::kRunBetween});
  const uint64_t rest = engine::TickCost(model, {kAll, engine::MeshPace::kRest});
  EXPECT_EQ(run, full);
  EXPECT_LT(rest, full);
  EXPECT_GT(rest, skeleton) << "the mesh rows of the basis are read in a rest too";
}

// A pipelined host has the same ticks.
TEST_F(HalfRateTest, PipelinedTicksAreTheSame) {
  OwnedCloth direct(opened_), pipelined(opened_);
  int compared = 0;
  for (int frame = 0; frame < 120; ++frame) {
    const std::vector<float> pose = Pose(frame / 60.0);
    ASSERT_EQ(Update(&direct, pose, 1 / 60.0f, DCLOTH_FRAME_HALF_RATE_MESH), DCLOTH_OK);
    ASSERT_EQ(Update(&pipelined, pose, 1 / 60.0f, DCLOTH_FRAME_HALF_RATE_MESH | DCLOTH_FRAME_PIPELINED), DCLOTH_OK);
    if (Describe(&pipelined).in_work != 0) continue;
    ASSERT_EQ(Displacement(&direct), Displacement(&pipelined)) << frame;
    ++compared;
  }
  EXPECT_GT(compared, 50);
}

// The flag says nothing to a level without the mesh stage.
TEST_F(HalfRateTest, OtherLevelsStay) {
  for (const uint32_t stages : {DCLOTH_STAGES_STATIC, DCLOTH_STAGES_SKELETON}) {
    OwnedCloth with(opened_), without(opened_);
    for (int tick = 0; tick < 6; ++tick) {
      ASSERT_EQ(with.Update(Pose(tick * kTick), kSeconds, stages, DCLOTH_FRAME_HALF_RATE_MESH), DCLOTH_OK);
      ASSERT_EQ(without.Update(Pose(tick * kTick), kSeconds, stages), DCLOTH_OK);
      ASSERT_EQ(with.positions(), without.positions());
    }
  }
}

}  // namespace
}  // namespace dcloth::testing

#include "engine/src/scene/scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <memory>
#include <random>

#include "engine/src/time/idle.h"
#include "tests/unit/engine/allocation_trap.h"
#include "tests/unit/engine/scene/scene_fixture.h"
#include "tests/unit/kernels/guarded_buffer.h"

namespace dcloth::testing {
namespace {

// The promise is 5 %; by the given costs nothing is over at all. Importances wander and budgets change every second.
TEST_F(SceneTest, NeverOverBudget) {
  std::mt19937 random(5);
  std::uniform_real_distribution<float> importance(0, 1);
  for (const double rate : {24.0, 30.0, 60.0, 90.0, 144.0, 0.0}) {
    const std::vector<float> frames = FrameSeconds(rate, 12);
    double time = 0, worst = 0, used = 0;
    float budget = 0;
    for (size_t f = 0; f < frames.size(); ++f) {
      if (static_cast<int>(time) != static_cast<int>(time - static_cast<double>(frames[f])) || f == 0)
        budget = std::array<float, 6>{3000, 9000, 2200, 2800, 5000, 2100}[static_cast<size_t>(time) % 6];
      ASSERT_EQ(dcloth_scene_set_importance(scene_, static_cast<uint32_t>(random() % kCharacters), importance(random)),
                DCLOTH_OK);
      const float planned = Plan(frames[f], budget);
      const double cost = RunAll(time, frames[f]);
      ASSERT_NEAR(static_cast<double>(planned), cost, 1e-3 * cost) << rate << " Hz, frame " << f;
      worst = std::max(worst, cost / static_cast<double>(budget));
      used += cost / static_cast<double>(budget);
      time += static_cast<double>(frames[f]);
    }
    used /= static_cast<double>(frames.size());
    std::printf("%g Hz: frames cost %.3f of the budget on average, %.3f at most\n", rate, used, worst);
    EXPECT_LE(worst, 1 + 1e-6);
    EXPECT_GE(used, 0.75) << "a scheduler that spends nothing is never over either";
  }
}

// Nobody starves: as often as the header promises, whatever the importances.
TEST_F(SceneTest, StalenessIsBounded) {
  constexpr float kSeconds = 1 / 60.0f;
  for (const float budget : {2020.0f, 2100.0f, 2900.0f, 4000.0f, 8000.0f}) {
    for (uint32_t i = 0; i < kCharacters; ++i) {
      ASSERT_EQ(dcloth_cloth_reset(cloths_[i]->get()), DCLOTH_OK);
      ASSERT_EQ(Set(i, i < 5 ? 100.0f : i < 25 ? 1.0f : 0.0f), DCLOTH_OK);
    }
    std::vector<double> stale(kCharacters, 0);
    double worst = 0, worst_frozen = 0;
    size_t frozen = 0;
    for (int frame = 0; frame < 900; ++frame) {
      Plan(kSeconds, budget);
      for (uint32_t i = 0; i < kCharacters; ++i) {
        const bool is_frozen = Choice(i).level == DCLOTH_LEVEL_FROZEN;
        stale[i] += static_cast<double>(kSeconds);
        if (Run(i, PoseAt(model_.numbers, frame / 60.0 + i), kSeconds).ticks != 0) stale[i] = 0;
        frozen += is_frozen;
        (is_frozen ? worst_frozen : worst) = std::max(is_frozen ? worst_frozen : worst, stale[i]);
        ASSERT_NEAR(static_cast<double>(Choice(i).stale_seconds), stale[i], 1e-4);
      }
    }
    std::printf("budget %g: without a tick for up to %.3f s, frozen %.3f s (%.1f of %u frozen)\n",
                static_cast<double>(budget), worst, worst_frozen, static_cast<double>(frozen) / 900, kCharacters);
    const double wait = kCharacters * static_cast<double>(kSeconds);
    EXPECT_LE(worst_frozen, engine::kRefreshSeconds + wait);
    EXPECT_LE(worst, kTick + wait + (frozen != 0 ? engine::kRefreshSeconds : 0));
    EXPECT_GE(frozen, 25u * 900u) << "those without importance";
  }
}

// With room in the levels chosen the wait is short: a few frames, not as many as characters.
TEST_F(SceneTest, TicksComeInTime) {
  constexpr float kSeconds = 1 / 60.0f;
  std::vector<double> intervals;
  std::vector<int> last(kCharacters, -1);
  for (int frame = 0; frame < 1200; ++frame) {
    Plan(kSeconds, 6000);
    for (uint32_t i = 0; i < kCharacters; ++i) {
      if (Run(i, PoseAt(model_.numbers, frame / 60.0 + i), kSeconds).ticks == 0) continue;
      if (frame > 300) intervals.push_back(frame - last[i]);
      last[i] = frame;
    }
  }
  std::sort(intervals.begin(), intervals.end());
  ASSERT_GT(intervals.size(), 10000u);
  std::printf("frames from tick to tick: p50 %g, p99 %g, max %g\n", intervals[intervals.size() / 2],
              intervals[intervals.size() * 99 / 100], intervals.back());
  EXPECT_EQ(intervals[intervals.size() / 2], 2);
  EXPECT_LE(intervals[intervals.size() * 99 / 100], 3);
}

// Steady inputs give steady levels, by importance where costs are equal.
TEST_F(SceneTest, LevelsFollowImportanceAndStay) {
  constexpr float kSeconds = 1 / 60.0f;
  for (uint32_t i = 0; i < kCharacters; ++i) ASSERT_EQ(Set(i, 1.0f + static_cast<float>(i * i)), DCLOTH_OK);
  std::vector<uint32_t> levels(kCharacters);
  std::array<int, DCLOTH_LEVEL_COUNT> seen = {};
  for (int frame = 0; frame < 300; ++frame) {
    Plan(kSeconds, 6500);
    RunAll(frame / 60.0, kSeconds);
    for (uint32_t i = 0; i < kCharacters; ++i) {
      const uint32_t level = Choice(i).level;
      if (frame > 10) {
        ASSERT_EQ(level, levels[i]) << "character " << i << ", frame " << frame;
      }
      levels[i] = level;
    }
  }
  for (const uint32_t level : levels) ++seen[level];
  std::printf("%d frozen, %d static, %d skeleton, %d mesh\n", seen[0], seen[1], seen[2], seen[DCLOTH_LEVEL_MESH]);
  EXPECT_TRUE(std::is_sorted(levels.begin(), levels.end()));
  EXPECT_NE(levels.front(), levels.back());
}

// A host of 0.1 may ask for the level that is unused now: it gets the one below.
TEST_F(SceneTest, NobodyGetsTheUnusedLevel) {
  constexpr uint32_t kUnused = 3;
  for (uint32_t i = 0; i < kCharacters; ++i) {
    dcloth_scene_character character = Character(i, 1);
    character.error_mm[kUnused] = 0;
    character.tick_microseconds[kUnused] = 0;
    if (i % 2 == 0) character.top_level = kUnused;
    ASSERT_EQ(dcloth_scene_set(scene_, i, &character), DCLOTH_OK);
  }
  Plan(1 / 60.0f, 1e6f);
  for (uint32_t i = 0; i < kCharacters; ++i)
    EXPECT_EQ(Choice(i).level, static_cast<uint32_t>(i % 2 == 0 ? DCLOTH_LEVEL_SKELETON : DCLOTH_LEVEL_MESH)) << i;
}

// Measured costs that are wrong are put right by what frames really took.
TEST_F(SceneTest, FollowsTheRealCost) {
  constexpr float kSeconds = 1 / 60.0f, kBudget = 9000;
  float spent = 0;
  for (int frame = 0; frame < 240; ++frame) {
    Plan(kSeconds, kBudget, spent);
    spent = static_cast<float>(1.7 * RunAll(frame / 60.0, kSeconds));
    if (frame > 30) {
      ASSERT_LE(spent, 1.05f * kBudget) << frame;
    }
  }
  EXPECT_GE(spent, 0.7f * kBudget);
}

// Fifty first frames at once: none is over, and everyone has its first tick after as many frames as that takes.
TEST_F(SceneTest, SpawnsTogether) {
  constexpr float kSeconds = 1 / 60.0f, kBudget = 3000;
  std::vector<bool> ticked(kCharacters);
  int frames = 0;
  for (; std::count(ticked.begin(), ticked.end(), true) < static_cast<int>(kCharacters); ++frames) {
    ASSERT_LT(frames, static_cast<int>(kCharacters));
    Plan(kSeconds, kBudget);
    double cost = 0;
    for (uint32_t i = 0; i < kCharacters; ++i) {
      const Ran ran = Run(i, Pose(i), kSeconds);
      cost += ran.microseconds;
      ticked[i] = ticked[i] || ran.ticks != 0;
    }
    ASSERT_LE(cost, static_cast<double>(kBudget));
  }
  std::printf("everyone ticked after %d frames\n", frames);
}

// Idle cloths cost drawing, keep their level, and wake in the first or second frame.
TEST_F(SceneTest, IdleCostsDrawingAndWakes) {
  constexpr float kSeconds = 1 / 60.0f, kBudget = 2800;
  const auto idle = [&] {
    return std::count_if(cloths_.begin(), cloths_.end(), [](auto& c) { return Describe(c.get()).frozen != 0; });
  };
  for (uint32_t i = 0; i < kCharacters; ++i) ASSERT_EQ(Set(i, 1.0f + static_cast<float>(i)), DCLOTH_OK);
  int frame = 0;
  for (; frame < 1200; ++frame) {
    Plan(kSeconds, kBudget);
    for (uint32_t i = 0; i < kCharacters; ++i) Run(i, Pose(i), kSeconds);
  }
  const auto resting = idle();
  std::printf("%d of %u idle\n", static_cast<int>(resting), kCharacters);
  ASSERT_GE(resting, 45);
  // A handful moves at once, more than a frame can pay for beside the rest.
  double cost = 0;
  std::vector<int> woke(kCharacters, -1);
  for (int after = 0; after < 60; ++after) {
    Plan(kSeconds, kBudget);
    cost = 0;
    for (uint32_t i = 0; i < kCharacters; ++i) {
      const dcloth_scene_choice choice = Choice(i);
      const bool moves = i >= kCharacters - 5;
      const auto passes =
          Count(cloths_[i].get(), Pose(moves ? i + 0.5 + after / 60.0 : i), kSeconds, choice.stages, choice.flags);
      const bool mesh = passes[DCLOTH_STEP_MESH] != 0;
      if (passes[DCLOTH_STEP_STATIC] != 0) {
        cost += static_cast<double>(kTicks[mesh ? DCLOTH_LEVEL_MESH : DCLOTH_LEVEL_SKELETON]);  // or less
        if (woke[i] < 0) woke[i] = after;
      }
      cost += static_cast<double>(kDraw);
    }
    ASSERT_LE(cost, static_cast<double>(kBudget)) << after;
  }
  for (uint32_t i = kCharacters - 5; i < kCharacters; ++i) {
    EXPECT_GE(woke[i], 0) << i;
    EXPECT_LE(woke[i], 5) << i;
  }
}

TEST_F(SceneTest, BudgetsBelowDrawingRunNoTick) {
  EXPECT_EQ(Plan(1 / 60.0f, 1000), kCharacters * kDraw);
  for (uint32_t i = 0; i < kCharacters; ++i) EXPECT_EQ(Run(i, Pose(i), 1 / 60.0f).ticks, 0u);
}

TEST_F(SceneTest, RefusesWhatIsNone) {
  dcloth_scene* scene = nullptr;
  const size_t size = dcloth_scene_storage_size(3);
  EXPECT_EQ(dcloth_scene_storage_size(0), 0u);
  EXPECT_EQ(dcloth_scene_storage_size(65537), 0u);
  kernels::GuardedBuffer<uint8_t> storage(size, kernels::Place::kEnd);
  EXPECT_EQ(dcloth_scene_create(3, storage.data(), size - 1, &scene, nullptr), DCLOTH_ERROR_MEMORY);
  EXPECT_EQ(dcloth_scene_create(3, nullptr, size, &scene, nullptr), DCLOTH_ERROR_ARGUMENT);
  EXPECT_EQ(dcloth_scene_create(0, storage.data(), size, &scene, nullptr), DCLOTH_ERROR_ARGUMENT);
  EXPECT_EQ(scene, nullptr);
  ASSERT_EQ(dcloth_scene_create(3, storage.data(), size, &scene, nullptr), DCLOTH_OK);
  EXPECT_TRUE(storage.SlackUntouched());
  EXPECT_EQ(Set(0, NAN), DCLOTH_ERROR_ARGUMENT);
  EXPECT_EQ(Set(0, -1), DCLOTH_ERROR_ARGUMENT);
  EXPECT_EQ(dcloth_scene_set(scene_, kCharacters, nullptr), DCLOTH_ERROR_ARGUMENT);
  EXPECT_EQ(dcloth_scene_set_importance(scene_, 0, INFINITY), DCLOTH_ERROR_ARGUMENT);
  EXPECT_EQ(Set(0, 3.4e38f), DCLOTH_OK) << "any finite number";
  const dcloth_scene_frame unlimited = {sizeof(unlimited), 1 / 60.0f, 3.4e38f, 0};
  EXPECT_EQ(dcloth_scene_plan(scene_, &unlimited, nullptr), DCLOTH_OK);
  for (const float bad : {NAN, INFINITY, -1.0f}) {
    const dcloth_scene_frame frames[] = {{sizeof(dcloth_scene_frame), bad, 1, 0},
                                         {sizeof(dcloth_scene_frame), 1, bad, 0},
                                         {sizeof(dcloth_scene_frame), 1, 1, bad},
                                         {sizeof(dcloth_scene_frame) - 1, 1, 1, 0}};
    for (const dcloth_scene_frame& frame : frames)
      EXPECT_EQ(dcloth_scene_plan(scene_, &frame, nullptr), DCLOTH_ERROR_ARGUMENT);
  }
  dcloth_scene_choice choice = {};
  choice.struct_size = sizeof(choice);
  EXPECT_EQ(dcloth_scene_get(scene, 0, &choice), DCLOTH_ERROR_ARGUMENT) << "an empty slot";
  EXPECT_EQ(dcloth_scene_get(scene_, 0, &choice), DCLOTH_OK);
  EXPECT_EQ(dcloth_scene_get(scene_, kCharacters, &choice), DCLOTH_ERROR_ARGUMENT) << "behind the last slot";
  EXPECT_EQ(dcloth_scene_get(nullptr, 0, &choice), DCLOTH_ERROR_ARGUMENT);
  EXPECT_EQ(dcloth_scene_get(scene_, 0, nullptr), DCLOTH_ERROR_ARGUMENT);
  choice.struct_size = offsetof(dcloth_scene_choice, draw) - 1;
  EXPECT_EQ(dcloth_scene_get(scene_, 0, &choice), DCLOTH_ERROR_ARGUMENT);
  choice.struct_size = sizeof(choice);
  EXPECT_EQ(dcloth_scene_set(scene_, 0, nullptr), DCLOTH_OK);
  EXPECT_EQ(dcloth_scene_get(scene_, 0, &choice), DCLOTH_ERROR_ARGUMENT);
  Plan(1 / 60.0f, 5000);  // with a hole in it
}

TEST_F(SceneTest, PlansWithoutAllocation) {
  size_t allocations = 0;
  const dcloth_scene_frame frame = {sizeof(frame), 1 / 60.0f, 6000, 0};
  {
    const AllocationTrap trap;
    for (int i = 0; i < 100; ++i) (void)dcloth_scene_plan(scene_, &frame, nullptr);
    allocations = trap.count();
  }
  EXPECT_EQ(allocations, 0u);
}

}  // namespace
}  // namespace dcloth::testing

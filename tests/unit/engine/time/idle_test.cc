// DCLOTH_FRAME_FREEZE_IDLE: a garment at rest costs drawing only, wakes at once and does not pop.
#include "engine/src/time/idle.h"

#include <functional>

#include "engine/src/base/arithmetic.h"
#include "engine/src/network/displacement.h"
#include "tests/unit/engine/update_fixture.h"

namespace dcloth::testing {
namespace {

constexpr uint32_t kFreeze = DCLOTH_FRAME_FREEZE_IDLE;

class IdleTest : public UpdateTest {
 protected:
  bool Frozen(OwnedCloth* cloth) { return Describe(cloth).frozen != 0; }

  // Walks two seconds, then holds the pose until the cloth is frozen; returns the frames that took.
  int Settle(OwnedCloth* cloth, float seconds, uint32_t flags = kFreeze) {
    for (double time = 0; time < 2; time += static_cast<double>(seconds)) {
      EXPECT_EQ(cloth->Update(Pose(time), seconds, kAll, flags), DCLOTH_OK);
      EXPECT_FALSE(Frozen(cloth)) << "while it walks, at " << time;
    }
    int frames = 0;
    while (!Frozen(cloth) && frames < 2000) {
      EXPECT_EQ(cloth->Update(Pose(2), seconds, kAll, flags), DCLOTH_OK);
      ++frames;
    }
    EXPECT_LT(frames, 2000) << "never frozen";
    return frames;
  }

  static std::vector<float> Moved(std::vector<float> matrices, size_t joint, float metres) {
    matrices[16 * joint + 3] += metres;
    return matrices;
  }
};

TEST_F(IdleTest, FrozenFramesRunNoTick) {
  for (const uint32_t flags : {kFreeze, kFreeze | DCLOTH_FRAME_PIPELINED}) {
    for (const float seconds : {1 / 30.0f, 1 / 47.0f, 1 / 60.0f, 1 / 144.0f}) {
      OwnedCloth cloth(opened_);
      const int frames = Settle(&cloth, seconds, flags);
      EXPECT_GE(static_cast<double>(frames) * static_cast<double>(seconds), (engine::kIdleTicks - 1) * kTick);
      for (int frame = 0; frame < 100; ++frame) {
        const std::vector<float> before = cloth.positions();
        ASSERT_EQ(cloth.Update(Pose(2), seconds, kAll, flags), DCLOTH_OK);
        if (frame > 0) {
          ASSERT_EQ(Describe(&cloth).tick_share, 0);  // at first there may be the rest of a tick in work
        }
        ASSERT_TRUE(Frozen(&cloth));
        if (frame > 0) {
          ASSERT_EQ(cloth.positions(), before);
        }
      }
    }
  }
}

// Never without the flag, and a frame without it wakes.
TEST_F(IdleTest, OnlyWhereAsked) {
  OwnedCloth cloth(opened_), asked(opened_);
  for (int frame = 0; frame < 2000; ++frame) ASSERT_EQ(Update(&cloth, Pose(2), 1 / 60.0f), DCLOTH_OK);
  EXPECT_EQ(Describe(&cloth).frozen, 0u);
  Settle(&asked, 1 / 60.0f);
  ASSERT_EQ(Update(&asked, Pose(2), 1 / 60.0f), DCLOTH_OK);
  EXPECT_EQ(Describe(&asked).frozen, 0u);
  EXPECT_EQ(TicksRun(&asked), 1);
}

// A host that spreads ticks over frames by dcloth_cloth_info.tick_waits keeps no place for a cloth that wants none.
TEST_F(IdleTest, NoTickWaitsWhileFrozen) {
  OwnedCloth cloth(opened_);
  Settle(&cloth, 1 / 60.0f);
  for (const uint32_t flags : {kFreeze, kFreeze | DCLOTH_FRAME_HOLD}) {
    ASSERT_EQ(Update(&cloth, Pose(2), 1 / 60.0f, flags), DCLOTH_OK);
    ASSERT_TRUE(Frozen(&cloth));
    EXPECT_EQ(Describe(&cloth).tick_waits, 0u);
  }
  // Woken in a frame that may start no tick, it has one that waits.
  ASSERT_EQ(Update(&cloth, Moved(Pose(2), 0, 1e-3f), 1 / 60.0f, kFreeze | DCLOTH_FRAME_HOLD), DCLOTH_OK);
  ASSERT_FALSE(Frozen(&cloth));
  EXPECT_EQ(Describe(&cloth).tick_waits, 1u);
}

// Half of the threshold moves nothing, twice of it wakes in that very frame, whichever joint it is; so does a slow
// drift once it adds up, a jump and another level. Without time nothing wakes.
TEST_F(IdleTest, WakesAtOnce) {
  const std::vector<float> still = Pose(2);
  for (size_t joint = 0; joint < model_.numbers.spec.joints; ++joint) {
    OwnedCloth cloth(opened_);
    Settle(&cloth, 1 / 60.0f);
    ASSERT_EQ(Update(&cloth, Moved(still, joint, 2.5e-4f), 1 / 60.0f, kFreeze), DCLOTH_OK);
    EXPECT_TRUE(Frozen(&cloth)) << joint;
    ASSERT_EQ(Update(&cloth, Moved(still, joint, 1e-3f), 0, kFreeze), DCLOTH_OK);
    EXPECT_TRUE(Frozen(&cloth)) << "time stands still";
    ASSERT_EQ(Update(&cloth, Moved(still, joint, 1e-3f), 1 / 144.0f, kFreeze), DCLOTH_OK);
    EXPECT_FALSE(Frozen(&cloth)) << joint;
    EXPECT_EQ(TicksRun(&cloth), 1) << joint;
  }
  OwnedCloth drifting(opened_), jumping(opened_), changing(opened_);
  for (OwnedCloth* cloth : {&drifting, &jumping, &changing}) Settle(cloth, 1 / 60.0f);
  int frames = 0;
  while (Frozen(&drifting) && frames < 100)
    ASSERT_EQ(Update(&drifting, Moved(still, 0, 1e-5f * static_cast<float>(++frames)), 1 / 60.0f, kFreeze), DCLOTH_OK);
  EXPECT_GT(frames, 45);
  EXPECT_LT(frames, 55) << "50 frames of 0.01 mm are the 0.5 mm allowed";
  ASSERT_EQ(Update(&jumping, still, 1 / 60.0f, kFreeze | DCLOTH_FRAME_JUMPED), DCLOTH_OK);
  EXPECT_EQ(TicksRun(&jumping), 1);
  ASSERT_EQ(changing.Update(still, 1 / 60.0f, DCLOTH_STAGES_SKELETON, kFreeze), DCLOTH_OK);
  EXPECT_EQ(TicksRun(&changing), 1);
}

// At 30 Hz, where a cloth that never froze has its ticks in the same frames: while frozen the two differ by no more
// than what the unfrozen one still settles, and after waking they move together.
TEST_F(IdleTest, StaysNearTheOneThatNeverFroze) {
  const auto seconds = static_cast<float>(kTick);
  OwnedCloth frozen(opened_), twin(opened_);
  double at_rest = 0, awake = 0;
  const auto both = [&](double time, double* worst) {
    ASSERT_EQ(frozen.Update(Pose(time), seconds, kAll, kFreeze), DCLOTH_OK);
    ASSERT_EQ(twin.Update(Pose(time), seconds, kAll), DCLOTH_OK);
    *worst = std::max(*worst, LargestDistance(frozen.positions(), twin.positions()));
  };
  for (int tick = 0; tick < 60; ++tick) both(tick * kTick, &awake);
  EXPECT_EQ(awake, 0) << "the flag changes nothing while there is motion";
  for (int tick = 0; tick < 200; ++tick) both(2, &at_rest);
  ASSERT_TRUE(Frozen(&frozen));
  for (int tick = 1; tick < 90; ++tick) {
    both(2 + tick * kTick, &awake);
    ASSERT_LT(Describe(&frozen).lag_seconds, 1e-6) << "a rest makes nothing late";
  }
  std::printf("frozen: up to %.4f mm off at rest, %.4f mm after waking\n", at_rest * 1e3, awake * 1e3);
  EXPECT_LE(at_rest, 1e-3);
  EXPECT_LE(awake, 1e-3);
}

// No pop at any rate. Drawn on one pose, so that only the displacement moves: freezing may take away the way to the
// newest tick, which is at most the settled step along each axis; waking must move no farther in a frame than a
// cloth that was never frozen moves in its largest frame of the same motion.
TEST_F(IdleTest, NothingPops) {
  const std::vector<float> still = Pose(0);
  for (const double rate : {30.0, 60.0, 144.0}) {
    const auto seconds = static_cast<float>(1 / rate);
    OwnedCloth cloth(opened_), twin(opened_);
    double moving = 0, resting = 0, waking = 0;
    std::vector<float> last, last_twin;
    bool was_frozen = false;
    int since_waking = -1;
    for (double time = 0; time < 14; time += 1 / rate) {
      const double pose_time = time < 2 ? time : time < 12 ? 2 : time - 10;
      ASSERT_EQ(Update(&cloth, Pose(pose_time), seconds, kFreeze), DCLOTH_OK);
      ASSERT_EQ(Update(&twin, Pose(pose_time), seconds), DCLOTH_OK);
      const bool frozen = Frozen(&cloth);
      const std::vector<float> drawn = DrawOn(&cloth, still, Pose(pose_time), kFreeze);
      const std::vector<float> drawn_twin = DrawOn(&twin, still, Pose(pose_time));
      if (was_frozen && !frozen) since_waking = 0;
      if (!last.empty() && time > 0.5) {
        const double step = LargestDistance(drawn, last);
        moving = std::max(moving, LargestDistance(drawn_twin, last_twin));
        if (frozen) resting = std::max(resting, step);
        if (since_waking >= 0) waking = std::max(waking, step);
      }
      was_frozen = frozen;
      last = drawn;
      last_twin = drawn_twin;
    }
    std::printf("%g Hz: a frame moves up to %.4f mm, frozen %.4f, after waking %.4f\n", rate, moving * 1e3,
                resting * 1e3, waking * 1e3);
    EXPECT_GE(since_waking, 0) << "never woke";
    EXPECT_LE(resting, 2 * std::sqrt(3.0) * static_cast<double>(engine::kSettledMetres));
    EXPECT_LE(waking, moving * 1.1 + 2 * std::sqrt(3.0) * static_cast<double>(engine::kSettledMetres));
  }
}

// The count alone, on ticks made here: the pose stands still and one row of the basis goes its way.
class IdleCountTest : public ::testing::TestWithParam<ModelSpec> {
 protected:
  static constexpr int kNever = 1000;

  // The tick after which the cloth is frozen. In tick t the vertex that row `row` moves farthest is at way(t) along an
  // axis, in metres.
  int FreezesAfter(size_t row, const std::function<double(int)>& way) {
    OwnedCloth owned(opened_);
    auto* cloth = reinterpret_cast<engine::Cloth*>(owned.get());
    const format::ModelView& model = *cloth->model;
    auto* c = const_cast<float*>(engine::BasisCoefficients(model, cloth->coefficients));
    const double per_metre = 1 / Reach(cloth, c, row);
    const std::vector<engine::Affine> pose(model.joint_count);
    for (int tick = 1; tick < kNever; ++tick) {
      c[row] = static_cast<float>(way(tick) * per_metre);
      cloth->newest = (cloth->newest + 1) % engine::kTickSlots;
      cloth->tick_count = std::min(cloth->tick_count + 1, engine::kTickSlots);
      Displace(cloth);
      engine::CountTickBegun(cloth, pose.data());
      engine::CountTickDone(cloth);
      if (engine::IsFrozen(*cloth)) return tick;
    }
    return kNever;
  }

  const ModelSpec spec_ = GetParam();
  const TestModel model_ = BuildModel(spec_);
  const OpenedModel opened_{model_};

 private:
  static void Displace(engine::Cloth* cloth) {
    engine::ApplyLinear(engine::ActiveKernels(),
                        engine::DisplacementProduct(*cloth->model, kAll, cloth->coefficients, cloth->quantized,
                                                    cloth->displacement[cloth->newest]));
  }
  static double Reach(engine::Cloth* cloth, float* c, size_t row) {
    c[row] = 1;
    Displace(cloth);
    float reach = 0;
    for (size_t i = 0; i < engine::DisplacementFloats(*cloth->model); ++i)
      reach = std::max(reach, std::fabs(cloth->displacement[cloth->newest][i]));
    return static_cast<double>(reach);
  }
};

TEST_P(IdleCountTest, CreepsAndSwingsStayAwake) {
  // The first tick has none before it to be compared with, so the fifteen begin with the second.
  constexpr int kSoonest = 1 + static_cast<int>(engine::kIdleTicks), kSteps = static_cast<int>(engine::kIdleTicks) - 1;
  constexpr double kLimit = static_cast<double>(engine::kSettledMetres), kAway = 0.02;
  const size_t rows = model_.numbers.basis.rows;
  ASSERT_GT(rows, 2u);
  for (const size_t row : {size_t{0}, rows - 2}) {
    const auto creep = [&](double metres) {
      return FreezesAfter(row, [&](int tick) { return kAway + metres * tick; });
    };
    EXPECT_EQ(creep(0), kSoonest);
    EXPECT_EQ(creep(0.8 * kLimit), kNever) << "1.2 mm in a second";
    EXPECT_EQ(creep(-1.2 * kLimit / kSteps), kNever) << "0.13 mm in a second";
    EXPECT_EQ(creep(0.8 * kLimit / kSteps), kSoonest);
    EXPECT_EQ(FreezesAfter(row, [&](int tick) { return kAway + (tick % 2 == 0 ? 0.4 : -0.4) * kLimit; }), kSoonest)
        << "a tremble that leads nowhere";
    EXPECT_EQ(FreezesAfter(row, [&](int tick) { return kAway + 1e-3 * std::sin(0.4 * tick); }), kNever) << "a swing";
    const int stopped = FreezesAfter(row, [&](int tick) { return kAway + 0.5 * kLimit * std::min(tick, 40); });
    EXPECT_GE(stopped, 40 + kSoonest - 2);
    EXPECT_LE(stopped, 40 + 2 * kSoonest) << "a half second that crept, and one that did not";
  }
}

std::vector<ModelSpec> Precisions() {
  std::vector<ModelSpec> specs;
  for (const format::DType precision : {format::DType_F32, format::DType_F16, format::DType_I8}) {
    for (const uint32_t rank : {0u, 8u}) {
      ModelSpec spec;
      spec.precision = precision;
      spec.rank = rank;
      specs.push_back(spec);
    }
  }
  return specs;
}
INSTANTIATE_TEST_SUITE_P(Models, IdleCountTest, ::testing::ValuesIn(Precisions()));

// A state saved within the half second freezes in the same frame as the one that went on, to the bit. One of another
// rank and precision takes it too, and counts anew.
TEST_F(IdleTest, SavedWhileItCounts) {
  ModelSpec other_spec;
  other_spec.rank = 8;
  other_spec.precision = format::DType_I8;
  const TestModel other_model = BuildModel(other_spec);
  const OpenedModel other(other_model);
  OwnedCloth cloth(opened_);
  Settle(&cloth, 1 / 30.0f);
  ASSERT_EQ(Update(&cloth, Pose(2), 1 / 30.0f), DCLOTH_OK) << "wakes";
  for (int counted = 1; counted < 20; ++counted) {
    ASSERT_EQ(Update(&cloth, Pose(2), 1 / 30.0f, kFreeze), DCLOTH_OK);
    std::vector<uint8_t> state(dcloth_cloth_state_size(cloth.get()));
    ASSERT_EQ(dcloth_cloth_save(cloth.get(), state.data(), state.size(), nullptr), DCLOTH_OK);
    OwnedCloth restored(opened_), elsewhere(other);
    ASSERT_EQ(dcloth_cloth_restore(restored.get(), state.data(), state.size(), 0, nullptr), DCLOTH_OK) << counted;
    dcloth_error error = EmptyError();
    ASSERT_EQ(dcloth_cloth_restore(elsewhere.get(), state.data(), state.size(), DCLOTH_RESTORE_OTHER_MODEL, &error),
              DCLOTH_OK)
        << error.text;
    EXPECT_EQ(Frozen(&elsewhere), Frozen(&cloth));
    int frames = counted;
    for (; !Frozen(&restored); ++frames) ASSERT_EQ(Update(&restored, Pose(2), 1 / 30.0f, kFreeze), DCLOTH_OK);
    EXPECT_EQ(frames, std::max(counted, static_cast<int>(engine::kIdleTicks))) << counted;
    for (frames = 0; !Frozen(&elsewhere) && frames < 200; ++frames)
      ASSERT_EQ(Update(&elsewhere, Pose(2), 1 / 30.0f, kFreeze), DCLOTH_OK);
    EXPECT_LT(frames, 200) << "never frozen";
  }
}

}  // namespace
}  // namespace dcloth::testing

// A model exchanged while the game runs, as dcloth.h describes it: the new cloth in other memory, what can be carried
// over carried over, the old memory given back.
#include <algorithm>
#include <memory>

#include "engine/src/cloth.h"
#include "engine/src/time/idle.h"
#include "tests/unit/engine/state_fixture.h"
#include "tests/unit/engine/update_fixture.h"

namespace dcloth::testing {
namespace {

struct Garment {
  explicit Garment(const ModelSpec& spec, uint64_t identity) : model(BuildModel(spec)) {
    model.tables->identity = identity;
    opened = std::make_unique<OpenedModel>(model);
    cloth = std::make_unique<OwnedCloth>(*opened);
  }
  dcloth_status Update(double time, float seconds, uint32_t flags = 0) {
    return cloth->Update(PoseAt(model.numbers, time), seconds, kAll, flags);
  }

  TestModel model;
  std::unique_ptr<OpenedModel> opened;
  std::unique_ptr<OwnedCloth> cloth;
};

constexpr float kFrame = 1 / 100.0f;

// Another file with the same network, told apart by its identity alone: with the flag it goes on to the bit.
TEST(HotSwap, TheSameNetworkGoesOn) {
  Garment older({}, 1), newer({}, 2), never({}, 1);
  for (int frame = 0; frame < 100; ++frame) {
    ASSERT_EQ(older.Update(frame * 0.01, kFrame), DCLOTH_OK);
    ASSERT_EQ(never.Update(frame * 0.01, kFrame), DCLOTH_OK);
  }
  const StateBytes state = Save(older.cloth.get()), fresh = Save(newer.cloth.get());
  dcloth_error error = EmptyError();
  ASSERT_EQ(Restore(newer.cloth.get(), state, 0, &error), DCLOTH_ERROR_MODEL);
  EXPECT_EQ(std::string(error.text).find("identity: found 1; allowed: 2, which is '"), 0u) << error.text;
  ASSERT_EQ(Save(newer.cloth.get()), fresh);
  ASSERT_EQ(Restore(newer.cloth.get(), state, DCLOTH_RESTORE_OTHER_MODEL, &error), DCLOTH_OK) << error.text;
  older.cloth.reset();
  older.opened.reset();
  for (int frame = 100; frame < 400; ++frame) {
    ASSERT_EQ(newer.Update(frame * 0.01, kFrame), DCLOTH_OK);
    ASSERT_EQ(never.Update(frame * 0.01, kFrame), DCLOTH_OK);
    ASSERT_EQ(newer.cloth->positions(), never.cloth->positions()) << frame;
  }
}

// Without an identity (format 1.1) names and sizes tell models apart.
TEST(HotSwap, FilesWithoutIdentity) {
  Garment first({}, 0), second({}, 0);
  ASSERT_EQ(first.Update(0, kFrame), DCLOTH_OK);
  EXPECT_EQ(Restore(second.cloth.get(), Save(first.cloth.get())), DCLOTH_OK);
  TestModel renamed = BuildModel({});
  renamed.tables->garment->name = "cape";
  const OpenedModel opened(renamed);
  OwnedCloth cape(opened);
  EXPECT_EQ(Restore(&cape, Save(first.cloth.get())), DCLOTH_ERROR_MODEL);
}

// A tick in work is of its model: other precisions cut it in other places.
TEST(HotSwap, NotWithATickInWork) {
  Garment older({}, 1), newer({}, 2);
  StateBytes state;
  for (int frame = 0; state.empty() || !InWork(state); ++frame) {
    ASSERT_LT(frame, 100);
    ASSERT_EQ(older.Update(frame * 0.01, kFrame, DCLOTH_FRAME_PIPELINED), DCLOTH_OK);
    state = Save(older.cloth.get());
  }
  dcloth_error error = EmptyError();
  ASSERT_EQ(Restore(newer.cloth.get(), state, DCLOTH_RESTORE_OTHER_MODEL, &error), DCLOTH_ERROR_MODEL);
  EXPECT_NE(std::string(error.text).find("save after an update without DCLOTH_FRAME_PIPELINED"), std::string::npos)
      << error.text;
  ASSERT_EQ(older.Update(1, kFrame), DCLOTH_OK);
  EXPECT_EQ(Restore(newer.cloth.get(), Save(older.cloth.get()), DCLOTH_RESTORE_OTHER_MODEL), DCLOTH_OK);
}

// From precision to precision: what is drawn at the moment of the change is the same to the bit. (The builder's int8
// models are other garments: their scales take random numbers too.)
TEST(HotSwap, OtherPrecisionsTakeOverWhatIsDrawn) {
  ModelSpec spec;
  auto current = std::make_unique<Garment>(spec, 1);
  double time = 0;
  uint64_t identity = 1;
  for (const format::DType precision : {format::DType_F16, format::DType_F32}) {
    for (int frame = 0; frame < 50; ++frame) ASSERT_EQ(current->Update(time += 0.01, kFrame), DCLOTH_OK);
    spec.precision = precision;
    auto next = std::make_unique<Garment>(spec, ++identity);
    ASSERT_EQ(next->model.numbers.influence_weights, current->model.numbers.influence_weights) << "another garment";
    ASSERT_NE(next->model.numbers.basis.weights, current->model.numbers.basis.weights) << "the same precision";
    ASSERT_EQ(Restore(next->cloth.get(), Save(current->cloth.get())), DCLOTH_ERROR_MODEL);
    ASSERT_EQ(Restore(next->cloth.get(), Save(current->cloth.get()), DCLOTH_RESTORE_OTHER_MODEL), DCLOTH_OK);
    const std::vector<float> pose = PoseAt(current->model.numbers, time);
    ASSERT_EQ(current->cloth->Update(pose, 0, kAll), DCLOTH_OK);
    ASSERT_EQ(next->cloth->Update(pose, 0, kAll), DCLOTH_OK);
    EXPECT_EQ(next->cloth->positions(), current->cloth->positions()) << format::EnumNameDType(precision);
    current = std::move(next);
  }
}

engine::Cloth* Inside(Garment* garment) { return reinterpret_cast<engine::Cloth*>(garment->cloth->get()); }

// Features of the old model may lie outside of what the new one was trained on: they come into its range, or to the
// zero of a reset.
TEST(HotSwap, FeaturesComeIntoTheNewRange) {
  Garment older({}, 1), newer({}, 2);
  const format::ModelT& tables = *newer.model.tables;
  const size_t count = newer.model.numbers.d;
  constexpr float kRanges[][2] = {{-0.1f, 0.2f}, {0.1f, 0.2f}, {-0.2f, -0.1f}, {-2, 2}};
  std::vector<uint8_t>& weights = newer.model.tables->weights;
  for (size_t i = 0; i < count; ++i) {
    std::memcpy(weights.data() + tables.features->low->offset + 4 * i, &kRanges[i % 4][0], 4);
    std::memcpy(weights.data() + tables.features->high->offset + 4 * i, &kRanges[i % 4][1], 4);
  }
  newer.opened = std::make_unique<OpenedModel>(newer.model);
  newer.cloth = std::make_unique<OwnedCloth>(*newer.opened);
  for (int frame = 0; frame < 50; ++frame) ASSERT_EQ(older.Update(frame * 0.01, kFrame), DCLOTH_OK);
  ASSERT_EQ(Restore(newer.cloth.get(), Save(older.cloth.get()), DCLOTH_RESTORE_OTHER_MODEL), DCLOTH_OK);
  size_t moved = 0;
  for (size_t i = 0; i < count; ++i) {
    const float low = std::min(kRanges[i % 4][0], 0.0f), high = std::max(kRanges[i % 4][1], 0.0f);
    const float was = Inside(&older)->features[i];
    EXPECT_EQ(Inside(&newer)->features[i], std::clamp(was, low, high)) << i;
    moved += was < low || was > high ? 1 : 0;
  }
  EXPECT_GT(moved, count / 4);
}

// Coefficients from which rest is judged are of one file: with another the half second begins anew. Rest itself stays.
TEST(HotSwap, TheHalfSecondOfRestBeginsAnew) {
  for (const bool frozen : {false, true}) {
    for (const bool other : {false, true}) {
      Garment older({}, 1), newer({}, other ? 2 : 1);
      for (int frame = 0; frame < 50; ++frame)
        ASSERT_EQ(older.Update(frame * 0.01, kFrame, DCLOTH_FRAME_FREEZE_IDLE), DCLOTH_OK);
      engine::Cloth* from = Inside(&older);
      from->idle_ticks = frozen ? engine::kIdleTicks : 5;
      const size_t floats = engine::IdleStartFloats(*from->model);
      for (size_t i = 0; i < floats; ++i) from->idle_start[i] = static_cast<float>(i);
      ASSERT_EQ(Restore(newer.cloth.get(), Save(older.cloth.get()), DCLOTH_RESTORE_OTHER_MODEL), DCLOTH_OK);
      const engine::Cloth* to = Inside(&newer);
      EXPECT_EQ(to->idle_ticks, frozen || !other ? from->idle_ticks : 0u) << frozen << other;
      EXPECT_EQ(engine::IsFrozen(*to), frozen);
      if (frozen || other) continue;
      EXPECT_TRUE(std::equal(from->idle_start, from->idle_start + floats, to->idle_start));
    }
  }
}

// A basis of another rank keeps other coefficients: those saved are stepped over, and all behind them arrives.
TEST(HotSwap, RestOfAnotherRankIsSteppedOver) {
  ModelSpec spec;
  Garment full(spec, 1);
  spec.rank = 14;
  Garment reduced(spec, 2);
  for (int frame = 0; frame < 50; ++frame) ASSERT_EQ(full.Update(frame * 0.01, kFrame), DCLOTH_OK);
  engine::Cloth* from = Inside(&full);
  from->idle_ticks = 5;
  std::fill_n(from->idle_start, engine::IdleStartFloats(*from->model), 0.5f);
  ASSERT_NE(engine::IdleStartFloats(*from->model), engine::IdleStartFloats(*Inside(&reduced)->model));
  ASSERT_EQ(Restore(reduced.cloth.get(), Save(full.cloth.get()), DCLOTH_RESTORE_OTHER_MODEL), DCLOTH_OK);
  const engine::Cloth* to = Inside(&reduced);
  EXPECT_EQ(to->idle_ticks, 0u);
  const size_t columns = size_t{3} * full.model.numbers.n;
  for (uint32_t back = 0; back < from->tick_count; ++back) {
    const float* old = from->displacement[(from->newest + engine::kTickSlots - back) % engine::kTickSlots];
    const float* now = to->displacement[(to->newest + engine::kTickSlots - back) % engine::kTickSlots];
    EXPECT_TRUE(std::equal(old, old + columns, now)) << back;
  }
}

// Another network: refused by name, so both run for a second, the new one unseen, and the old memory goes back.
TEST(HotSwap, AnotherNetworkRunsInBesideTheOld) {
  ModelSpec other;
  other.units = 23;
  other.seed = 9;
  Garment older({}, 1), newer(other, 2), twin(other, 2);
  double time = 0;
  for (int frame = 0; frame < 100; ++frame) ASSERT_EQ(older.Update(time += 0.01, kFrame), DCLOTH_OK);
  dcloth_error error = EmptyError();
  ASSERT_EQ(Restore(newer.cloth.get(), Save(older.cloth.get()), DCLOTH_RESTORE_OTHER_MODEL, &error),
            DCLOTH_ERROR_MODEL);
  EXPECT_EQ(std::string(error.text).find("skeleton_units: found 19; allowed: 23"), 0u) << error.text;
  for (int frame = 0; frame < 100; ++frame) {
    ASSERT_EQ(older.Update(time += 0.01, kFrame), DCLOTH_OK);
    const std::vector<float> matrices = PoseAt(newer.model.numbers, time);
    const dcloth_pose pose = OwnedCloth::Pose(matrices);
    const dcloth_frame unseen = {sizeof(unseen), kAll, kFrame, 0, nullptr};
    ASSERT_EQ(dcloth_cloth_update(newer.cloth->get(), &pose, &unseen, nullptr, nullptr), DCLOTH_OK);
    ASSERT_EQ(twin.Update(time, kFrame), DCLOTH_OK);
  }
  older.cloth.reset();
  older.opened.reset();
  for (int frame = 0; frame < 100; ++frame) {
    time += 0.01;
    ASSERT_EQ(newer.Update(time, kFrame), DCLOTH_OK);
    ASSERT_EQ(twin.Update(time, kFrame), DCLOTH_OK);
    ASSERT_EQ(newer.cloth->positions(), twin.cloth->positions()) << "unseen frames are frames";
  }
}

}  // namespace
}  // namespace dcloth::testing

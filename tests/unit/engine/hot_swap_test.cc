// A model exchanged while the game runs, as dcloth.h describes it: the new cloth in other memory, what can be carried
// over carried over, the old memory given back.
#include "tests/unit/engine/state_fixture.h"

#include <memory>

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
  EXPECT_EQ(std::string(error.text).find("found 1 as the identity of the model; allowed: 2 of '"), 0u) << error.text;
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

// Nor between the two ticks of a mesh stage at half rate, whose second half is of the same model as the first.
TEST(HotSwap, NotBetweenTheTicksOfAHalfRate) {
  Garment older({}, 1), newer({}, 2);
  StateBytes state;
  for (int frame = 0; state.empty() || HeadOf(state).mesh_turn == 0; ++frame) {
    ASSERT_LT(frame, 100);
    ASSERT_EQ(older.Update(frame * 0.01, kFrame, DCLOTH_FRAME_HALF_RATE_MESH), DCLOTH_OK);
    state = Save(older.cloth.get());
  }
  ASSERT_FALSE(InWork(state));
  const StateBytes fresh = Save(newer.cloth.get());
  dcloth_error error = EmptyError();
  ASSERT_EQ(Restore(newer.cloth.get(), state, DCLOTH_RESTORE_OTHER_MODEL, &error), DCLOTH_ERROR_MODEL);
  EXPECT_NE(std::string(error.text).find("save after a tick without DCLOTH_FRAME_HALF_RATE_MESH"), std::string::npos)
      << error.text;
  EXPECT_EQ(Save(newer.cloth.get()), fresh);
  for (int frame = 0; frame < 20; ++frame) ASSERT_EQ(older.Update(1 + frame * 0.01, kFrame), DCLOTH_OK);
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
    const dcloth_frame unseen = {sizeof(unseen), kAll, kFrame, 0};
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

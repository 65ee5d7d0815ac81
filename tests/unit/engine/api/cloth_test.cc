// A cloth's calls: storage size, refused arguments, stages, structs of other versions, timers. What hostile hosts do,
// allocation, shared models and resets are in tests/attack.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "tests/unit/engine/cloth_fixture.h"

namespace dcloth::testing {
namespace {

constexpr uint32_t kAll = DCLOTH_STAGES_MESH;

class ClothTest : public ::testing::Test {
 protected:
  static TestModel Build() {
    ModelSpec spec;
    spec.precision = format::DType_I8;
    return BuildModel(spec);
  }
  std::vector<float> Pose(double tick) const { return PoseAt(model_.numbers, tick / 30); }
  void Advance(OwnedCloth* cloth, int begin, int end, uint32_t stages = kAll) const {
    for (int tick = begin; tick < end; ++tick) ASSERT_EQ(cloth->Tick(Pose(tick), stages), DCLOTH_OK);
  }
  void ExpectSameFrame(OwnedCloth* a, OwnedCloth* b, double tick, float blend = 1) const {
    ASSERT_EQ(a->Skin(Pose(tick), blend), DCLOTH_OK);
    ASSERT_EQ(b->Skin(Pose(tick), blend), DCLOTH_OK);
    EXPECT_EQ(a->positions(), b->positions());
    EXPECT_EQ(a->normals(), b->normals());
  }

  TestModel model_ = Build();
  OpenedModel opened_{model_};
};

#if !defined(DCLOTH_ARENA_RED_ZONES)
// Pinned, so that growth is a decision: scratch and state of the default model, on 64-bit processors and 32-bit x86.
TEST_F(ClothTest, StorageSizeIsPinned) {
  const bool wide = sizeof(void*) == 8;
  EXPECT_EQ(dcloth_cloth_storage_size(opened_.get()), wide ? 38784u : 37376u);
  EXPECT_EQ(dcloth_model_storage_size(), wide ? 2368u : 1344u);
}
#endif

TEST_F(ClothTest, ColumnMajorPosesAreTheSamePose) {
  OwnedCloth rows(opened_), columns(opened_);
  const std::vector<float> matrices = Pose(3);
  std::vector<float> transposed(matrices.size());
  for (size_t i = 0; i < matrices.size(); ++i) transposed[i / 16 * 16 + i % 4 * 4 + i % 16 / 4] = matrices[i];
  dcloth_pose pose = OwnedCloth::Pose(transposed);
  pose.column_major = 1;
  ASSERT_EQ(rows.Tick(matrices, kAll), DCLOTH_OK);
  ASSERT_EQ(dcloth_cloth_tick(columns.get(), &pose, kAll, nullptr), DCLOTH_OK);
  ExpectSameFrame(&rows, &columns, 3);
}

// NETWORK.md, "Pose": joints without volume leave the features as they were, so the skeleton stage sees a held pose.
TEST_F(ClothTest, CollapsedJointsKeepTheirFeatures) {
  const auto scaled = [&](double tick, float scale) {
    std::vector<float> matrices = Pose(tick);
    for (size_t i = 0; i < matrices.size(); ++i) {
      if (i % 16 < 12 && i % 4 != 3) matrices[i] *= scale;
    }
    return matrices;
  };
  OwnedCloth held(opened_), collapsed(opened_), small(opened_);
  for (OwnedCloth* cloth : {&held, &collapsed, &small}) Advance(cloth, 0, 11, DCLOTH_STAGES_SKELETON);
  ASSERT_EQ(held.Tick(Pose(10), DCLOTH_STAGES_SKELETON), DCLOTH_OK);
  ASSERT_EQ(collapsed.Tick(scaled(10, 0.0f), DCLOTH_STAGES_SKELETON), DCLOTH_OK);
  ExpectSameFrame(&held, &collapsed, 10);
  // 2 % along each axis is a volume of 8e-6: still a rotation, and one far from the pose before.
  ASSERT_EQ(small.Tick(scaled(10, 0.02f), DCLOTH_STAGES_SKELETON), DCLOTH_OK);
  ASSERT_EQ(small.Skin(Pose(10), 1), DCLOTH_OK);
  EXPECT_NE(small.positions(), held.positions());

  // After a reset nothing of the past is left to keep.
  OwnedCloth fresh(opened_);
  ASSERT_EQ(dcloth_cloth_reset(held.get()), DCLOTH_OK);
  for (OwnedCloth* cloth : {&held, &fresh}) ASSERT_EQ(cloth->Tick(scaled(0, 0.0f), kAll), DCLOTH_OK);
  ExpectSameFrame(&held, &fresh, 0);
}

TEST_F(ClothTest, BadArgumentsAreRefused) {
  OwnedCloth cloth(opened_);
  const std::vector<float> matrices = Pose(0);
  std::vector<float> out(3 * model_.numbers.n);
  const dcloth_pose good_pose = OwnedCloth::Pose(matrices);
  const dcloth_output good_output = FloatOutput(model_.numbers.n, out.data(), 12, out.data());
  const auto tick = [&](const dcloth_pose* pose, uint32_t stages) {
    return dcloth_cloth_tick(cloth.get(), pose, stages, nullptr);
  };
  AlignedBytes storage(dcloth_cloth_storage_size(opened_.get()));
  dcloth_cloth* created = nullptr;
  EXPECT_EQ(dcloth_cloth_create(opened_.get(), nullptr, storage.size(), &created, nullptr), DCLOTH_ERROR_ARGUMENT);
  EXPECT_EQ(dcloth_cloth_create(nullptr, storage.data(), storage.size(), &created, nullptr), DCLOTH_ERROR_ARGUMENT);
  EXPECT_EQ(dcloth_cloth_storage_size(nullptr), 0u);
  EXPECT_EQ(dcloth_cloth_tick(nullptr, &good_pose, kAll, nullptr), DCLOTH_ERROR_ARGUMENT);
  EXPECT_EQ(dcloth_cloth_reset(nullptr), DCLOTH_ERROR_ARGUMENT);
  EXPECT_EQ(tick(nullptr, kAll), DCLOTH_ERROR_ARGUMENT);
  for (const uint32_t stages : {0u, 2u, 4u, 5u, 6u, 8u, 15u, ~0u})
    EXPECT_EQ(tick(&good_pose, stages), DCLOTH_ERROR_ARGUMENT) << stages;
  dcloth_pose pose = good_pose;
  pose.struct_size = 4;
  EXPECT_EQ(tick(&pose, kAll), DCLOTH_ERROR_ARGUMENT);
  pose = good_pose;
  pose.joint_matrices = nullptr;
  EXPECT_EQ(tick(&pose, kAll), DCLOTH_ERROR_ARGUMENT);
  pose = good_pose;
  pose.column_major = 2;
  EXPECT_EQ(tick(&pose, kAll), DCLOTH_ERROR_ARGUMENT);
  pose = good_pose;
  pose.joint_count -= 1;
  EXPECT_EQ(tick(&pose, kAll), DCLOTH_ERROR_POSE);
  EXPECT_EQ(dcloth_cloth_skin(cloth.get(), &pose, 1, &good_output, nullptr), DCLOTH_ERROR_POSE);
  dcloth_timer small_timer = {};
  EXPECT_EQ(dcloth_cloth_tick(cloth.get(), &good_pose, kAll, &small_timer), DCLOTH_ERROR_ARGUMENT);

  const auto skin = [&](float blend, auto change) {
    dcloth_output output = good_output;
    change(&output);
    return dcloth_cloth_skin(cloth.get(), &good_pose, blend, &output, nullptr);
  };
  const auto nothing = [](dcloth_output*) {};
  EXPECT_EQ(skin(1, nothing), DCLOTH_OK);
  for (const float blend : {-0.01f, 1.01f, std::numeric_limits<float>::quiet_NaN()})
    EXPECT_EQ(skin(blend, nothing), DCLOTH_ERROR_ARGUMENT);
  EXPECT_EQ(skin(1, [](dcloth_output* o) { o->vertex_count += 1; }), DCLOTH_ERROR_ARGUMENT);
  EXPECT_EQ(skin(1, [](dcloth_output* o) { o->positions = nullptr; }), DCLOTH_ERROR_ARGUMENT);
  EXPECT_EQ(skin(1, [](dcloth_output* o) { o->position_stride_bytes = 8; }), DCLOTH_ERROR_ARGUMENT);
  EXPECT_EQ(skin(1, [](dcloth_output* o) { o->normal_stride_bytes = 13; }), DCLOTH_ERROR_ARGUMENT);
  EXPECT_EQ(skin(1, [](dcloth_output* o) { o->struct_size = 0; }), DCLOTH_ERROR_ARGUMENT);
  EXPECT_EQ(dcloth_cloth_skin(cloth.get(), &good_pose, 1, nullptr, nullptr), DCLOTH_ERROR_ARGUMENT);

  ModelSpec spec;
  spec.mesh = false;
  const OpenedModel skeleton_only(BuildModel(spec));
  OwnedCloth smaller(skeleton_only);
  EXPECT_EQ(smaller.Tick(matrices, 5), DCLOTH_ERROR_ARGUMENT);
}

// A host that asks for all stages need not know how many a model holds.
TEST_F(ClothTest, StagesAboveTheModelsAreTheModels) {
  for (const uint32_t held : {uint32_t{DCLOTH_STAGES_STATIC}, uint32_t{DCLOTH_STAGES_SKELETON}}) {
    ModelSpec spec;
    spec.mesh = false;
    spec.skeleton = held != DCLOTH_STAGES_STATIC;
    const OpenedModel opened(BuildModel(spec));
    ASSERT_EQ(opened.info().stages, held);
    OwnedCloth above(opened), exact(opened);
    for (int frame = 0; frame < 20; ++frame) {
      ASSERT_EQ(above.Update(Pose(frame / 47.0), 1 / 47.0f, kAll), DCLOTH_OK);
      ASSERT_EQ(exact.Update(Pose(frame / 47.0), 1 / 47.0f, held), DCLOTH_OK);
      ASSERT_EQ(above.positions(), exact.positions());
    }
    ASSERT_EQ(above.Tick(Pose(1), kAll), DCLOTH_OK);
    ASSERT_EQ(exact.Tick(Pose(1), held), DCLOTH_OK);
    ASSERT_EQ(above.Skin(Pose(1), 1), DCLOTH_OK);
    ASSERT_EQ(exact.Skin(Pose(1), 1), DCLOTH_OK);
    ASSERT_EQ(above.positions(), exact.positions());
  }
}

// Why an update was refused: the field, what was found and what is allowed, in the text and as parts of it.
TEST_F(ClothTest, ARefusedFrameSaysWhy) {
  OwnedCloth cloth(opened_);
  std::vector<float> matrices = Pose(0), out(3 * model_.numbers.n);
  struct Call {
    dcloth_pose pose;
    dcloth_frame frame;
    dcloth_output output;
  };
  const auto refused = [&](auto change, dcloth_status status, const std::string& what, const std::string& found,
                           const std::string& allowed) {
    dcloth_error error = EmptyError();
    Call call = {OwnedCloth::Pose(matrices),
                 {sizeof(dcloth_frame), kAll, 0.01f, 0, &error},
                 FloatOutput(model_.numbers.n, out.data(), 12, nullptr)};
    ASSERT_EQ(dcloth_cloth_update(cloth.get(), &call.pose, &call.frame, &call.output, nullptr), DCLOTH_OK) << what;
    EXPECT_EQ(error.status, DCLOTH_OK);
    change(&call);
    EXPECT_EQ(dcloth_cloth_update(cloth.get(), &call.pose, &call.frame, &call.output, nullptr), status) << what;
    EXPECT_EQ(error.status, status) << what;
    const auto part = [&](uint16_t at, uint16_t size) { return std::string(error.text + at, size); };
    EXPECT_EQ(part(error.what_at, error.what_size), what);
    EXPECT_EQ(part(error.found_at, error.found_size), found);
    EXPECT_EQ(part(error.allowed_at, error.allowed_size).substr(0, allowed.size()), allowed);
    EXPECT_EQ(std::string(error.text).find(what + ": found " + found + "; allowed: " + allowed), 0u) << error.text;
    // The same verdict where nobody listens.
    call.frame.error = nullptr;
    EXPECT_EQ(dcloth_cloth_update(cloth.get(), &call.pose, &call.frame, &call.output, nullptr), status) << what;
  };
  constexpr dcloth_status kArgument = DCLOTH_ERROR_ARGUMENT;
  refused([](Call* c) { c->frame.seconds = -1; }, kArgument, "frame.seconds", "-1.00000",
          "finite numbers of 0 or more");
  refused([](Call* c) { c->frame.flags = 1u << 31; }, kArgument, "frame.flags", "an unknown flag",
          "DCLOTH_FRAME_* or 0");
  refused([](Call* c) { c->frame.stages = 5; }, kArgument, "frame.stages", "an unknown number", "DCLOTH_STAGES_*");
  refused([](Call* c) { c->pose.column_major = 2; }, kArgument, "pose.column_major", "a number above 1", "0 or 1");
  refused([](Call* c) { c->pose.joint_matrices = nullptr; }, kArgument, "pose.joint_matrices",
          "a null or misaligned pointer", "a pointer to floats, aligned to 4 bytes");
  refused([](Call* c) { c->output.vertex_count = 7; }, kArgument, "output.vertex_count", "7", "60, the model's");
  refused([](Call* c) { c->output.positions = nullptr; }, kArgument, "output.positions", "a null pointer", "memory");
  refused([](Call* c) { c->output.flags = 64; }, kArgument, "output.flags", "an unknown flag", "DCLOTH_OUTPUT_* or 0");
  refused([](Call* c) { c->pose.joint_count = 3; }, DCLOTH_ERROR_POSE, "pose.joint_count", "3", "9");
  std::vector<float> broken = matrices;
  broken[16 * 4 + 3] = std::numeric_limits<float>::quiet_NaN();
  refused([&](Call* c) { c->pose.joint_matrices = broken.data(); }, DCLOTH_ERROR_POSE, "pose.joint_matrices[4]",
          "NaN in the matrix of 'joint_4'", "finite numbers up to 1e9");
  broken[16 * 4 + 3] = 2e9f;
  refused([&](Call* c) { c->pose.joint_matrices = broken.data(); }, DCLOTH_ERROR_POSE, "pose.joint_matrices[4]",
          "2.00000e9 in the matrix of 'joint_4'", "finite numbers up to 1e9");
}

TEST(Abi, NamesAndNumbers) {
  EXPECT_EQ(dcloth_version_number(), uint32_t{DCLOTH_VERSION_NUMBER});
  EXPECT_STREQ(dcloth_status_name(DCLOTH_OK), "OK");
  EXPECT_STREQ(dcloth_status_name(DCLOTH_ERROR_ARGUMENT), "ARGUMENT");
  EXPECT_STREQ(dcloth_status_name(DCLOTH_ERROR_MODEL), "MODEL");
  EXPECT_STREQ(dcloth_status_name(DCLOTH_ERROR_MODEL + 1), "UNKNOWN");
  EXPECT_STREQ(dcloth_status_name(-1), "UNKNOWN");
}

// Structs of a later header hold fields that this library does not know, whatever they say; those of this one may be
// longer than a host's.
TEST_F(ClothTest, StructsMayBeLongerOrShorterThanTodays) {
  OwnedCloth cloth(opened_);
  const std::vector<float> matrices = Pose(0);
  struct Longer {
    dcloth_cloth_info info;
    uint32_t later[4];
  } longer = {};
  longer.info.struct_size = sizeof(longer);
  for (uint32_t& word : longer.later) word = 0xA5A5A5A5;
  ASSERT_EQ(dcloth_cloth_describe(cloth.get(), &longer.info), DCLOTH_OK);
  EXPECT_EQ(longer.info.struct_size, sizeof(longer));
  EXPECT_EQ(longer.info.tick_waits, 1u);
  for (const uint32_t word : longer.later) EXPECT_EQ(word, 0xA5A5A5A5) << "a field that the library does not know";

  // 0.1.0's frame ended before `error`: what lies behind it is no pointer.
  const dcloth_pose pose = OwnedCloth::Pose(matrices);
  dcloth_frame frame = {offsetof(dcloth_frame, flags) + sizeof(uint32_t), kAll, -1, 0,
                        reinterpret_cast<dcloth_error*>(64)};
  EXPECT_EQ(dcloth_cloth_update(cloth.get(), &pose, &frame, nullptr, nullptr), DCLOTH_ERROR_ARGUMENT);
  frame.seconds = 0.01f;
  EXPECT_EQ(dcloth_cloth_update(cloth.get(), &pose, &frame, nullptr, nullptr), DCLOTH_OK);
  frame.struct_size -= 1;
  EXPECT_EQ(dcloth_cloth_update(cloth.get(), &pose, &frame, nullptr, nullptr), DCLOTH_ERROR_ARGUMENT);
}

// To the bit: whatever a stage did before it rested leaves no trace once it runs again.
TEST_F(ClothTest, ARestedStageForgets) {
  for (const uint32_t rest : {uint32_t{DCLOTH_STAGES_STATIC}, uint32_t{DCLOTH_STAGES_SKELETON}}) {
    OwnedCloth rested(opened_), never_ran(opened_), ran_on(opened_);
    Advance(&rested, 0, 3, kAll);
    Advance(&never_ran, 0, 3, rest);
    Advance(&ran_on, 0, 4, kAll);
    Advance(&rested, 3, 4, rest);
    Advance(&never_ran, 3, 4, rest);
    for (OwnedCloth* cloth : {&rested, &never_ran, &ran_on}) Advance(cloth, 4, 6, kAll);
    ExpectSameFrame(&rested, &never_ran, 5, 0.5f);
    ASSERT_EQ(ran_on.Skin(Pose(5), 0.5f), DCLOTH_OK);
    EXPECT_NE(ran_on.positions(), rested.positions()) << "the state does not matter at all";
  }
}

// Ten kilometres out floats are a millimetre apart: each coordinate of the result is within half a step of the host's
// matrices and half a step of its own, and normals, taken before the move, only see the former.
TEST_F(ClothTest, KeepsItsShapeFarFromTheOrigin) {
  OwnedCloth near(opened_), far(opened_);
  constexpr double kFar = 8192;  // a power of two, so that a float step there is 2^-10 m
  constexpr double kStep = 0x1p-10;
  for (int tick = 0; tick < 3; ++tick) {
    std::vector<float> pose = Pose(tick);
    // Positions on the coarse grid, so that the far pose is the near one moved exactly.
    for (size_t i = 3; i < pose.size(); i += 4) {
      if (i % 16 != 15) pose[i] = static_cast<float>(std::round(static_cast<double>(pose[i]) / kStep) * kStep);
    }
    std::vector<float> moved = pose;
    for (size_t j = 0; j < moved.size(); j += 16)
      moved[j + 3] += static_cast<float>(kFar), moved[j + 11] += static_cast<float>(kFar);
    ASSERT_EQ(near.Tick(pose, kAll), DCLOTH_OK);
    ASSERT_EQ(far.Tick(moved, kAll), DCLOTH_OK);
    ASSERT_EQ(near.Skin(pose, 1), DCLOTH_OK);
    ASSERT_EQ(far.Skin(moved, 1), DCLOTH_OK);
    for (size_t i = 0; i < near.positions().size(); ++i) {
      const double offset = i % 3 == 1 ? 0 : kFar;
      const double expected = static_cast<double>(near.positions()[i]) + offset;
      // The near world position carries its own rounding, at most 2^-24 * 8 m.
      EXPECT_NEAR(static_cast<double>(far.positions()[i]), expected, (i % 3 == 1 ? 0 : kStep / 2) + 0x1p-20) << i;
    }
    EXPECT_EQ(near.normals(), far.normals()) << "relative poses are equal to the bit, so normals are";
  }
}

struct FakeClock {
  uint64_t ticks = 0;
};

TEST_F(ClothTest, TimersCountEveryStepAndNothingTwice) {
  OwnedCloth cloth(opened_);
  FakeClock clock;
  dcloth_timer timer = {};
  timer.struct_size = sizeof(timer);
  timer.context = &clock;
  timer.now = [](void* context) { return ++static_cast<FakeClock*>(context)->ticks; };
  const std::vector<float> matrices = Pose(0);
  const dcloth_pose pose = OwnedCloth::Pose(matrices);
  std::vector<float> out(6 * model_.numbers.n);
  dcloth_output output = FloatOutput(model_.numbers.n, out.data(), 24, out.data() + 3);
  output.flags = DCLOTH_OUTPUT_OUTSIDE_BODY;
  ASSERT_EQ(dcloth_cloth_tick(cloth.get(), &pose, kAll, &timer), DCLOTH_OK);
  ASSERT_EQ(dcloth_cloth_skin(cloth.get(), &pose, 1, &output, &timer), DCLOTH_OK);
  uint64_t total = 0;
  for (int step = 0; step < DCLOTH_STEP_COUNT; ++step) {
    EXPECT_GT(timer.elapsed[step], 0u) << step;
    total += timer.elapsed[step];
  }
  EXPECT_EQ(total, clock.ticks - 2) << "all time between the first and the last reading of each call";
  timer.now = nullptr;
  EXPECT_EQ(dcloth_cloth_tick(cloth.get(), &pose, kAll, &timer), DCLOTH_OK);
}

}  // namespace
}  // namespace dcloth::testing

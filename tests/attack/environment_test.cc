// The host's floating-point environment: rounding, flushed subnormals, exceptions that trap. Whatever it is,
// every call gives the same bits and leaves it as it was, sticky flags included. The bound on the difference
// is zero.
#include <gtest/gtest.h>

#if defined(__SSE__)
#include <xmmintrin.h>
#else
#include <cfenv>
#endif

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "engine/src/cloth.h"
#include "engine/src/update.h"
#include "tests/attack/corruption.h"
#include "tests/unit/engine/state_fixture.h"

namespace dcloth::testing {
namespace {

struct HostEnvironment {
  const char* name;
  uint32_t word;
};

#if defined(__SSE__)
// MXCSR: bits 0 to 5 sticky flags, 6 subnormal inputs are zero, 7 to 12 masks, 13 and 14 rounding, 15
// subnormal results are zero. Unmasked exceptions kill the process at the first operation that raises one.
constexpr HostEnvironment kEnvironments[] = {
    {"default", 0x1F80},
    {"downwards", 0x3F80},
    {"upwards", 0x5F80},
    {"towards_zero", 0x7F80},
    {"flush_results", 0x9F80},
    {"flush_inputs", 0x1FC0},
    {"flush_both", 0x9FC0},
    {"trap_invalid", 0x1F00},
    {"trap_divide_by_zero", 0x1D80},
    {"trap_overflow", 0x1B80},
    {"trap_subnormal", 0x1E80},
    {"trap_underflow", 0x1780},
    {"trap_inexact", 0x0F80},
    {"trap_all", 0x0000},
    {"trap_all_upwards_flush", 0xC040},
    {"flags_set", 0x1FBF},
    {"flags_set_downwards", 0x3FBF},
};
uint32_t Read() { return _mm_getcsr(); }
void Write(uint32_t word) { _mm_setcsr(word); }
#else
constexpr HostEnvironment kEnvironments[] = {
    {"default", FE_TONEAREST}, {"downwards", FE_DOWNWARD}, {"upwards", FE_UPWARD}, {"towards_zero", FE_TOWARDZERO}};
uint32_t Read() { return static_cast<uint32_t>(fegetround()); }
void Write(uint32_t word) { fesetround(static_cast<int>(word)); }
#endif

// Makes one call in the host's environment and returns what the call leaves of it. Nothing here computes with
// floats but the call.
template <typename Call>
uint32_t LeftBy(const HostEnvironment& host, const Call& call) {
  const uint32_t ours = Read();
  Write(host.word);
  call();
  const uint32_t left = Read();
  Write(ours);
  return left;
}

template <typename Call>
auto In(const HostEnvironment& host, const Call& call) {
  dcloth_status result = DCLOTH_OK;
  EXPECT_EQ(LeftBy(host, [&] { result = call(); }), host.word) << host.name << " was not restored";
  return result;
}

struct Rollout {
  std::vector<float> positions, normals;
};

bool operator==(const Rollout& a, const Rollout& b) { return a.positions == b.positions && a.normals == b.normals; }

class EnvironmentTest : public ::testing::TestWithParam<format::DType> {
 protected:
  static TestModel Build() {
    ModelSpec spec;
    spec.precision = GetParam();
    return BuildModel(spec);
  }

  std::vector<float> Pose(int tick) const {
    std::vector<float> pose = PoseAt(model_.numbers, tick / 30.0);
    if (tick % 4 == 3) pose[1] = 1e-42f, pose[6] = -1e-40f;  // subnormals for those who flush them
    if (tick == 9) pose.assign(pose.size(), 1e9f);           // and overflow for those who trap it
    return pose;
  }

  Rollout Play(const HostEnvironment& host) const {
    OwnedCloth cloth(opened_);
    const std::vector<float> bad(Pose(0).size(), std::numeric_limits<float>::signaling_NaN());
    for (int tick = 0; tick < 20; ++tick) {
      const std::vector<float> pose = Pose(tick);
      if (tick == 10) {  // a rig of its own from here on
        const dcloth_pose rig = OwnedCloth::Pose(pose), none = OwnedCloth::Pose(bad);
        EXPECT_EQ(In(host, [&] { return dcloth_cloth_set_bind_pose(cloth.get(), &rig, nullptr); }), DCLOTH_OK);
        EXPECT_EQ(In(host, [&] { return dcloth_cloth_set_bind_pose(cloth.get(), &none, nullptr); }), DCLOTH_ERROR_POSE);
      }
      EXPECT_EQ(In(host, [&] { return cloth.Tick(pose, DCLOTH_STAGES_MESH); }), DCLOTH_OK);
      EXPECT_EQ(In(host, [&] { return cloth.Tick(bad, DCLOTH_STAGES_MESH); }), DCLOTH_ERROR_POSE);
      EXPECT_EQ(In(host, [&] { return cloth.Skin(pose, 0.375f); }), DCLOTH_OK);
    }
    return {cloth.positions(), cloth.normals()};
  }

  TestModel model_ = Build();
  OpenedModel opened_{model_};
};

TEST_P(EnvironmentTest, NeitherChangesResultsNorIsChanged) {
  for (const std::string& isa : UsableIsas()) {
    ASSERT_EQ(dcloth_isa_select(isa.c_str()), DCLOTH_OK);
    const Rollout expected = Play(kEnvironments[0]);
    for (const float x : expected.positions) ASSERT_TRUE(std::isfinite(x));
    for (const HostEnvironment& host : kEnvironments) EXPECT_TRUE(Play(host) == expected) << isa << ", " << host.name;
  }
  dcloth_isa_select(nullptr);
}

// The same rollout past the guard of the C ABI differs: the environments above are real.
TEST_P(EnvironmentTest, WouldChangeResultsUnguarded) {
  size_t different = 0;
  for (const HostEnvironment& host : {kEnvironments[1], kEnvironments[2]}) {
    OwnedCloth guarded(opened_), bare(opened_);
    for (int tick = 0; tick < 5; ++tick) {
      const std::vector<float> matrices = Pose(tick);
      const dcloth_pose pose = OwnedCloth::Pose(matrices);
      In(host, [&] { return guarded.Tick(matrices, DCLOTH_STAGES_MESH); });
      LeftBy(host, [&] {
        engine::TickCloth(reinterpret_cast<engine::Cloth*>(bare.get()), pose, DCLOTH_STAGES_MESH, nullptr);
      });
    }
    ASSERT_EQ(guarded.Skin(Pose(5), 1), DCLOTH_OK);
    ASSERT_EQ(bare.Skin(Pose(5), 1), DCLOTH_OK);
    different += guarded.positions() != bare.positions();
  }
  EXPECT_EQ(different, 2u);
}

INSTANTIATE_TEST_SUITE_P(EveryPrecision, EnvironmentTest,
                         ::testing::Values(format::DType_F32, format::DType_F16, format::DType_I8),
                         [](const auto& test) { return format::EnumNameDType(test.param); });

// Subnormals, which can take a hundred times as long, count for nothing in ticks and frames but in the reproducible
// mode; told from within by a timer's clock.
TEST_P(EnvironmentTest, TicksAndFramesFlushSubnormals) {
  struct Clock {
    size_t calls = 0, flushed = 0;
  };
  Clock clock;
  dcloth_timer timer = {};
  timer.struct_size = sizeof(timer);
  timer.context = &clock;
  timer.now = [](void* context) {
    volatile float tiny = 1e-40f, large = 1e30f;
    auto* told = static_cast<Clock*>(context);
    ++told->calls;
    told->flushed += tiny * large == 0;
    return uint64_t{0};
  };
  for (const std::string& isa : UsableIsas()) {
    ASSERT_EQ(dcloth_isa_select(isa.c_str()), DCLOTH_OK);
    OwnedCloth cloth(opened_);
    std::vector<float> positions(3 * model_.numbers.n);
    const std::vector<float> matrices = Pose(0);
    const dcloth_pose pose = OwnedCloth::Pose(matrices);
    const dcloth_frame frame = {sizeof(dcloth_frame), DCLOTH_STAGES_MESH, 1 / 60.0f, 0, nullptr};
    const dcloth_output output = FloatOutput(model_.numbers.n, positions.data(), 12, nullptr);
    for (const HostEnvironment& host : kEnvironments) {
      clock = {};
      In(host, [&] { return dcloth_cloth_tick(cloth.get(), &pose, DCLOTH_STAGES_MESH, &timer); });
      In(host, [&] { return dcloth_cloth_skin(cloth.get(), &pose, 1, &output, &timer); });
      In(host, [&] { return dcloth_cloth_update(cloth.get(), &pose, &frame, &output, &timer); });
      EXPECT_GT(clock.calls, 10u);
      EXPECT_EQ(clock.flushed, isa == "reproducible" ? 0 : clock.calls) << isa << ", " << host.name;
    }
  }
  dcloth_isa_select(nullptr);
}

// The verdict on a file is the same too, and NaN in it does not trap.
TEST(Environment, NeitherChangesVerdicts) {
  const auto poke = [](float value) {
    return Corrupted(
        {"", kSemantics, "", "", [value](format::ModelT* m) { *Data<float>(m, *m->features->mean) = value; }});
  };
  std::vector<AlignedBytes> files = {poke(0.5f), poke(kNaN), poke(kInfinity), poke(1e-40f)};
  files.push_back(poke(std::numeric_limits<float>::signaling_NaN()));
  for (const float rate : {1e-40f, kNaN, 0.001f})
    files.push_back(Corrupted({"", kSemantics, "", "", [rate](format::ModelT* m) { m->tick_rate = rate; }}));
  files.push_back(Corrupted({"", kSemantics, "", "", [](format::ModelT* m) {
                               *Data<float>(m, *m->skeleton_stage->input->row_scales) = 1e-40f;
                             }}));
  size_t opened = 0, refused = 0;
  for (const AlignedBytes& file : files) {
    AlignedBytes storage(dcloth_model_storage_size());
    std::string expected_text;
    float expected_seconds = 0;
    for (const HostEnvironment& host : kEnvironments) {
      dcloth_model* model = nullptr;
      dcloth_error error = EmptyError();
      dcloth_model_info info = {};
      info.struct_size = sizeof(info);
      const dcloth_status status = In(host, [&] {
        return dcloth_model_open(file.data(), file.size(), storage.data(), storage.size(), &model, &error);
      });
      if (status == DCLOTH_OK) In(host, [&] { return dcloth_model_describe(model, &info); });
      if (&host == &kEnvironments[0]) {
        expected_text = error.text;
        expected_seconds = info.tick_seconds;
        (status == DCLOTH_OK ? opened : refused) += 1;
      }
      EXPECT_EQ(std::string(error.text), expected_text) << host.name;
      EXPECT_EQ(info.tick_seconds, expected_seconds) << host.name;
    }
  }
  EXPECT_EQ(opened, 3u);
  EXPECT_EQ(refused, 6u);
}

// Arguments that are no numbers are refused where the host traps on them.
TEST(Environment, BadArgumentsDoNotTrap) {
  const TestModel model = BuildModel({});
  const OpenedModel opened(model);
  OwnedCloth cloth(opened);
  const std::vector<float> pose = PoseAt(model.numbers, 0);
  for (const HostEnvironment& host : kEnvironments) {
    for (const float blend : {kNaN, kInfinity, -kInfinity, std::numeric_limits<float>::signaling_NaN(), -1e-45f}) {
      EXPECT_EQ(In(host, [&] { return cloth.Skin(pose, blend); }), DCLOTH_ERROR_ARGUMENT) << host.name << blend;
    }
    EXPECT_EQ(In(host, [&] { return cloth.Skin(pose, 1e-45f); }), DCLOTH_OK) << host.name;
  }
}

// States are saved and judged alike, and NaN in one does not trap.
TEST(Environment, StatesAreJudgedAlike) {
  const TestModel model = BuildModel({});
  const OpenedModel opened(model);
  OwnedCloth cloth(opened);
  for (int frame = 0; frame < 9; ++frame)
    ASSERT_EQ(cloth.Update(PoseAt(model.numbers, frame / 60.0), 1 / 60.0f, DCLOTH_STAGES_MESH), DCLOTH_OK);
  const StateBytes sound = Save(&cloth);
  StateBytes poisoned = sound;
  for (size_t i = sizeof(engine::StateHead); i < poisoned.size(); ++i)
    poisoned[i] = 0xFF;  // NaN in every number after the head
  Seal(&poisoned);
  for (const HostEnvironment& host : kEnvironments) {
    StateBytes saved(sound.size());
    EXPECT_EQ(In(host, [&] { return dcloth_cloth_save(cloth.get(), saved.data(), saved.size(), nullptr); }), DCLOTH_OK);
    EXPECT_EQ(saved, sound) << host.name;
    EXPECT_EQ(In(host, [&] { return Restore(&cloth, poisoned); }), DCLOTH_ERROR_SEMANTICS) << host.name;
    EXPECT_EQ(In(host, [&] { return Restore(&cloth, sound); }), DCLOTH_OK) << host.name;
  }
}

}  // namespace
}  // namespace dcloth::testing

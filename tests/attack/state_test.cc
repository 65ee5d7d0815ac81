// Saved states as a hostile save game holds them: cut off, flipped, of another model, or made on purpose with a right
// checksum. Refused with a reason and without a trace, or harmless.
#include <cmath>
#include <functional>
#include <iostream>
#include <limits>
#include <random>

#include "tests/attack/variants.h"
#include "tests/unit/engine/state_fixture.h"
#include "tests/unit/kernels/guarded_buffer.h"

namespace dcloth::testing {
namespace {

using engine::StateHead;
using kernels::GuardedBuffer;
using kernels::Place;
using Doubles = std::numeric_limits<double>;

constexpr float kInfinite = std::numeric_limits<float>::infinity();
constexpr float kNotANumber = std::numeric_limits<float>::quiet_NaN();

// A refusal says why, names a place inside of the bytes or none, and leaves the cloth as it was.
void ExpectRefused(OwnedCloth* cloth, const StateBytes& before, const uint8_t* bytes, size_t size, uint32_t flags = 0,
                   dcloth_status status = DCLOTH_OK, const std::string& text = "") {
  dcloth_error error = EmptyError();
  const dcloth_status result = dcloth_cloth_restore(cloth->get(), bytes, size, flags, &error);
  ASSERT_NE(result, DCLOTH_OK) << text;
  if (status != DCLOTH_OK) {
    ASSERT_EQ(result, status) << error.text;
  }
  ASSERT_EQ(error.status, result);
  const std::string said = error.text;
  ASSERT_NE(said.find("found "), std::string::npos) << said;
  ASSERT_NE(said.find("; allowed: "), std::string::npos) << said;
  ASSERT_LT(said.size(), sizeof(error.text) - 1) << said;
  ASSERT_EQ(said.find(text), 0u) << said << ", expected " << text;
  ASSERT_TRUE(error.offset_bytes == UINT64_MAX || error.offset_bytes < std::max<size_t>(size, 1)) << said;
  ASSERT_EQ(dcloth_cloth_restore(cloth->get(), bytes, size, flags, nullptr), result) << "another verdict without text";
  ASSERT_EQ(Save(cloth), before) << said;
}

class StateAttackTest : public ::testing::TestWithParam<Variant> {
 protected:
  std::vector<float> Pose(double seconds) const { return PoseAt(model_.numbers, seconds); }
  uint32_t held() const { return opened_.info().stages; }

  // Three ticks and a bit, so that every slot is filled.
  void Run(OwnedCloth* cloth, int frames = 20, double start = 0) {
    for (int frame = 0; frame < frames; ++frame) {
      ASSERT_EQ(cloth->Update(Pose(start + frame / 100.0), 0.01f, held(), DCLOTH_FRAME_PIPELINED), DCLOTH_OK);
    }
  }
  // One between ticks and, where a tick is more than one item, one in it.
  std::vector<StateBytes> States() {
    std::vector<StateBytes> states(2);
    OwnedCloth cloth(opened_);
    Run(&cloth);
    for (int frame = 0; frame < 10; ++frame) {
      const StateBytes bytes = Save(&cloth);
      states[InWork(bytes) ? 1 : 0] = bytes;
      Run(&cloth, 1, 0.2 + frame / 100.0);
    }
    EXPECT_FALSE(states[0].empty());
    EXPECT_EQ(states[1].empty(), held() == DCLOTH_STAGES_STATIC);
    if (states[1].empty()) states.pop_back();
    return states;
  }

  TestModel model_ = BuildModel(GetParam().spec);
  OpenedModel opened_{model_};
};

// In a heap block of the prefix's size, so that a sanitizer sees the first byte read past it. Longer is refused too.
TEST_P(StateAttackTest, EveryPrefixIsRefused) {
  size_t refused = 0;
  OwnedCloth cloth(opened_);
  Run(&cloth, 33);
  const StateBytes before = Save(&cloth);
  for (const StateBytes& state : States()) {
    for (size_t size = 0; size < state.size(); ++size, ++refused) {
      const AlignedBytes prefix(state.data(), size);
      ASSERT_NO_FATAL_FAILURE(ExpectRefused(&cloth, before, prefix.data(), size, 0, DCLOTH_ERROR_FORMAT)) << size;
    }
    StateBytes longer = state;
    longer.push_back(0);
    ASSERT_NO_FATAL_FAILURE(ExpectRefused(&cloth, before, longer.data(), longer.size(), 0, DCLOTH_ERROR_FORMAT));
  }
  std::cout << refused << " prefixes refused\n";
}

TEST_P(StateAttackTest, EveryFlippedBitIsRefused) {
  size_t refused = 0;
  OwnedCloth cloth(opened_);
  Run(&cloth, 33);
  const StateBytes before = Save(&cloth);
  for (StateBytes state : States()) {
    for (size_t bit = 0; bit < 8 * state.size(); ++bit, ++refused) {
      state[bit / 8] ^= static_cast<uint8_t>(1u << bit % 8);
      ASSERT_NE(Restore(&cloth, state), DCLOTH_OK) << bit;
      ASSERT_NE(Restore(&cloth, state, DCLOTH_RESTORE_OTHER_MODEL), DCLOTH_OK) << bit;
      if (bit % 64 == 0) {
        ASSERT_NO_FATAL_FAILURE(ExpectRefused(&cloth, before, state.data(), state.size())) << bit;
      }
      state[bit / 8] ^= static_cast<uint8_t>(1u << bit % 8);
    }
    ASSERT_EQ(Save(&cloth), before);
    ASSERT_EQ(Restore(&cloth, state), DCLOTH_OK) << "the state itself is sound";
    ASSERT_EQ(Restore(&cloth, before), DCLOTH_OK);
  }
  std::cout << refused << " flipped bits refused\n";
}

struct Forgery {
  const char* name;
  dcloth_status status;
  const char* text;  // the refusal's beginning
  std::function<void(StateHead*)> head;
};

std::vector<Forgery> Forgeries() {
  using H = StateHead;
  constexpr dcloth_status kFormat = DCLOTH_ERROR_FORMAT, kModel = DCLOTH_ERROR_MODEL;
  constexpr dcloth_status kSemantics = DCLOTH_ERROR_SEMANTICS;
  return {
      {"magic", kFormat, "found different bytes", [](H* h) { h->magic[3] = 'O'; }},
      {"version 0", DCLOTH_ERROR_VERSION, "version: found 0;", [](H* h) { h->version = 0; }},
      {"version 2", DCLOTH_ERROR_VERSION, "version: found 2;", [](H* h) { h->version = 2; }},
      {"version 6", DCLOTH_ERROR_VERSION, "version: found 6;", [](H* h) { h->version = 6; }},
      {"size", kFormat, "found ", [](H* h) { h->size += 4; }},
      {"huge size", kFormat, "found ", [](H* h) { h->size = UINT64_MAX; }},
      {"identity", kModel, "identity: found ", [](H* h) { h->identity += 1; }},
      {"joints", kModel, "joint_count: found ", [](H* h) { h->joint_count += 1; }},
      {"no joints", kModel, "joint_count: found 0", [](H* h) { h->joint_count = 0; }},
      {"features", kModel, "feature_count: found ", [](H* h) { h->feature_count = UINT32_MAX; }},
      {"bones", kModel, "bone_count: found ", [](H* h) { h->bone_count ^= 1; }},
      {"vertices", kModel, "vertex_count: found ", [](H* h) { h->vertex_count = 65535; }},
      {"units", kModel, "skeleton_units: found ", [](H* h) { h->skeleton_units += 1; }},
      {"layers", kModel, "layer_count: found ", [](H* h) { h->layer_count = 9; }},
      {"width", kModel, "feature_width: found ", [](H* h) { h->feature_width = 24; }},
      {"patches", kModel, "patch_shape: found ", [](H* h) { h->patch_shape ^= 1; }},
      {"rate", kModel, "tick_rate: found 6.00000e1 Hz", [](H* h) { h->tick_rate = 60; }},
      {"rate NaN", kModel, "tick_rate: found NaN Hz", [](H* h) { h->tick_rate = kNotANumber; }},
      {"four ticks", kSemantics, "tick_count: found 4", [](H* h) { h->tick_count = 4; }},
      {"no tick", kSemantics, "", [](H* h) { h->tick_count = 0, h->stages = 0; }},
      {"stages 0", kSemantics, "stages: found 0", [](H* h) { h->stages = 0; }},
      {"stages 5", kSemantics, "stages: found 5", [](H* h) { h->stages = 5; }},
      {"stages 15", kSemantics, "stages: found 15", [](H* h) { h->stages = 15; }},
      {"part 99", kSemantics, "part: found 99", [](H* h) { h->part = 99; }},
      {"part wild", kSemantics, "part: found 4294967295", [](H* h) { h->part = UINT32_MAX; }},
      {"items", kSemantics, "items_done: found 4000000000", [](H* h) { h->items_done = 4000000000u; }},
      {"jumped", kSemantics, "jumped: found 2", [](H* h) { h->jumped = 2; }},
      {"contact", kSemantics, "contact: found 26", [](H* h) { h->contact = 26; }},
      {"contact NaN", kSemantics, "contact_seconds: found NaN", [](H* h) { h->contact_seconds = kNotANumber; }},
      {"idle", kSemantics, "idle_ticks: found 16", [](H* h) { h->idle_ticks = 16; }},
      {"no idle start", kSemantics, "idle_floats: found 0", [](H* h) { h->idle_ticks = 3, h->idle_floats = 0; }},
      {"idle start", kModel, "idle_floats: found 1073741824",
       [](H* h) { h->idle_ticks = 3, h->idle_floats = 1u << 30; }},
      {"a start of none", kModel, "idle_floats: found 7", [](H* h) { h->idle_ticks = 0, h->idle_floats = 7; }},
      {"share NaN", kSemantics, "tick_share: found NaN", [](H* h) { h->tick_share = kNotANumber; }},
      {"share below 0", kSemantics, "tick_share: found -", [](H* h) { h->tick_share = -1; }},
      {"since NaN", kSemantics, "since: found NaN", [](H* h) { h->since = Doubles::quiet_NaN(); }},
      {"since late", kSemantics, "since: found 1.00100", [](H* h) { h->since = 1.001; }},
      {"since early", kSemantics, "since: found -", [](H* h) { h->since = -0.002; }},
      {"since endless", kSemantics, "since: found -infinity", [](H* h) { h->since = -Doubles::infinity(); }},
      {"waited NaN", kSemantics, "waited: found NaN", [](H* h) { h->waited = Doubles::quiet_NaN(); }},
      {"waited early", kSemantics, "waited: found -", [](H* h) { h->waited = -1.001; }},
      {"waited endless", kSemantics, "waited: found infinity", [](H* h) { h->waited = Doubles::infinity(); }},
      {"lag NaN", kSemantics, "lag: found NaN", [](H* h) { h->lag = Doubles::quiet_NaN(); }},
      {"lag below 0", kSemantics, "lag: found -", [](H* h) { h->lag = -1e-9; }},
      {"lag 3", kSemantics, "lag: found 3.0", [](H* h) { h->lag = 3; }},
      {"step NaN", kSemantics, "older_step: found NaN", [](H* h) { h->older_step = Doubles::quiet_NaN(); }},
      {"step below 0", kSemantics, "older_step: found -", [](H* h) { h->older_step = -1; }},
      {"step endless", kSemantics, "older_step: found infinity", [](H* h) { h->older_step = Doubles::infinity(); }},
      {"no other pose", kFormat, "found ", [](H* h) { h->older_step = 0; }},
      {"no heading", kSemantics, "heading: found 0.0", [](H* h) { h->heading[0] = h->heading[1] = 0; }},
      {"heading NaN", kSemantics, "heading: found NaN", [](H* h) { h->heading[1] = Doubles::quiet_NaN(); }},
      {"heading long", kSemantics, "heading: found ", [](H* h) { h->heading[0] = 1e200; }},
      {"place NaN", kSemantics, "position: found NaN", [](H* h) { h->position[2] = Doubles::quiet_NaN(); }},
      {"place far", kSemantics, "position: found 1.00000e19", [](H* h) { h->position[0] = 1e19; }},
      {"velocity", kSemantics, "velocity: found -infinity", [](H* h) { h->velocity[1] = -Doubles::infinity(); }},
      {"yaw", kSemantics, "yaw_rate: found NaN", [](H* h) { h->yaw_rate = Doubles::quiet_NaN(); }},
  };
}

// Every number of the head, with a right checksum.
TEST_P(StateAttackTest, ForgedHeadsAreRefused) {
  OwnedCloth cloth(opened_);
  Run(&cloth, 33);
  const StateBytes before = Save(&cloth);
  size_t refused = 0;
  for (const StateBytes& state : States()) {
    for (const Forgery& forgery : Forgeries()) {
      StateBytes forged = state;
      StateHead head = HeadOf(state);
      forgery.head(&head);
      std::memcpy(forged.data(), &head, sizeof(head));
      Seal(&forged);
      ASSERT_NO_FATAL_FAILURE(
          ExpectRefused(&cloth, before, forged.data(), forged.size(), 0, forgery.status, forgery.text))
          << forgery.name;
      ++refused;
    }
  }
  EXPECT_EQ(refused, States().size() * Forgeries().size());
}

bool IsFinite(const std::vector<float>& values) {
  return std::all_of(values.begin(), values.end(), [](float x) { return std::isfinite(x); });
}

// Each number behind the head replaced, with a right checksum. What is no number or out of range is refused; what is
// taken runs and stays finite.
TEST_P(StateAttackTest, EveryNumberForged) {
  size_t refused = 0, taken = 0, numbers = 0;
  for (const StateBytes& state : States()) {
    OwnedCloth cloth(opened_);
    Run(&cloth, 33);
    const StateBytes before = Save(&cloth);
    const size_t poses = sizeof(StateHead) + engine::StatePoseBytes(HeadOf(state));
    for (size_t at = sizeof(StateHead); at < state.size(); at += at < poses ? 8 : 4, ++numbers) {
      for (const float value : {kNotANumber, kInfinite, -kInfinite, 3e38f, -1e18f, 1.00001f, -0.0f}) {
        StateBytes forged = state;
        const double wide = static_cast<double>(value);
        at < poses ? std::memcpy(forged.data() + at, &wide, 8) : std::memcpy(forged.data() + at, &value, 4);
        Seal(&forged);
        const bool must = !(std::abs(value) <= 1e18f);
        const dcloth_status status = Restore(&cloth, forged);
        if (must) {
          ASSERT_EQ(status, DCLOTH_ERROR_SEMANTICS) << at << ": " << value;
        }
        if (status != DCLOTH_OK) {
          ++refused;
          ASSERT_NO_FATAL_FAILURE(ExpectRefused(&cloth, before, forged.data(), forged.size())) << at;
          continue;
        }
        ++taken;
        Run(&cloth, 5, 0.3);
        ASSERT_TRUE(IsFinite(cloth.positions()) && IsFinite(cloth.normals())) << at << ": " << value;
        Run(&cloth, 10, 0.35);
        Save(&cloth);  // which checks the recurrent state once more
        ASSERT_EQ(Restore(&cloth, before), DCLOTH_OK);
      }
    }
  }
  EXPECT_GE(refused, 4 * numbers) << "what no cloth can have was taken";
  EXPECT_GT(numbers, 12u * GetParam().spec.joints);
  std::cout << refused << " forged numbers refused, " << taken << " taken and run\n";
}

// Recurrent state beyond 1 is told by name, whichever element it is.
TEST_P(StateAttackTest, HiddenStateBeyondOneIsRefused) {
  if (held() == DCLOTH_STAGES_STATIC) GTEST_SKIP() << "no recurrent state";
  OwnedCloth cloth(opened_);
  Run(&cloth, 33);
  const StateBytes before = Save(&cloth);
  const ModelSpec& spec = model_.numbers.spec;
  const auto& inside = *reinterpret_cast<const engine::Cloth*>(cloth.get());
  for (const StateBytes& state : States()) {
    const StateHead head = HeadOf(state);
    size_t begin = sizeof(head) + engine::StatePoseBytes(head) + 4 * head.feature_count;
    const size_t layers = spec.mesh ? spec.layers : 0;
    const size_t patches = size_t{spec.patches} * spec.patch_width;
    if (patches != 0) begin += 4 * engine::PatchClothFloats(inside.model->patch_stage);
    const size_t count = head.skeleton_units + layers * head.vertex_count * head.feature_width + patches;
    for (size_t i = 0; i < count; ++i) {
      for (const float h : {1.0001f, -1.0001f, kNotANumber}) {
        StateBytes forged = state;
        std::memcpy(forged.data() + begin + 4 * i, &h, 4);
        Seal(&forged);
        const char* name = patches != 0 ? "patch_hidden[" : i < head.skeleton_units ? "skeleton_state[" : "mesh_state[";
        ASSERT_NO_FATAL_FAILURE(
            ExpectRefused(&cloth, before, forged.data(), forged.size(), 0, DCLOTH_ERROR_SEMANTICS, name));
      }
    }
  }
}

// Two to seven words of anything at once, anywhere.
TEST_P(StateAttackTest, WildWords) {
  std::mt19937 random(77);
  const std::vector<StateBytes> states = States();
  OwnedCloth cloth(opened_);
  Run(&cloth, 33);
  size_t refused = 0, taken = 0;
  for (int round = 0; round < 3000; ++round) {
    StateBytes forged = states[random() % states.size()];
    const size_t words = forged.size() / 4;
    for (size_t change = 2 + random() % 6; change-- > 0;) {
      // A small change of a number passes more checks than any bits do.
      const size_t at = 4 * (8 + random() % (words - 8));
      uint32_t word = 0;
      std::memcpy(&word, forged.data() + at, 4);
      word = random() % 2 == 0 ? static_cast<uint32_t>(random()) : word + random() % 5 - 2;
      std::memcpy(forged.data() + at, &word, 4);
    }
    Seal(&forged);
    const bool sound = Restore(&cloth, forged, random() % 2) == DCLOTH_OK;
    ++(sound ? taken : refused);
    Run(&cloth, 6, 0.3);
    ASSERT_TRUE(IsFinite(cloth.positions()) && IsFinite(cloth.normals())) << round;
    Save(&cloth);
  }
  EXPECT_GT(refused, 100u);
  EXPECT_GT(taken, 10u);
  std::cout << refused << " wild states refused, " << taken << " taken and run\n";
}

// Bytes between guard pages, read-only while they are restored.
TEST_P(StateAttackTest, BytesBetweenGuardPages) {
  OwnedCloth cloth(opened_), other(opened_);
  for (int frame = 0; frame < 30; ++frame) {
    Run(&cloth, 1, frame / 100.0);
    for (const Place place : {Place::kEnd, Place::kStart}) {
      GuardedBuffer<uint8_t> bytes(dcloth_cloth_state_size(cloth.get()), place);
      ASSERT_EQ(dcloth_cloth_save(cloth.get(), bytes.data(), bytes.size(), nullptr), DCLOTH_OK);
      ASSERT_TRUE(bytes.SlackUntouched());
      bytes.MakeReadOnly();
      ASSERT_EQ(dcloth_cloth_restore(other.get(), bytes.data(), bytes.size(), 0, nullptr), DCLOTH_OK);
      ASSERT_EQ(Save(&other), Save(&cloth));
    }
  }
}

// A file whose last bytes are the features' upper limits: the weight vector, which the builder writes from behind,
// first.
AlignedBytes EndingInLimits(TestModel* model) {
  format::ModelT& tables = *model->tables;
  const size_t bytes = sizeof(float) * model->numbers.d, from = tables.features->high->offset;
  tables.features->high->offset = tables.weights.size();
  for (size_t i = 0; i < bytes; ++i) tables.weights.push_back(tables.weights[from + i]);
  flatbuffers::FlatBufferBuilder builder;
  builder.ForceVectorAlignment(tables.weights.size(), 1, 64);
  const auto weights = builder.CreateVector(tables.weights);
  const auto model_table = format::CreateModel(builder, tables.format_major, tables.format_minor, 0, 0,
                                               tables.tick_rate, CreateGarment(builder, tables.garment.get()),
                                               CreateCharacter(builder, tables.character.get()),
                                               CreateFeatures(builder, tables.features.get()),
                                               CreateStaticStage(builder, tables.static_stage.get()), 0, 0, 0, weights);
  builder.Finish(model_table, format::ModelIdentifier());
  return AlignedBytes(builder.GetBufferPointer(), builder.GetSize());
}

// 112 features, whole lines of 64 bytes, so that no padding stands between the last limit and the guard page.
TEST(StateAttack, NoLimitIsReadPastTheFile) {
  ModelSpec spec;
  spec.joints = 24;
  spec.skeleton = spec.mesh = false;
  TestModel model = BuildModel(spec);
  ASSERT_EQ(model.numbers.d, 112u);
  const AlignedBytes file = EndingInLimits(&model);
  const GuardedBuffer<uint8_t> guarded(std::vector<uint8_t>(file.data(), file.data() + file.size()), Place::kAligned64);
  const uint8_t* const end = guarded.data() + guarded.size();
  ASSERT_EQ(reinterpret_cast<uintptr_t>(end) % kernels::PageBytes(), 0u) << "the guard page does not follow at once";
  float last = 0;
  std::memcpy(&last, end - sizeof(last), sizeof(last));
  ASSERT_EQ(static_cast<double>(last), model.numbers.high.back()) << "other bytes end the file";
  const OpenedModel opened(file);
  OwnedCloth saved(opened);
  ASSERT_EQ(saved.Tick(PoseAt(model.numbers, 0), DCLOTH_STAGES_STATIC), DCLOTH_OK);
  const StateBytes state = Save(&saved);
  AlignedBytes view(dcloth_model_storage_size());
  dcloth_model* at_the_edge = nullptr;
  ASSERT_EQ(dcloth_model_open(guarded.data(), guarded.size(), view.data(), view.size(), &at_the_edge, nullptr),
            DCLOTH_OK);
  AlignedBytes storage(dcloth_cloth_storage_size(at_the_edge));
  dcloth_cloth* cloth = nullptr;
  ASSERT_EQ(dcloth_cloth_create(at_the_edge, storage.data(), storage.size(), &cloth, nullptr), DCLOTH_OK);
  EXPECT_EQ(dcloth_cloth_restore(cloth, state.data(), state.size(), 0, nullptr), DCLOTH_OK);
}

// Every variant's states against every other variant's cloth.
TEST_P(StateAttackTest, OtherModelsAreRefused) {
  const std::vector<StateBytes> states = States();
  size_t refused = 0, taken = 0;
  for (const Variant& variant : Variants()) {
    TestModel model = BuildModel(variant.spec);
    model.tables->identity = 1 + refused;
    const OpenedModel opened(model);
    OwnedCloth cloth(opened);
    ASSERT_EQ(cloth.Tick(PoseAt(model.numbers, 0), opened.info().stages), DCLOTH_OK);
    const StateBytes before = Save(&cloth);
    for (const StateBytes& state : states) {
      ASSERT_NO_FATAL_FAILURE(ExpectRefused(&cloth, before, state.data(), state.size(), 0, DCLOTH_ERROR_MODEL))
          << variant.name;
      ++refused;
      const dcloth_status status = Restore(&cloth, state, DCLOTH_RESTORE_OTHER_MODEL);
      ASSERT_TRUE(status == DCLOTH_OK || status == DCLOTH_ERROR_MODEL) << variant.name << " " << status;
      ASSERT_TRUE(status == DCLOTH_ERROR_MODEL || !InWork(state)) << "a tick of another model";
      taken += status == DCLOTH_OK;
      if (status == DCLOTH_OK) {
        ASSERT_EQ(Restore(&cloth, before), DCLOTH_OK);
      }
      ASSERT_EQ(Save(&cloth), before);
    }
  }
  EXPECT_EQ(refused, states.size() * Variants().size());
  EXPECT_GE(taken, 1u) << "this variant's own sizes agree";
  EXPECT_LE(taken, 6u) << "three precisions, a reduced basis, a body and its parts have the same sizes";
}

INSTANTIATE_TEST_SUITE_P(Every, StateAttackTest, ::testing::ValuesIn(Variants()),
                         [](const auto& test) { return test.param.name; });

}  // namespace
}  // namespace dcloth::testing

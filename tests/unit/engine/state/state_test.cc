// Saved states: the cloth that takes one goes on to the bit as the one that was saved, wherever in time that was.
#include <iostream>
#include <memory>
#include <random>
#include <set>

#include "engine/src/network/schedule.h"
#include "kernels/matvec/matvec.h"
#include "tests/attack/variants.h"
#include "tests/unit/engine/allocation_trap.h"
#include "tests/unit/engine/state_fixture.h"
#include "tests/unit/engine/update_fixture.h"

namespace dcloth::testing {
namespace {

// Models whose products have several panels and whose mesh has several blocks, so that ticks can be cut anywhere.
std::vector<Variant> WideVariants() {
  std::vector<Variant> variants;
  for (Variant variant : Variants()) {
    variant.spec.rings = 5;
    variant.spec.segments = 8;
    variant.spec.units = 25;
    variant.spec.mesh_width = 70;
    variant.spec.mesh_basis = 39;
    if (variant.spec.rank != 0) variant.spec.rank = 36;
    if (variant.spec.patches != 0) variant.spec.patches = 8;
    variants.push_back(variant);
  }
  return variants;
}

class StateTest : public ::testing::TestWithParam<Variant> {
 protected:
  std::vector<float> Pose(double seconds) const { return PoseAt(model_.numbers, seconds); }
  uint32_t held() const { return opened_.info().stages; }

  std::unique_ptr<OwnedCloth> Restored(const StateBytes& bytes) const {
    auto cloth = std::make_unique<OwnedCloth>(opened_);
    dcloth_error error = EmptyError();
    EXPECT_EQ(Restore(cloth.get(), bytes, 0, &error), DCLOTH_OK) << error.text;
    return cloth;
  }

  TestModel model_ = BuildModel(GetParam().spec);
  OpenedModel opened_{model_};
};

struct Host {
  const char* name;
  double rate;  // frames a second; 0 wobbles
  uint32_t flags;
  bool changes;  // stages, flags and jumps at random
};

constexpr Host kHosts[] = {
    {"wobbling", 0, 0, false},
    {"wobbling, pipelined", 0, DCLOTH_FRAME_PIPELINED, false},
    {"47 Hz", 47, 0, false},
    {"47 Hz, pipelined", 47, DCLOTH_FRAME_PIPELINED, false},
    {"144 Hz, changing", 144, 0, true},
    {"wobbling, changing", 0, 0, true},
};

// Saved every seventh frame of 300, restored into new memory each time, and followed for 70 frames beside the cloth
// that was never interrupted: vertices, normals and what is saved afterwards are the same.
TEST_P(StateTest, ContinuesToTheBitAtAnyFrameRate) {
  constexpr size_t kFrames = 300, kEvery = 7, kFollowed = 70;
  size_t compared = 0, in_work = 0, between = 0;
  for (const Host& host : kHosts) {
    std::mt19937 random(3);
    OwnedCloth original(opened_);
    std::vector<std::pair<size_t, std::unique_ptr<OwnedCloth>>> restored;
    std::vector<float> frames = FrameSeconds(host.rate, 30);
    frames.resize(kFrames);
    double time = 0;
    uint32_t stages = held(), flags = host.flags;
    for (size_t frame = 0; frame < kFrames; ++frame) {
      time += static_cast<double>(frames[frame]);
      if (host.changes) {
        const uint32_t levels[] = {DCLOTH_STAGES_STATIC, DCLOTH_STAGES_SKELETON, DCLOTH_STAGES_MESH};
        if (random() % 20 == 0) stages = std::min(levels[random() % 3], held());
        flags = random() % 8 == 0 ? random() % 32 : host.flags | random() % 2;
      }
      const std::vector<float> pose = Pose(time);
      ASSERT_EQ(original.Update(pose, frames[frame], stages, flags), DCLOTH_OK);
      const StateBytes saved = Save(&original);
      for (auto& [born, cloth] : restored) {
        ASSERT_EQ(cloth->Update(pose, frames[frame], stages, flags), DCLOTH_OK);
        ASSERT_EQ(cloth->positions(), original.positions()) << host.name << ", saved " << born << ", frame " << frame;
        ASSERT_EQ(cloth->normals(), original.normals()) << host.name << ", saved " << born << ", frame " << frame;
        ASSERT_EQ(Save(cloth.get()), saved) << host.name << ", saved " << born << ", frame " << frame;
        ++compared;
      }
      if (!restored.empty() && frame >= restored.front().first + kFollowed) restored.erase(restored.begin());
      if (frame % kEvery != 0) continue;
      ++(InWork(saved) ? in_work : between);
      restored.emplace_back(frame, Restored(saved));
      ASSERT_EQ(Save(restored.back().second.get()), saved) << "what was saved comes back";
    }
  }
  EXPECT_GT(compared, std::size(kHosts) * 2500);
  // The tick of a static model is a single item.
  EXPECT_TRUE(held() != DCLOTH_STAGES_STATIC ? in_work > 20 : in_work == 0) << in_work;
  EXPECT_GT(between, 100u);
  std::cout << compared << " frames equal after " << in_work << " saves in a tick and " << between << " between\n";
}

// Cut after each single item of a tick, at each level of detail: what is restored there ends in the same tick.
TEST_P(StateTest, EveryPlaceInATick) {
  if (held() == DCLOTH_STAGES_STATIC) GTEST_SKIP() << "a single item";
  std::set<engine::TickPart> begun, inside;
  for (const uint32_t stages : {DCLOTH_STAGES_STATIC, DCLOTH_STAGES_SKELETON, DCLOTH_STAGES_MESH}) {
    if (stages > held()) continue;
    OwnedCloth original(opened_);
    for (int tick = 0; tick < 3; ++tick) ASSERT_EQ(original.Tick(Pose(tick * kTick), held()), DCLOTH_OK);
    // A frame that is short of a tick, then one that begins it, then crumbs of time.
    ASSERT_EQ(original.Update(Pose(3.9 * kTick), static_cast<float>(0.99 * kTick), stages), DCLOTH_OK);
    ASSERT_EQ(original.Update(Pose(4 * kTick), static_cast<float>(0.01 * kTick), stages, DCLOTH_FRAME_PIPELINED),
              DCLOTH_OK);
    StateBytes saved = Save(&original);
    ASSERT_TRUE(InWork(saved));
    for (int crumb = 0; InWork(saved); ++crumb) {
      ASSERT_LT(crumb, 1000);
      engine::TickPart part = engine::TickPart::kDone;
      ASSERT_TRUE(format::FindTickPart(HeadOf(saved).part, &part));
      (HeadOf(saved).items_done == 0 ? begun : inside).insert(part);
      const std::unique_ptr<OwnedCloth> restored = Restored(saved);
      OwnedCloth twin(opened_);
      ASSERT_EQ(Restore(&twin, saved), DCLOTH_OK);
      ASSERT_EQ(restored->Update(Pose(4.5 * kTick), static_cast<float>(0.5 * kTick), stages), DCLOTH_OK);
      const StateBytes ended = Save(restored.get());
      ASSERT_EQ(original.Update(Pose(4 * kTick), 1e-6f, stages, DCLOTH_FRAME_PIPELINED), DCLOTH_OK);
      ASSERT_EQ(twin.Update(Pose(4 * kTick), 1e-6f, stages, DCLOTH_FRAME_PIPELINED), DCLOTH_OK);
      ASSERT_EQ(Save(&twin), Save(&original)) << "part " << static_cast<int>(part);
      ASSERT_EQ(restored->Tick(Pose(5 * kTick), stages), DCLOTH_OK);
      ASSERT_EQ(twin.Update(Pose(4.5 * kTick), static_cast<float>(0.5 * kTick), stages), DCLOTH_OK);
      ASSERT_EQ(twin.Tick(Pose(5 * kTick), stages), DCLOTH_OK);
      ASSERT_EQ(restored->Skin(Pose(5 * kTick), 1), DCLOTH_OK);
      ASSERT_EQ(twin.Skin(Pose(5 * kTick), 1), DCLOTH_OK);
      ASSERT_EQ(restored->positions(), twin.positions()) << "part " << static_cast<int>(part);
      saved = Save(&original);
    }
  }
  const auto& model = *reinterpret_cast<const engine::Cloth*>(OwnedCloth(opened_).get())->model;
  // The static stage runs in the frame that begins a tick.
  for (auto part = engine::TickPart::kSkeletonInput; part != engine::TickPart::kDone;
       part = static_cast<engine::TickPart>(static_cast<uint32_t>(part) + 1)) {
    const uint64_t items = engine::TickItems(model, {held()}, part);
    EXPECT_TRUE(items == 0 || begun.count(part) + inside.count(part) != 0) << static_cast<int>(part);
    EXPECT_TRUE(items <= 1 || inside.count(part) != 0) << "never inside of part " << static_cast<int>(part);
  }
}

// Hosts with a clock of their own.
TEST_P(StateTest, ContinuesBetweenTicks) {
  for (const uint32_t stages : {DCLOTH_STAGES_STATIC, DCLOTH_STAGES_SKELETON, DCLOTH_STAGES_MESH}) {
    if (stages > held()) continue;
    OwnedCloth original(opened_), restored(opened_);
    for (int tick = 0; tick < 100; ++tick) {
      ASSERT_EQ(Restore(&restored, Save(&original)), DCLOTH_OK);
      for (OwnedCloth* cloth : {&original, &restored}) {
        ASSERT_EQ(cloth->Tick(Pose(tick * kTick), stages), DCLOTH_OK);
        ASSERT_EQ(cloth->Skin(Pose(tick * kTick), 0.3f), DCLOTH_OK);
      }
      ASSERT_EQ(original.positions(), restored.positions()) << tick;
    }
  }
}

// Saved on one instruction set, restored on another: the same as a cloth that changed over without being saved.
TEST_P(StateTest, GoesOverToOtherInstructionSets) {
  const std::vector<std::string> names = UsableIsas();
  size_t pairs = 0;
  for (const std::string& from : names) {
    for (const std::string& to : names) {
      OwnedCloth original(opened_), restored(opened_);
      ASSERT_EQ(dcloth_isa_select(from.c_str()), DCLOTH_OK);
      StateBytes saved;
      for (int frame = 0; frame < 40 || (held() != DCLOTH_STAGES_STATIC && !InWork(saved)); ++frame) {
        ASSERT_LT(frame, 80);
        ASSERT_EQ(original.Update(Pose(frame / 144.0), 1 / 144.0f, held(), DCLOTH_FRAME_PIPELINED), DCLOTH_OK);
        saved = Save(&original);
      }
      ASSERT_EQ(dcloth_isa_select(to.c_str()), DCLOTH_OK);
      ASSERT_EQ(Restore(&restored, saved), DCLOTH_OK);
      for (int frame = 80; frame < 140; ++frame) {
        for (OwnedCloth* cloth : {&original, &restored})
          ASSERT_EQ(cloth->Update(Pose(frame / 144.0), 1 / 144.0f, held(), DCLOTH_FRAME_PIPELINED), DCLOTH_OK);
        ASSERT_EQ(original.positions(), restored.positions()) << from << " to " << to << ", frame " << frame;
      }
      ++pairs;
    }
  }
  dcloth_isa_select(nullptr);
  EXPECT_EQ(pairs, names.size() * names.size());
}

// A cloth that never ticked, or not since its reset, is a head alone, and taking one is a reset.
TEST_P(StateTest, ResetClothsAreAHead) {
  OwnedCloth fresh(opened_), used(opened_);
  const StateBytes saved = Save(&fresh);
  EXPECT_EQ(saved.size(), sizeof(engine::StateHead));
  for (int frame = 0; frame < 9; ++frame)
    ASSERT_EQ(used.Update(Pose(frame / 60.0), 1 / 60.0f, held(), DCLOTH_FRAME_PIPELINED), DCLOTH_OK);
  OwnedCloth reset(opened_);
  ASSERT_EQ(Restore(&reset, Save(&used)), DCLOTH_OK);
  ASSERT_EQ(dcloth_cloth_reset(reset.get()), DCLOTH_OK);
  EXPECT_EQ(Save(&reset), saved);
  ASSERT_EQ(Restore(&used, saved), DCLOTH_OK);
  EXPECT_EQ(Save(&used), saved);
  for (int frame = 0; frame < 20; ++frame) {
    for (OwnedCloth* cloth : {&fresh, &used})
      ASSERT_EQ(cloth->Update(Pose(frame / 60.0), 1 / 60.0f, held()), DCLOTH_OK);
    ASSERT_EQ(fresh.positions(), used.positions()) << frame;
  }
}

// Exactly the bytes asked for, at any address, without allocating; never more than the cloth itself takes.
TEST_P(StateTest, SizesAreExact) {
  OwnedCloth cloth(opened_);
  const size_t storage = cloth.storage().size();
  size_t smallest = SIZE_MAX, largest = 0;
  for (int frame = 0; frame < 60; ++frame) {
    const size_t size = dcloth_cloth_state_size(cloth.get());
    ASSERT_LT(size, storage);
    smallest = frame < 5 ? smallest : std::min(smallest, size);
    largest = std::max(largest, size);
    std::vector<uint8_t> memory(size + 16, 0xEE);
    uint8_t* const state = memory.data() + 1 + frame % 8;
    dcloth_error error = EmptyError();
    ASSERT_EQ(dcloth_cloth_save(cloth.get(), state, size - 1, &error), DCLOTH_ERROR_MEMORY);
    ASSERT_EQ(memory, std::vector<uint8_t>(size + 16, 0xEE)) << "a refused save wrote";
    ASSERT_NE(std::string(error.text).find("allowed: at least " + std::to_string(size)), std::string::npos);
    size_t allocations = 0;
    {
      const AllocationTrap trap;
      ASSERT_EQ(dcloth_cloth_save(cloth.get(), state, size + 7, &error), DCLOTH_OK);
      ASSERT_EQ(dcloth_cloth_restore(cloth.get(), state, size, 0, &error), DCLOTH_OK);
      allocations = trap.count();
    }
    ASSERT_EQ(allocations, 0u);
    ASSERT_TRUE(std::all_of(memory.data(), state, [](uint8_t b) { return b == 0xEE; }));
    ASSERT_TRUE(
        std::all_of<const uint8_t*>(state + size, memory.data() + memory.size(), [](uint8_t b) { return b == 0xEE; }));
    ASSERT_EQ(cloth.Update(Pose(frame / 100.0), 0.01f, held(), DCLOTH_FRAME_PIPELINED), DCLOTH_OK);
  }
  std::cout << "state " << smallest << " to " << largest << " bytes of a cloth of " << storage << "\n";
}

INSTANTIATE_TEST_SUITE_P(Every, StateTest, ::testing::ValuesIn(WideVariants()),
                         [](const auto& test) { return test.param.name; });

// The head's places, by number: what other readers rely on.
TEST(StateFormat, HeadLiesWhereItIsWritten) {
  const TestModel model = BuildModel({});
  model.tables->identity = 0x0123456789ABCDEF;
  const OpenedModel opened(model);
  OwnedCloth cloth(opened);
  ASSERT_EQ(cloth.Tick(PoseAt(model.numbers, 0), DCLOTH_STAGES_SKELETON), DCLOTH_OK);
  const StateBytes bytes = Save(&cloth);
  const auto number = [&](size_t offset, size_t width) {
    uint64_t value = 0;
    for (size_t i = width; i-- > 0;) value = value << 8 | bytes[offset + i];
    return value;
  };
  EXPECT_EQ(std::string(bytes.begin(), bytes.begin() + 4), "DCLS");
  EXPECT_EQ(number(4, 4), 5u);
  EXPECT_EQ(number(16, 8), bytes.size());
  EXPECT_EQ(number(24, 8), 0x0123456789ABCDEFu);
  const ModelSpec& spec = model.numbers.spec;
  const size_t n = model.numbers.n, d = model.numbers.d, m = spec.bones;
  const uint64_t sizes[] = {spec.joints, d, m, n, spec.units, spec.layers, spec.feature_width, 0x41F00000u};
  for (size_t i = 0; i < std::size(sizes); ++i) EXPECT_EQ(number(32 + 4 * i, 4), sizes[i]) << i;
  const uint64_t position[] = {1, DCLOTH_STAGES_SKELETON, 10, 0, 0, 0, 0};
  for (size_t i = 0; i < std::size(position); ++i) EXPECT_EQ(number(64 + 4 * i, 4), position[i]) << i;
  for (size_t at = 200; at < 248; at += 8) EXPECT_EQ(number(at, 8), 0u) << at;  // no age, wind, idle floats, contact
  // The pose and the idle pose, features, h, increments and displacement of one tick; the mesh stage rests.
  EXPECT_EQ(bytes.size(), 248 + 2 * 96 * spec.joints + 4 * (d + spec.units + 3 * m + 3 * n));
}

// Poses, joints and space belong to the host: a restored cloth keeps its own.
TEST(State, BindingAndSpaceStay) {
  const TestModel model = BuildModel({});
  const OpenedModel opened(model);
  OwnedCloth plain(opened), bound(opened);
  std::vector<std::string> names = {"camera"};
  std::vector<const char*> pointers;
  for (uint32_t j = 0; j < model.numbers.spec.joints; ++j) names.push_back(dcloth_model_joint_name(opened.get(), j));
  for (const std::string& name : names) pointers.push_back(name.c_str());
  ASSERT_EQ(dcloth_cloth_bind_joints(bound.get(), pointers.data(), static_cast<uint32_t>(pointers.size()), nullptr),
            DCLOTH_OK);
  for (int frame = 0; frame < 30; ++frame) {
    const std::vector<float> pose = PoseAt(model.numbers, frame / 60.0);
    std::vector<float> wide(16, 7.0f);
    wide.insert(wide.end(), pose.begin(), pose.end());
    if (frame == 15) {
      ASSERT_EQ(Restore(&bound, Save(&plain)), DCLOTH_OK);
    }
    ASSERT_EQ(plain.Update(pose, 1 / 60.0f, kAll), DCLOTH_OK);
    ASSERT_EQ(bound.Update(wide, 1 / 60.0f, kAll), DCLOTH_OK);
    ASSERT_EQ(plain.positions(), bound.positions()) << frame;
  }
}

// Weights of NaN make a state that no restore would take: told while saving.
TEST(State, BrokenWeightsAreToldWhileSaving) {
  TestModel model = BuildModel({});
  const float nan = std::numeric_limits<float>::quiet_NaN();
  std::memcpy(model.tables->weights.data() + model.tables->skeleton_stage->input->weights->offset, &nan, sizeof(nan));
  const OpenedModel opened(model.Bytes());
  ASSERT_EQ(opened.status(), DCLOTH_OK) << opened.error().text;
  OwnedCloth cloth(opened);
  ASSERT_EQ(cloth.Tick(PoseAt(model.numbers, 0), kAll), DCLOTH_OK);
  StateBytes bytes(dcloth_cloth_state_size(cloth.get()), 0xEE);
  dcloth_error error = EmptyError();
  EXPECT_EQ(dcloth_cloth_save(cloth.get(), bytes.data(), bytes.size(), &error), DCLOTH_ERROR_SEMANTICS);
  EXPECT_EQ(std::string(error.text).find("skeleton_state[0]: found NaN; allowed: -1 to 1"), 0u) << error.text;
  const size_t poses = 2 * sizeof(double) * 12 * model.numbers.spec.joints;
  EXPECT_EQ(error.offset_bytes, sizeof(engine::StateHead) + poses + sizeof(float) * model.numbers.d);
  EXPECT_EQ(bytes, StateBytes(bytes.size(), 0xEE));
  ASSERT_EQ(dcloth_cloth_reset(cloth.get()), DCLOTH_OK);
  EXPECT_EQ(Save(&cloth).size(), sizeof(engine::StateHead));
}

// Padding too: a file may hold padding of a basis that weighs, and a cloth that paused in a tick coefficients to meet
// it.
TEST(State, NothingOfAnEarlierLifeIsLeft) {
  TestModel model = BuildModel(WideVariants().front().spec);
  const ModelSpec& spec = model.numbers.spec;
  format::ModelT* tables = model.tables.get();
  const format::TensorT &bias = *tables->mesh_stage->coefficients->bias, &basis = *tables->displacement->basis->weights;
  const auto floats = [&](const format::TensorT& tensor) {
    return reinterpret_cast<float*>(tables->weights.data() + tensor.offset);
  };
  ASSERT_EQ(spec.mesh_basis % 2, 1u);
  floats(bias)[spec.mesh_basis] = 1;
  const size_t rows = basis.shape[0], panels = kernels::PanelCount(3 * model.numbers.n);
  ASSERT_EQ(rows, spec.units + 1 + spec.mesh_basis + 1);
  constexpr size_t kWidth = kernels::kPanelColumns;
  std::fill_n(floats(basis), panels * rows * kWidth, 0.0f);
  for (size_t panel = 1; panel <= panels; ++panel)
    std::fill_n(floats(basis) + (panel * rows - 1) * kWidth, kWidth, 1e38f);

  const OpenedModel opened(model);
  ASSERT_EQ(opened.status(), DCLOTH_OK) << opened.error().text;
  const auto pause_in = [&](OwnedCloth* cloth, engine::TickPart part) {
    ASSERT_EQ(cloth->Tick(PoseAt(model.numbers, 0), kAll), DCLOTH_OK);
    ASSERT_EQ(cloth->Update(PoseAt(model.numbers, 0.03), static_cast<float>(0.99 * kTick), kAll), DCLOTH_OK);
    ASSERT_EQ(
        cloth->Update(PoseAt(model.numbers, 0.03), static_cast<float>(0.01 * kTick), kAll, DCLOTH_FRAME_PIPELINED),
        DCLOTH_OK);
    for (int crumb = 0; HeadOf(Save(cloth)).part != static_cast<uint32_t>(part); ++crumb) {
      ASSERT_LT(crumb, 1000);
      ASSERT_EQ(cloth->Update(PoseAt(model.numbers, 0.03), 1e-6f, kAll, DCLOTH_FRAME_PIPELINED), DCLOTH_OK);
    }
  };
  OwnedCloth saved(opened), fresh(opened), used(opened);
  pause_in(&saved, engine::TickPart::kBasis);
  pause_in(&used, engine::TickPart::kHead);
  for (OwnedCloth* cloth : {&fresh, &used}) ASSERT_EQ(Restore(cloth, Save(&saved)), DCLOTH_OK);
  for (OwnedCloth* cloth : {&saved, &fresh, &used})
    ASSERT_EQ(cloth->Update(PoseAt(model.numbers, 0.05), static_cast<float>(kTick), kAll), DCLOTH_OK);
  EXPECT_EQ(fresh.positions(), saved.positions());
  EXPECT_EQ(used.positions(), saved.positions());
}

TEST(State, BadArgumentsAreRefused) {
  const OpenedModel opened(BuildModel({}));
  OwnedCloth cloth(opened);
  StateBytes bytes = Save(&cloth);
  EXPECT_EQ(dcloth_cloth_state_size(nullptr), 0u);
  EXPECT_EQ(dcloth_cloth_save(nullptr, bytes.data(), bytes.size(), nullptr), DCLOTH_ERROR_ARGUMENT);
  EXPECT_EQ(dcloth_cloth_save(cloth.get(), nullptr, bytes.size(), nullptr), DCLOTH_ERROR_ARGUMENT);
  EXPECT_EQ(dcloth_cloth_restore(nullptr, bytes.data(), bytes.size(), 0, nullptr), DCLOTH_ERROR_ARGUMENT);
  EXPECT_EQ(dcloth_cloth_restore(cloth.get(), nullptr, bytes.size(), 0, nullptr), DCLOTH_ERROR_ARGUMENT);
  for (const uint32_t flags : {2u, 3u, ~0u}) EXPECT_EQ(Restore(&cloth, bytes, flags), DCLOTH_ERROR_ARGUMENT);
  EXPECT_EQ(Restore(&cloth, bytes), DCLOTH_OK);
}

}  // namespace
}  // namespace dcloth::testing

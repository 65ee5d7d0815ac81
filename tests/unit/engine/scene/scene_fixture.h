// Fifty characters in one budget, with costs given by numbers: what their updates really ran is counted by a clock that
// counts calls, and priced by the test itself.
#ifndef DCLOTH_TESTS_UNIT_ENGINE_SCENE_SCENE_FIXTURE_H_
#define DCLOTH_TESTS_UNIT_ENGINE_SCENE_SCENE_FIXTURE_H_

#include <algorithm>
#include <array>
#include <memory>
#include <vector>

#include "dcloth/dcloth_scene.h"
#include "tests/unit/engine/update_fixture.h"

namespace dcloth::testing {

constexpr uint32_t kCharacters = 50;
constexpr float kDraw = 40, kTicks[DCLOTH_LEVEL_COUNT] = {0, 15, 120, 170, 700};
constexpr float kErrors[DCLOTH_LEVEL_COUNT] = {60, 35, 12, 8, 6};

class SceneTest : public UpdateTest {
 protected:
  static TestModel Small() {
    ModelSpec spec;
    spec.rings = 2;
    spec.segments = 4;
    spec.layers = 1;
    spec.feature_width = 8;
    return BuildModel(spec);
  }

  struct Ran {
    uint32_t ticks = 0, mesh_ticks = 0;
    double microseconds = 0;
  };

  SceneTest() {
    model_ = Small();
    small_ = std::make_unique<OpenedModel>(model_);
    for (uint32_t i = 0; i < kCharacters; ++i) cloths_.push_back(std::make_unique<OwnedCloth>(*small_));
    storage_ = AlignedBytes(dcloth_scene_storage_size(kCharacters));
    EXPECT_EQ(dcloth_scene_create(kCharacters, storage_.data(), storage_.size(), &scene_, nullptr), DCLOTH_OK);
    for (uint32_t i = 0; i < kCharacters; ++i) EXPECT_EQ(Set(i, 1), DCLOTH_OK);
    OwnedCloth one(*small_);
    mesh_laps_ = Count(&one, PoseAt(model_.numbers, 0), 0.0f, kAll, 0)[DCLOTH_STEP_MESH];
    EXPECT_GT(mesh_laps_, 0u);
  }

  dcloth_scene_character Character(uint32_t index, float importance) const {
    dcloth_scene_character character = {};
    character.struct_size = sizeof(character);
    character.top_level = DCLOTH_LEVEL_MESH;
    character.cloth = cloths_[index]->get();
    character.importance = importance;
    character.draw_microseconds = kDraw;
    std::copy(std::begin(kTicks), std::end(kTicks), character.tick_microseconds);
    std::copy(std::begin(kErrors), std::end(kErrors), character.error_mm);
    return character;
  }
  dcloth_status Set(uint32_t index, float importance) {
    const dcloth_scene_character character = Character(index, importance);
    return dcloth_scene_set(scene_, index, &character);
  }

  float Plan(float seconds, float budget, float spent = 0) {
    const dcloth_scene_frame frame = {sizeof(frame), seconds, budget, spent};
    float planned = -1;
    EXPECT_EQ(dcloth_scene_plan(scene_, &frame, &planned), DCLOTH_OK);
    return planned;
  }
  dcloth_scene_choice Choice(uint32_t index) const {
    dcloth_scene_choice choice = {};
    choice.struct_size = sizeof(choice);
    EXPECT_EQ(dcloth_scene_get(scene_, index, &choice), DCLOTH_OK);
    return choice;
  }

  // Passes of each step in one update.
  static std::array<uint64_t, DCLOTH_STEP_COUNT> Count(OwnedCloth* cloth, const std::vector<float>& matrices,
                                                       float seconds, uint32_t stages, uint32_t flags) {
    const dcloth_pose pose = OwnedCloth::Pose(matrices);
    const dcloth_frame frame = {sizeof(frame), stages, seconds, flags, nullptr};
    uint64_t calls = 0;
    dcloth_timer timer = {};
    timer.struct_size = sizeof(timer);
    timer.context = &calls;
    timer.now = [](void* context) { return ++*static_cast<uint64_t*>(context); };
    EXPECT_EQ(dcloth_cloth_update(cloth->get(), &pose, &frame, nullptr, &timer), DCLOTH_OK);
    std::array<uint64_t, DCLOTH_STEP_COUNT> passes;
    std::copy(std::begin(timer.elapsed), std::end(timer.elapsed), passes.begin());
    return passes;
  }

  // Updates a character as planned and prices what ran.
  Ran Run(uint32_t index, const std::vector<float>& pose, float seconds) {
    const dcloth_scene_choice choice = Choice(index);
    const auto passes = Count(cloths_[index].get(), pose, seconds, choice.stages, choice.flags);
    Ran ran;
    ran.ticks = static_cast<uint32_t>(passes[DCLOTH_STEP_STATIC]);
    ran.mesh_ticks = static_cast<uint32_t>(passes[DCLOTH_STEP_MESH] / mesh_laps_);
    const float tick = choice.stages == DCLOTH_STAGES_MESH       ? kTicks[DCLOTH_LEVEL_MESH]
                       : choice.stages == DCLOTH_STAGES_SKELETON ? kTicks[DCLOTH_LEVEL_SKELETON]
                                                                 : kTicks[DCLOTH_LEVEL_STATIC];
    ran.microseconds = static_cast<double>(kDraw) + ran.ticks * static_cast<double>(tick);
    EXPECT_EQ(ran.ticks, choice.ticks) << "planned and run";
    return ran;
  }

  double RunAll(double time, float seconds) {
    double cost = 0;
    for (uint32_t i = 0; i < kCharacters; ++i) cost += Run(i, PoseAt(model_.numbers, time + i), seconds).microseconds;
    return cost;
  }

  std::unique_ptr<OpenedModel> small_;
  std::vector<std::unique_ptr<OwnedCloth>> cloths_;
  AlignedBytes storage_ = AlignedBytes(64);
  dcloth_scene* scene_ = nullptr;
  uint64_t mesh_laps_ = 0;
};

}  // namespace dcloth::testing

#endif  // DCLOTH_TESTS_UNIT_ENGINE_SCENE_SCENE_FIXTURE_H_

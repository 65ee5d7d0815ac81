#include "engine/src/scene.h"

#include <cstring>
#include <new>

#include "engine/src/arena.h"
#include "engine/src/idle.h"
#include "engine/src/scene_levels.h"
#include "engine/src/scene_ticks.h"

namespace dcloth::engine {
namespace {

constexpr double kLongestFrame = 0.1;     // longer ones are hitches, which say nothing of the next frame
constexpr double kFollowSeconds = 0.1;    // of a new frame in the mean
constexpr double kFollowSlower = 0.25;    // frames that cost more than planned are believed soon
constexpr double kFollowFaster = 0.02;    // those that cost less, late
constexpr double kMostStep = 2;           // a frame that took longer was interrupted
constexpr double kLeastLoad = 0.5, kMostLoad = 4;

uint32_t TopLevel(const Cloth& cloth, uint32_t asked) {
  const uint32_t stages = ModelStages(*cloth.model);
  const uint32_t held = stages == DCLOTH_STAGES_MESH       ? DCLOTH_LEVEL_MESH
                        : stages == DCLOTH_STAGES_SKELETON ? DCLOTH_LEVEL_SKELETON
                                                           : DCLOTH_LEVEL_STATIC;
  return asked < held ? asked : held;
}

void FollowLoad(double spent, Scene* scene) {
  if (!(spent > 0) || !(scene->planned_microseconds > 0)) return;
  double load = scene->load * spent / scene->planned_microseconds;
  if (load > kMostStep * scene->load) load = kMostStep * scene->load;
  scene->load += (load > scene->load ? kFollowSlower : kFollowFaster) * (load - scene->load);
  if (scene->load < kLeastLoad) scene->load = kLeastLoad;
  if (scene->load > kMostLoad) scene->load = kMostLoad;
}

void FollowFrame(double seconds, Scene* scene) {
  const double frame = seconds < kLongestFrame ? seconds : kLongestFrame;
  if (scene->frame_seconds == 0) scene->frame_seconds = frame;
  scene->frame_seconds += kFollowSeconds * (frame - scene->frame_seconds);
}

}  // namespace

size_t PlaceScene(uint32_t count, void* storage, Scene** out) {
  Arena arena(storage);
  auto* scene = arena.Take<Scene>(1);
  Scene placed = {};
  placed.count = count;
  placed.characters = arena.Take<SceneCharacter>(count);
  placed.order = arena.Take<uint32_t>(count);
  placed.load = 1;
  if (storage != nullptr) {
    std::memset(storage, 0, arena.size());
    *out = new (scene) Scene(placed);
  }
  return arena.size();
}

void SetCharacter(const dcloth_scene_character& character, SceneCharacter* slot) {
  *slot = {};
  slot->cloth = reinterpret_cast<const Cloth*>(character.cloth);
  slot->importance = character.importance;
  slot->top_level = TopLevel(*slot->cloth, character.top_level);
  slot->draw_microseconds = character.draw_microseconds;
  std::memcpy(slot->tick_microseconds, character.tick_microseconds, sizeof(slot->tick_microseconds));
  std::memcpy(slot->error_mm, character.error_mm, sizeof(slot->error_mm));
  slot->held = true;
}

void PlanScene(Scene* scene, const dcloth_scene_frame& frame) {
  const double seconds = static_cast<double>(frame.seconds);
  FollowLoad(static_cast<double>(frame.spent_microseconds), scene);
  FollowFrame(seconds, scene);
  double drawing = 0;
  for (uint32_t i = 0; i < scene->count; ++i) {
    if (scene->characters[i].cloth != nullptr) drawing += static_cast<double>(scene->characters[i].draw_microseconds);
  }
  const double left = static_cast<double>(frame.budget_microseconds) / scene->load - drawing;
  ChooseLevels(scene, left);
  const double ticking = GrantTicks(scene, seconds, left);
  scene->planned_microseconds = (drawing + ticking) * scene->load;
}

uint32_t StagesOf(const SceneCharacter& character) {
  if (character.level >= DCLOTH_LEVEL_HALF_RATE_MESH) return DCLOTH_STAGES_MESH;
  return character.level == DCLOTH_LEVEL_SKELETON ? DCLOTH_STAGES_SKELETON : DCLOTH_STAGES_STATIC;
}

uint32_t FlagsOf(const SceneCharacter& character) {
  return DCLOTH_FRAME_FREEZE_IDLE | (character.level == DCLOTH_LEVEL_HALF_RATE_MESH ? DCLOTH_FRAME_HALF_RATE_MESH : 0) |
         (character.held ? DCLOTH_FRAME_HOLD : 0);
}

}  // namespace dcloth::engine

// The C ABI of scenes: checks arguments, translates, nothing else.
#include <cstddef>
#include <cstdint>

#include "dcloth/dcloth_scene.h"
#include "engine/format/limits.h"
#include "engine/src/base/arithmetic.h"
#include "engine/src/base/host_struct.h"
#include "engine/src/base/lent_memory.h"
#include "engine/src/scene/scene.h"

namespace {

using dcloth::engine::FloatEnvironment;
using dcloth::engine::IsWhole;
using dcloth::engine::ReadStruct;
using dcloth::engine::Scene;
using dcloth::format::Diagnostic;
using dcloth::format::kNoOffset;

static_assert(DCLOTH_SCENE_LEVELS == DCLOTH_LEVEL_COUNT, "a level more is a field more");

constexpr uint32_t kMostCharacters = 65536;
constexpr float kMost = 1e9f;  // larger numbers count as this one: sums stay exact enough

Scene* SceneOf(dcloth_scene* scene) { return reinterpret_cast<Scene*>(scene); }

// False for NaN and infinity.
bool IsUsable(float value) { return value >= 0.0f && value <= dcloth::format::kLargestFloat; }

void Limit(float* value) {
  if (*value > kMost) *value = kMost;
}

bool AreUsable(const float* values) {
  bool usable = true;
  for (uint32_t i = 0; i < DCLOTH_SCENE_LEVELS; ++i) usable &= IsUsable(values[i]);
  return usable;
}

bool CharacterIsUsable(const dcloth_scene_character& character) {
  return character.cloth != nullptr && character.top_level < DCLOTH_LEVEL_COUNT && IsUsable(character.importance) &&
         IsUsable(character.draw_microseconds) && IsUsable(character.positions_microseconds) &&
         IsUsable(character.coarse_microseconds) && IsUsable(character.undrawn_microseconds) &&
         IsUsable(character.plain_microseconds) && AreUsable(character.tick_microseconds) &&
         AreUsable(character.error_mm);
}

bool FrameIsUsable(const dcloth_scene_frame& frame) {
  return IsUsable(frame.seconds) && IsUsable(frame.budget_microseconds) && IsUsable(frame.spent_microseconds);
}

}  // namespace

extern "C" {

size_t dcloth_scene_storage_size(uint32_t character_count) {
  if (character_count == 0 || character_count > kMostCharacters) return 0;
  return dcloth::engine::PlaceScene(character_count, nullptr, nullptr);
}

dcloth_status dcloth_scene_create(uint32_t character_count, void* storage, size_t storage_size, dcloth_scene** scene,
                                  dcloth_error* error) {
  const FloatEnvironment environment;
  Diagnostic diagnostic(error);
  const size_t needed = dcloth_scene_storage_size(character_count);
  if (needed == 0 || scene == nullptr) {
    diagnostic.Fail(DCLOTH_ERROR_ARGUMENT, kNoOffset, nullptr, "a null `scene` or an invalid count of characters",
                    "a place for the result and 1 to 65536 characters", "");
    return diagnostic.status();
  }
  if (!dcloth::engine::CheckStorage(storage, storage_size, needed, &diagnostic)) return diagnostic.status();
  Scene* placed = nullptr;
  dcloth::engine::PlaceScene(character_count, storage, &placed);
  *scene = reinterpret_cast<dcloth_scene*>(placed);
  return DCLOTH_OK;
}

dcloth_status dcloth_scene_set(dcloth_scene* scene, uint32_t index, const dcloth_scene_character* character) {
  const FloatEnvironment environment;
  if (scene == nullptr || index >= SceneOf(scene)->count) return DCLOTH_ERROR_ARGUMENT;
  if (character == nullptr) {
    SceneOf(scene)->characters[index] = {};
    return DCLOTH_OK;
  }
  if (!IsWhole(character)) return DCLOTH_ERROR_ARGUMENT;
  dcloth_scene_character limited = ReadStruct(*character);
  if (!CharacterIsUsable(limited)) return DCLOTH_ERROR_ARGUMENT;
  Limit(&limited.importance);
  Limit(&limited.draw_microseconds);
  Limit(&limited.positions_microseconds);
  Limit(&limited.coarse_microseconds);
  Limit(&limited.undrawn_microseconds);
  Limit(&limited.plain_microseconds);
  for (float& cost : limited.tick_microseconds) Limit(&cost);
  for (float& error : limited.error_mm) Limit(&error);
  dcloth::engine::SetCharacter(limited, &SceneOf(scene)->characters[index]);
  return DCLOTH_OK;
}

dcloth_status dcloth_scene_set_importance(dcloth_scene* scene, uint32_t index, float importance) {
  const FloatEnvironment environment;
  const volatile float asked = importance;  // volatile: compared inside the environment, where a NaN does not trap
  if (scene == nullptr || index >= SceneOf(scene)->count || !IsUsable(asked)) return DCLOTH_ERROR_ARGUMENT;
  SceneOf(scene)->characters[index].importance = asked < kMost ? asked : kMost;
  return DCLOTH_OK;
}

dcloth_status dcloth_scene_plan(dcloth_scene* scene, const dcloth_scene_frame* frame, float* planned_microseconds) {
  const FloatEnvironment environment;
  if (scene == nullptr || !IsWhole(frame)) return DCLOTH_ERROR_ARGUMENT;
  dcloth_scene_frame limited = ReadStruct(*frame);
  if (!FrameIsUsable(limited)) return DCLOTH_ERROR_ARGUMENT;
  Limit(&limited.seconds);
  Limit(&limited.budget_microseconds);
  Limit(&limited.spent_microseconds);
  dcloth::engine::PlanScene(SceneOf(scene), limited);
  if (planned_microseconds != nullptr) *planned_microseconds = static_cast<float>(SceneOf(scene)->planned_microseconds);
  return DCLOTH_OK;
}

dcloth_status dcloth_scene_get(const dcloth_scene* scene, uint32_t index, dcloth_scene_choice* choice) {
  const FloatEnvironment environment;
  if (scene == nullptr || !IsWhole(choice)) return DCLOTH_ERROR_ARGUMENT;
  const Scene& planned = *reinterpret_cast<const Scene*>(scene);
  if (index >= planned.count || planned.characters[index].cloth == nullptr) return DCLOTH_ERROR_ARGUMENT;
  const dcloth::engine::SceneCharacter& character = planned.characters[index];
  dcloth_scene_choice filled = {};
  filled.level = character.level;
  filled.stages = dcloth::engine::StagesOf(character);
  filled.flags = dcloth::engine::FlagsOf(character);
  filled.ticks = character.ticks;
  filled.microseconds = static_cast<float>(character.microseconds);
  filled.stale_seconds = static_cast<float>(character.stale_seconds);
  filled.draw = character.draw;
  dcloth::engine::WriteStruct(filled, choice);
  return DCLOTH_OK;
}

}  // extern "C"

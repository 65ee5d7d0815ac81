#include "engine/src/scene_ticks.h"

#include <algorithm>

#include "engine/src/idle.h"

namespace dcloth::engine {
namespace {

uint32_t TicksDue(const SceneCharacter& character, double seconds) {
  const Cloth& cloth = *character.cloth;
  // A refresh of a frozen character comes when it is stale, or first; an idle cloth wants no tick.
  if (IsFrozen(cloth)) return 0;
  if (character.level == DCLOTH_LEVEL_FROZEN && cloth.root.started && character.stale_seconds < kRefreshSeconds)
    return 0;
  return cloth.clock.TicksDue(seconds * static_cast<double>(cloth.model->tick_rate));
}

double TickMicroseconds(const SceneCharacter& character, uint32_t ticks) {
  const auto cost = [&](uint32_t level) { return static_cast<double>(character.tick_microseconds[level]); };
  if (character.level == DCLOTH_LEVEL_FROZEN) return ticks * cost(DCLOTH_LEVEL_STATIC);
  if (character.level != DCLOTH_LEVEL_HALF_RATE_MESH) return ticks * cost(character.level);
  const TickPlan& last = character.cloth->plan;
  bool rests = AtHalfRate(last) && RunsMesh(last);
  double sum = 0;
  for (uint32_t tick = 0; tick < ticks; ++tick, rests = !rests)
    sum += cost(rests ? DCLOTH_LEVEL_HALF_RATE_MESH : DCLOTH_LEVEL_MESH);
  return sum;
}

}  // namespace

double GrantTicks(Scene* scene, double seconds, double left) {
  SceneCharacter* const all = scene->characters;
  uint32_t count = 0;
  for (uint32_t i = 0; i < scene->count; ++i) {
    SceneCharacter& character = all[i];
    if (character.cloth == nullptr) continue;
    character.held = true;
    character.microseconds = static_cast<double>(character.draw_microseconds);
    character.stale_seconds += seconds;
    character.ticks = TicksDue(character, seconds);
    if (character.ticks != 0 || IsFrozen(*character.cloth)) {
      scene->order[count++] = i;
    } else {
      character.late_seconds = 0;
    }
  }
  // Idle cloths come last: what is left may pay for the one that wakes.
  const auto before = [all](uint32_t a, uint32_t b) {
    if ((all[a].ticks == 0) != (all[b].ticks == 0)) return all[b].ticks == 0;
    if (all[a].late_seconds != all[b].late_seconds) return all[a].late_seconds > all[b].late_seconds;
    return all[a].importance != all[b].importance ? all[a].importance > all[b].importance : a < b;
  };
  std::sort(scene->order, scene->order + count, before);
  double spent = 0, reserved = 0;
  for (uint32_t i = 0; i < count; ++i) {
    SceneCharacter& character = all[scene->order[i]];
    const bool idle = character.ticks == 0;
    const double cost = TickMicroseconds(character, idle ? 1 : character.ticks);
    if (spent + reserved + cost > left) {
      character.ticks = 0;
      if (!idle) character.late_seconds += seconds;
      continue;
    }
    character.held = false;
    if (idle) {
      reserved += cost;
      continue;
    }
    spent += cost;
    character.microseconds += cost;
    character.late_seconds = character.stale_seconds = 0;
  }
  return spent;
}

}  // namespace dcloth::engine

#include "engine/src/scene_levels.h"

#include <algorithm>

#include "engine/src/idle.h"

namespace dcloth::engine {
namespace {

constexpr double kFull = 1 + 1e-9;   // shares of a frame
constexpr double kRaiseRoom = 0.9;   // of `left`, that a level not held yet has to fit into
constexpr double kLongerThanATick = 1.05;
constexpr double kHeldWorth = 1.25;
constexpr double kNever = 1e30;   // more than any frame has
constexpr double kLeastShare = 1e-9;

// Part of a frame that a tick takes: a whole number of them fits.
double TickShare(double microseconds, double left) {
  if (microseconds <= 0) return 0;
  const double fit = left / microseconds;
  return fit >= 1e9 ? 0 : fit >= 1 ? 1 / static_cast<double>(static_cast<uint32_t>(fit)) : kNever;
}

double ShareOf(const SceneCharacter& character, uint32_t level, double frame_seconds, double left) {
  if (level == DCLOTH_LEVEL_FROZEN) {
    const double share =
        TickShare(static_cast<double>(character.tick_microseconds[DCLOTH_LEVEL_STATIC]), left);
    return share >= kNever ? 0 : share * frame_seconds / kRefreshSeconds;  // without room there is no refresh
  }
  if (level > character.held_level) left *= kRaiseRoom;
  const double step = frame_seconds * static_cast<double>(character.cloth->model->tick_rate);
  // Where frames are longer than ticks, up to two fall due in one.
  const double at_once = step > kLongerThanATick ? kMaxTicks : 1;
  const double rate = std::min(step, static_cast<double>(kMaxTicks));
  const auto share = [&](uint32_t of) {
    return rate / at_once * TickShare(at_once * static_cast<double>(character.tick_microseconds[of]), left);
  };
  if (level != DCLOTH_LEVEL_HALF_RATE_MESH) return share(level);
  return 0.5 * (share(DCLOTH_LEVEL_HALF_RATE_MESH) + share(DCLOTH_LEVEL_MESH));
}

// The raise that is worth most per share, of those to `top` at most; false where none removes error.
bool FindRaise(SceneCharacter* character, uint32_t top, double frame_seconds, double left) {
  character->worth = 0;
  for (uint32_t level = character->level + 1; level <= top; ++level) {
    const double gain = static_cast<double>(character->importance) *
                        static_cast<double>(character->error_mm[character->level] - character->error_mm[level]);
    const double share = ShareOf(*character, level, frame_seconds, left);
    if (share > kFull) break;  // those above cost more
    const double cost = std::max(share - character->share, kLeastShare);
    const double worth = (level <= character->held_level ? kHeldWorth : 1) * gain / cost;
    if (!(worth > character->worth)) continue;
    character->worth = worth;
    character->raise_level = level;
    character->raise_share = share;
  }
  return character->worth > 0;
}

}  // namespace

void ChooseLevels(Scene* scene, double left) {
  SceneCharacter* const all = scene->characters;
  const auto by_worth = [all](uint32_t a, uint32_t b) {
    return all[a].worth != all[b].worth ? all[a].worth < all[b].worth : a > b;
  };
  double sum = 0;
  uint32_t count = 0;
  for (uint32_t i = 0; i < scene->count; ++i) {
    SceneCharacter& character = all[i];
    if (character.cloth == nullptr || IsFrozen(*character.cloth)) continue;  // idle: no cost, the level stays
    character.held_level = character.level;
    character.level = DCLOTH_LEVEL_FROZEN;
    character.share = ShareOf(character, character.level, scene->frame_seconds, left);
    sum += character.share;
    if (FindRaise(&character, character.top_level, scene->frame_seconds, left)) scene->order[count++] = i;
  }
  std::make_heap(scene->order, scene->order + count, by_worth);
  while (count > 0) {
    std::pop_heap(scene->order, scene->order + count, by_worth);
    SceneCharacter& character = all[scene->order[count - 1]];
    const double raised = sum + character.raise_share - character.share;
    uint32_t top = character.top_level;
    if (raised <= kFull) {
      sum = raised;
      character.level = character.raise_level;
      character.share = character.raise_share;
    } else {
      top = character.raise_level - 1;
    }
    if (FindRaise(&character, top, scene->frame_seconds, left)) {
      std::push_heap(scene->order, scene->order + count, by_worth);
    } else {
      --count;
    }
  }
}

}  // namespace dcloth::engine

#include "engine/src/scene/scene.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <new>

#include "engine/src/base/lent_memory.h"
#include "engine/src/scene/drawing.h"
#include "engine/src/time/idle.h"

namespace dcloth::engine {
namespace {

constexpr double kFull = 1 + 1e-9;  // shares of a frame
constexpr double kRaiseRoom = 0.9;  // of `left`, that a level not held yet has to fit into
constexpr double kLongerThanATick = 1.05;
constexpr double kHeldWorth = 1.25;
constexpr double kNever = 1e30;  // more than any frame has
constexpr double kLeastShare = 1e-9;

// Part of a frame that a tick takes: a whole number of them fits.
double TickShare(double microseconds, double left) {
  if (microseconds <= 0) return 0;
  const double fit = left / microseconds;
  return fit >= 1e9 ? 0 : fit >= 1 ? 1 / static_cast<double>(static_cast<uint32_t>(fit)) : kNever;
}

double ShareOf(const SceneCharacter& character, uint32_t level, double frame_seconds, double left) {
  if (level == DCLOTH_LEVEL_FROZEN) {
    const double share = TickShare(static_cast<double>(character.tick_microseconds[DCLOTH_LEVEL_STATIC]), left);
    return share >= kNever ? 0 : share * frame_seconds / kRefreshSeconds;  // without room there is no refresh
  }
  if (level > character.held_level) left *= kRaiseRoom;
  const double step = frame_seconds * static_cast<double>(character.cloth->model->tick_rate);
  // Where frames are longer than ticks, up to two fall due in one.
  const double at_once = step > kLongerThanATick ? kMaxTicks : 1;
  const double rate = std::min(step, static_cast<double>(kMaxTicks));
  return rate / at_once * TickShare(at_once * static_cast<double>(character.tick_microseconds[level]), left);
}

// The raise that is worth most per share, of those to `top` at most; false where none removes error.
bool FindRaise(SceneCharacter* character, uint32_t top, double frame_seconds, double left) {
  character->worth = 0;
  for (uint32_t level = character->level + 1; level <= top; ++level) {
    if (level == kNoLevel) continue;
    const double gain = std::sqrt(static_cast<double>(character->importance)) *
                        static_cast<double>(character->error_mm[character->level] - character->error_mm[level]);
    const double share = ShareOf(*character, level, frame_seconds, left);
    if (share > kFull) break;  // those above cost more
    const double cost = std::max(share - character->share, kLeastShare);
    const double worth = (level <= character->held_level ? kHeldWorth : 1) * gain / cost;
    if (!(worth > character->worth)) continue;
    character->worth = worth;
    character->next = level;
    character->next_share = share;
  }
  return character->worth > 0;
}

// Sets the level of each character that is not idle; `left` is what a frame has for ticks, microseconds.
//
// A level's share of a frame is its ticks per frame, over how many such ticks fit into one frame (harmonic packing:
// what adds up to 1 can be packed whole, tick by tick). Everyone starts frozen; the raise with the most error removed
// times the root of importance, per share, comes first. A level once held is kept until the frames overflow, and is
// worth a quarter more than another's: a stage that stops and starts forgets its motion. Cost: N log N.
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
    const double raised = sum + character.next_share - character.share;
    uint32_t top = character.top_level;
    if (raised <= kFull) {
      sum = raised;
      character.level = character.next;
      character.share = character.next_share;
    } else {
      top = character.next - 1;
    }
    if (FindRaise(&character, top, scene->frame_seconds, left)) {
      std::push_heap(scene->order, scene->order + count, by_worth);
    } else {
      --count;
    }
  }
}

uint32_t TicksDue(const SceneCharacter& character, double seconds) {
  const Cloth& cloth = *character.cloth;
  // A refresh of a frozen character comes when it is stale, or first; an idle cloth wants no tick.
  if (IsFrozen(cloth)) return 0;
  if (character.level == DCLOTH_LEVEL_FROZEN && cloth.root.started && character.stale_seconds < kRefreshSeconds)
    return 0;
  return cloth.clock.TicksDue(seconds * static_cast<double>(cloth.model->tick_rate));
}

double TickMicroseconds(const SceneCharacter& character, uint32_t ticks) {
  const uint32_t lowest = DCLOTH_LEVEL_STATIC;  // what refreshes a frozen character
  return ticks * static_cast<double>(character.tick_microseconds[std::max(lowest, character.level)]);
}

// Fills ticks, held, microseconds, late and stale of each character for a frame of `seconds`; returns the ticks' cost,
// at most `left` (0 where that is negative). A tick that does not fit lets smaller ones pass, and goes first in the
// next frame: ChooseLevels gives no level whose tick is longer than `left`, so nobody waits longer than the others
// take.
double GrantTicks(Scene* scene, double seconds, double left) {
  SceneCharacter* const all = scene->characters;
  uint32_t count = 0;
  for (uint32_t i = 0; i < scene->count; ++i) {
    SceneCharacter& character = all[i];
    if (character.cloth == nullptr) continue;
    character.held = true;
    character.microseconds = static_cast<double>(character.draw_microseconds[character.draw]);
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

constexpr double kLongestFrame = 0.1;   // longer ones are hitches, which say nothing of the next frame
constexpr double kFollowSeconds = 0.1;  // of a new frame in the mean
constexpr double kFollowSlower = 0.25;  // frames that cost more than planned are believed soon
constexpr double kFollowFaster = 0.02;  // those that cost less, late
constexpr double kMostStep = 2;         // a frame that took longer was interrupted
constexpr double kLeastLoad = 0.5, kMostLoad = 4;
// What is kept back of the budget, for frames that take longer than the load says: a frame over its budget adds part of
// what it was over, and it is forgotten within some thousand frames.
constexpr double kReserveOfOver = 0.3, kMostOver = 0.2, kMostReserve = 0.25, kReserveKept = 1 - 1.0 / 2000;

uint32_t TopLevel(const Cloth& cloth, uint32_t asked) {
  const uint32_t stages = ModelStages(*cloth.model);
  const uint32_t held = stages == DCLOTH_STAGES_MESH       ? DCLOTH_LEVEL_MESH
                        : stages == DCLOTH_STAGES_SKELETON ? DCLOTH_LEVEL_SKELETON
                                                           : DCLOTH_LEVEL_STATIC;
  const uint32_t top = asked < held ? asked : held;
  return top == kNoLevel ? kNoLevel - 1 : top;
}

void FollowLoad(double spent, Scene* scene) {
  if (!(spent > 0) || !(scene->planned_microseconds > 0)) return;
  double load = scene->load * spent / scene->planned_microseconds;
  if (load > kMostStep * scene->load) load = kMostStep * scene->load;
  scene->load += (load > scene->load ? kFollowSlower : kFollowFaster) * (load - scene->load);
  if (scene->load < kLeastLoad) scene->load = kLeastLoad;
  if (scene->load > kMostLoad) scene->load = kMostLoad;
}

void FollowOverruns(double spent, Scene* scene) {
  if (!(spent > 0)) return;
  scene->reserve *= kReserveKept;
  if (!(spent > scene->budget) || scene->planned_microseconds > scene->budget) return;
  scene->reserve += kReserveOfOver * std::min(spent / scene->budget - 1, kMostOver);
  scene->reserve = std::min(scene->reserve, kMostReserve);
}

void FollowFrame(double seconds, Scene* scene) {
  const double frame = seconds < kLongestFrame ? seconds : kLongestFrame;
  if (scene->frame_seconds == 0) scene->frame_seconds = frame;
  scene->frame_seconds += kFollowSeconds * (frame - scene->frame_seconds);
}

}  // namespace

size_t PlaceScene(uint32_t count, void* storage, Scene** out) {
  if (storage != nullptr) std::memset(storage, 0, PlaceScene(count, nullptr, nullptr));
  Arena arena(storage);
  auto* scene = arena.Take<Scene>(1);
  Scene placed = {};
  placed.count = count;
  placed.characters = arena.Take<SceneCharacter>(count);
  placed.order = arena.Take<uint32_t>(count);
  placed.load = 1;
  if (storage != nullptr) *out = new (scene) Scene(placed);
  return arena.size();
}

void SetCharacter(const dcloth_scene_character& character, SceneCharacter* slot) {
  *slot = {};
  slot->cloth = reinterpret_cast<const Cloth*>(character.cloth);
  slot->importance = character.importance;
  slot->top_level = TopLevel(*slot->cloth, character.top_level);
  slot->draw_microseconds[DCLOTH_DRAW_NONE] = character.undrawn_microseconds;
  slot->draw_microseconds[DCLOTH_DRAW_COARSE] = character.coarse_microseconds;
  slot->draw_microseconds[DCLOTH_DRAW_POSITIONS] = character.positions_microseconds;
  slot->draw_microseconds[DCLOTH_DRAW_FULL] = character.draw_microseconds;
  slot->draw_microseconds[DCLOTH_DRAW_PLAIN] = character.plain_microseconds;
  slot->most_undrawn = std::min(character.most_undrawn, kMostUndrawn);
  std::memcpy(slot->tick_microseconds, character.tick_microseconds, sizeof(slot->tick_microseconds));
  std::memcpy(slot->error_mm, character.error_mm, sizeof(slot->error_mm));
  slot->held = true;
}

void PlanScene(Scene* scene, const dcloth_scene_frame& frame) {
  const double seconds = static_cast<double>(frame.seconds);
  FollowLoad(static_cast<double>(frame.spent_microseconds), scene);
  FollowOverruns(static_cast<double>(frame.spent_microseconds), scene);
  FollowFrame(seconds, scene);
  scene->budget = static_cast<double>(frame.budget_microseconds);
  const double budget = scene->budget * (1 - scene->reserve) / scene->load;
  const DrawingCosts costs = ChooseDetails(scene, budget);
  const double drawing = GrantDrawing(scene);
  ChooseLevels(scene, budget - costs.longest);
  const double ticking = GrantTicks(scene, seconds, budget - drawing);
  scene->planned_microseconds = (drawing + ticking) * scene->load;
}

uint32_t StagesOf(const SceneCharacter& character) {
  if (character.level == DCLOTH_LEVEL_MESH) return DCLOTH_STAGES_MESH;
  return character.level == DCLOTH_LEVEL_SKELETON ? DCLOTH_STAGES_SKELETON : DCLOTH_STAGES_STATIC;
}

uint32_t FlagsOf(const SceneCharacter& character) {
  return DCLOTH_FRAME_FREEZE_IDLE | (character.held ? DCLOTH_FRAME_HOLD : 0);
}

}  // namespace dcloth::engine

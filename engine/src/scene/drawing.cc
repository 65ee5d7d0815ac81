#include "engine/src/scene/drawing.h"

#include <algorithm>
#include <cmath>

#include "engine/src/time/idle.h"

namespace dcloth::engine {
namespace {

constexpr double kRounding = 1 + 1e-9;
constexpr double kNewRoom = 0.9;  // of the budget, that a step has to fit into which the last plan did not take
constexpr double kHeldWorth = 1.25;
constexpr double kPacking = 1.1;  // what ChooseLevels asks for a mean microsecond of ticks, about
constexpr double kLeastCost = 1e-6, kLeastImportance = 1e-9;

// Details, finest first: everything; normals in every second frame; without contact; the coarse mesh; then in every
// second, fourth, ... frame alone.
constexpr uint32_t kFull = 0, kHalfNormals = 1, kPlain = 2, kCoarse = 3, kSparse = 4, kDetails = kSparse + 4;
static_assert(1u << (kDetails - kCoarse - 1) == kMostUndrawn + 1, "the last detail is the sparsest");

// What a detail takes from the picture, as millimetres of error that look as wrong. Those of cloth that lags behind its
// hips were measured in walks and runs; what skin that shows and missing vertices look like is a choice.
constexpr double kHarm[kDetails] = {0, 1, 1, 5, 7, 12, 21, 40};
constexpr double kSkin = 6;  // more, of what is drawn without contact

// A detail draws `least` in every frame and `full` in one of `period`.
struct Detail {
  uint32_t least, full, period;
};

bool Offers(const SceneCharacter& character, uint32_t draw) { return character.draw_microseconds[draw] > 0; }

uint32_t Period(const SceneCharacter& character, uint32_t detail) {
  return std::min(1u << (detail - kCoarse), character.most_undrawn + 1);
}

// False where the character has no such detail.
bool FindDetail(const SceneCharacter& character, uint32_t detail, Detail* found) {
  const uint32_t mesh = Offers(character, DCLOTH_DRAW_COARSE)  ? DCLOTH_DRAW_COARSE
                        : Offers(character, DCLOTH_DRAW_PLAIN) ? DCLOTH_DRAW_PLAIN
                                                               : DCLOTH_DRAW_FULL;
  switch (detail) {
    case kFull:
      *found = {DCLOTH_DRAW_FULL, DCLOTH_DRAW_FULL, 1};
      return true;
    case kHalfNormals:
      *found = {DCLOTH_DRAW_POSITIONS, DCLOTH_DRAW_FULL, 2};
      return Offers(character, DCLOTH_DRAW_POSITIONS);
    case kPlain:
      *found = {DCLOTH_DRAW_PLAIN, DCLOTH_DRAW_PLAIN, 1};
      return Offers(character, DCLOTH_DRAW_PLAIN);
    case kCoarse:
      *found = {mesh, mesh, 1};
      return mesh == DCLOTH_DRAW_COARSE;
    default:
      *found = {DCLOTH_DRAW_NONE, mesh, Period(character, detail)};
      return found->period > (detail == kSparse ? 1 : Period(character, detail - 1));
  }
}

double CostOf(const SceneCharacter& character, uint32_t draw) {
  return static_cast<double>(character.draw_microseconds[draw]);
}

double MeanCost(const SceneCharacter& character, const Detail& detail) {
  const double least = CostOf(character, detail.least);
  return least + (CostOf(character, detail.full) - least) / detail.period;
}

double HarmOf(const SceneCharacter& character, uint32_t detail) {
  return kHarm[detail] + (detail >= kPlain && Offers(character, DCLOTH_DRAW_PLAIN) ? kSkin : 0);
}

// The cheapest detail.
uint32_t FindLeast(const SceneCharacter& character) {
  uint32_t least = kFull;
  double lowest = CostOf(character, DCLOTH_DRAW_FULL);
  for (uint32_t index = kFull + 1; index < kDetails; ++index) {
    Detail detail;
    if (!FindDetail(character, index, &detail) || MeanCost(character, detail) >= lowest) continue;
    lowest = MeanCost(character, detail);
    least = index;
  }
  return least;
}

// Of a level in a mean frame, microseconds.
double TicksCost(const SceneCharacter& character, uint32_t level, double frame_seconds) {
  if (level == DCLOTH_LEVEL_FROZEN) return 0;
  const double step = frame_seconds * static_cast<double>(character.cloth->model->tick_rate);
  return kPacking * std::min(step, static_cast<double>(kMaxTicks)) *
         static_cast<double>(character.tick_microseconds[level]);
}

// The finer detail or the higher level that removes most harm per microsecond; false where there is none.
bool FindStep(SceneCharacter* character, double frame_seconds) {
  character->worth = 0;
  const auto offer = [character](bool ticks, uint32_t next, double harm, double cost, bool held) {
    const double worth = (held ? kHeldWorth : 1) * harm / std::max(cost, kLeastCost);
    if (!(worth > character->worth)) return;
    character->step = {ticks, held, next, cost};
    character->worth = worth;
  };
  const auto importance = static_cast<double>(character->importance);
  for (uint32_t index = character->finest; index < character->detail; ++index) {
    Detail detail;
    if (!FindDetail(*character, index, &detail)) continue;
    const double removed =
        std::max(importance, kLeastImportance) * (HarmOf(*character, character->detail) - HarmOf(*character, index));
    offer(false, index, removed, MeanCost(*character, detail) - character->share, character->held_detail <= index);
  }
  const uint32_t from = character->likely_level;
  for (uint32_t level = from + 1; level <= character->likely_top; ++level) {
    if (level == kNoLevel) continue;
    const double removed =
        std::sqrt(importance) * static_cast<double>(character->error_mm[from] - character->error_mm[level]);
    offer(true, level, removed,
          TicksCost(*character, level, frame_seconds) - TicksCost(*character, from, frame_seconds),
          level <= character->level);
  }
  return character->worth > 0;
}

// What the detail of a character leaves to alternate; false where it leaves nothing.
bool Alternates(const SceneCharacter& character, Detail* detail) {
  FindDetail(character, character.detail, detail);
  // Normals cannot be kept from a mesh that was not drawn.
  if (character.detail == kHalfNormals && character.drawn == DCLOTH_DRAW_COARSE) detail->least = DCLOTH_DRAW_COARSE;
  if (character.detail == kHalfNormals && character.drawn == DCLOTH_DRAW_NONE) detail->least = DCLOTH_DRAW_FULL;
  return detail->least != detail->full;
}

}  // namespace

DrawingCosts ChooseDetails(Scene* scene, double budget) {
  SceneCharacter* const all = scene->characters;
  const auto by_worth = [all](uint32_t a, uint32_t b) {
    return all[a].worth != all[b].worth ? all[a].worth < all[b].worth : a > b;
  };
  double sum = 0, dearest = 0;  // the latter of what alternates: a frame has room for one of them at least
  uint32_t count = 0;
  for (uint32_t i = 0; i < scene->count; ++i) {
    SceneCharacter& character = all[i];
    if (character.cloth == nullptr) continue;
    character.held_detail = character.detail;
    character.detail = FindLeast(character);
    character.finest = kFull;
    character.likely_level = DCLOTH_LEVEL_FROZEN;
    character.likely_top = IsFrozen(*character.cloth) ? uint32_t{DCLOTH_LEVEL_FROZEN} : character.top_level;
    Detail detail;
    if (Alternates(character, &detail))
      dearest = std::max(dearest, CostOf(character, detail.full) - CostOf(character, detail.least));
    character.share = MeanCost(character, detail);
    sum += character.share;
    if (FindStep(&character, scene->frame_seconds)) scene->order[count++] = i;
  }
  sum += dearest;
  std::make_heap(scene->order, scene->order + count, by_worth);
  while (count > 0) {
    std::pop_heap(scene->order, scene->order + count, by_worth);
    SceneCharacter& character = all[scene->order[count - 1]];
    const SceneCharacter::Step step = character.step;
    const bool fits = sum + step.cost <= (step.held ? 1 : kNewRoom) * budget;
    if (fits) sum += step.cost;
    if (step.ticks) {
      if (fits) character.likely_level = step.next;
      if (!fits) character.likely_top = step.next - 1;
    } else if (fits) {
      character.detail = step.next;
      character.share += step.cost;
    } else {
      character.finest = step.next + 1;
    }
    if (FindStep(&character, scene->frame_seconds)) {
      std::push_heap(scene->order, scene->order + count, by_worth);
    } else {
      --count;
    }
  }
  double mean = 0;
  dearest = 0;
  for (uint32_t i = 0; i < scene->count; ++i) {
    if (all[i].cloth == nullptr) continue;
    Detail detail;
    const bool alternates = Alternates(all[i], &detail);
    mean += MeanCost(all[i], detail);
    if (alternates) dearest = std::max(dearest, CostOf(all[i], detail.full) - CostOf(all[i], detail.least));
  }
  return {mean, mean + dearest};
}

double GrantDrawing(Scene* scene) {
  SceneCharacter* const all = scene->characters;
  double spent = 0, mean = 0, dearest = 0;  // the last two of what alternates
  uint32_t count = 0;
  for (uint32_t i = 0; i < scene->count; ++i) {
    SceneCharacter& character = all[i];
    if (character.cloth == nullptr) continue;
    Detail detail;
    const bool alternates = Alternates(character, &detail);
    character.draw = detail.least;
    const double least = CostOf(character, detail.least);
    spent += least;
    if (!alternates) {
      character.waited_frames = 0;
      if (character.draw != DCLOTH_DRAW_NONE) character.drawn = character.draw;
      continue;
    }
    ++character.waited_frames;
    character.worth = static_cast<double>(character.waited_frames) / detail.period;
    const double more = CostOf(character, detail.full) - least;
    mean += more / detail.period;
    dearest = std::max(dearest, more);
    scene->order[count++] = i;
  }
  const auto before = [all](uint32_t a, uint32_t b) {
    if (all[a].worth != all[b].worth) return all[a].worth > all[b].worth;
    return all[a].importance != all[b].importance ? all[a].importance > all[b].importance : a < b;
  };
  std::sort(scene->order, scene->order + count, before);
  // What a frame leaves over goes to the next one, up to one character's drawing.
  scene->alternates_left = std::min(scene->alternates_left, dearest) + mean;
  bool enough = true;
  for (uint32_t i = 0; i < count; ++i) {
    SceneCharacter& character = all[scene->order[i]];
    Detail detail;
    Alternates(character, &detail);
    const double cost = CostOf(character, detail.full) - CostOf(character, detail.least);
    // Whoever does not fit is the first of the next frame: nobody overtakes.
    enough = enough && cost <= scene->alternates_left * kRounding;
    if (enough) {
      scene->alternates_left -= cost;
      spent += cost;
      character.draw = detail.full;
      character.waited_frames = 0;
    }
    if (character.draw != DCLOTH_DRAW_NONE) character.drawn = character.draw;
  }
  return spent;
}

}  // namespace dcloth::engine

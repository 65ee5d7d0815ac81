#include "engine/src/scene/drawing.h"

#include <algorithm>

namespace dcloth::engine {
namespace {

constexpr double kRounding = 1 + 1e-9;
constexpr double kFinerRoom = 0.9;  // of the room, that has to suffice before a detail of the last plan gets finer

// Details, finest first: everything; normals in every second frame; the coarse mesh; then in every second, fourth, ...
// frame alone.
constexpr uint32_t kFull = 0, kHalfNormals = 1, kCoarse = 2, kSparse = 3, kDetails = kSparse + 4;
static_assert(1u << (kDetails - kCoarse - 1) == kMostUndrawn + 1, "the last detail is the sparsest");

// What a detail takes from the picture, in units of its own; times importance it is the harm.
constexpr double kHarm[kDetails] = {0, 1, 3, 6, 12, 24, 48};

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
  const uint32_t mesh = Offers(character, DCLOTH_DRAW_COARSE) ? DCLOTH_DRAW_COARSE : DCLOTH_DRAW_FULL;
  switch (detail) {
    case kFull:
      *found = {DCLOTH_DRAW_FULL, DCLOTH_DRAW_FULL, 1};
      return true;
    case kHalfNormals:
      *found = {DCLOTH_DRAW_POSITIONS, DCLOTH_DRAW_FULL, 2};
      return Offers(character, DCLOTH_DRAW_POSITIONS);
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

// The next detail below that saves something; false where there is none.
bool FindLowering(SceneCharacter* character) {
  for (uint32_t index = character->detail + 1; index < kDetails; ++index) {
    Detail detail;
    if (!FindDetail(*character, index, &detail)) continue;
    const double cost = MeanCost(*character, detail), saved = character->share - cost;
    if (!(saved > 0)) continue;
    character->next = index;
    character->next_share = cost;
    character->worth = static_cast<double>(character->importance) * (kHarm[index] - kHarm[character->detail]) / saved;
    return true;
  }
  return false;
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

DrawingCosts ChooseDetails(Scene* scene, double room) {
  SceneCharacter* const all = scene->characters;
  // The least harm per microsecond comes out first.
  const auto by_harm = [all](uint32_t a, uint32_t b) {
    return all[a].worth != all[b].worth ? all[a].worth > all[b].worth : a < b;
  };
  double sum = 0;
  uint32_t count = 0;
  for (uint32_t i = 0; i < scene->count; ++i) {
    SceneCharacter& character = all[i];
    if (character.cloth == nullptr) continue;
    character.held_detail = character.detail;
    character.detail = kFull;
    Detail detail;
    FindDetail(character, kFull, &detail);
    character.share = MeanCost(character, detail);
    sum += character.share;
    if (FindLowering(&character)) scene->order[count++] = i;
  }
  std::make_heap(scene->order, scene->order + count, by_harm);
  while (count > 0) {
    std::pop_heap(scene->order, scene->order + count, by_harm);
    SceneCharacter& character = all[scene->order[count - 1]];
    const bool held = character.held_detail >= character.next;
    if (sum <= (held ? kFinerRoom : 1) * room) break;
    sum += character.next_share - character.share;
    character.detail = character.next;
    character.share = character.next_share;
    if (FindLowering(&character)) {
      std::push_heap(scene->order, scene->order + count, by_harm);
    } else {
      --count;
    }
  }
  double mean = 0, dearest = 0;
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

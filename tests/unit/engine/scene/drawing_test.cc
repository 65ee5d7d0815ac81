// What is drawn of fifty characters where drawing all of each would take more than the budget.
#include "engine/src/scene/drawing.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <random>
#include <vector>

#include "tests/unit/engine/scene/scene_fixture.h"

namespace dcloth::testing {
namespace {

constexpr float kSeconds = 1 / 60.0f;
constexpr std::array<float, DCLOTH_DRAW_COUNT> kDrawing = {4, 50, 80, 100, 0};  // microseconds, by DCLOTH_DRAW_*
constexpr uint32_t kMostUndrawnAsked = 3;
constexpr float kLeast = kCharacters * (4 + 46 / 4.0f);  // the coarse mesh in every fourth frame

class DrawingTest : public SceneTest {
 protected:
  // The first matters most, as the nearest of a crowd does.
  DrawingTest() {
    for (uint32_t i = 0; i < kCharacters; ++i)
      EXPECT_EQ(SetDrawn(i, 1.0f / static_cast<float>((1 + i) * (1 + i))), DCLOTH_OK);
  }

  dcloth_status SetDrawn(uint32_t index, float importance) {
    dcloth_scene_character character = Character(index, importance);
    character.draw_microseconds = kDrawing[DCLOTH_DRAW_FULL];
    character.positions_microseconds = kDrawing[DCLOTH_DRAW_POSITIONS];
    character.coarse_microseconds = kDrawing[DCLOTH_DRAW_COARSE];
    character.undrawn_microseconds = kDrawing[DCLOTH_DRAW_NONE];
    character.most_undrawn = kMostUndrawnAsked;
    return dcloth_scene_set(scene_, index, &character);
  }

  // What the frame costs, priced from what is drawn and ticked.
  double UpdateAll(double time) {
    double cost = 0;
    for (uint32_t i = 0; i < kCharacters; ++i) {
      cost += Run(i, PoseAt(model_.numbers, time + i), kSeconds).microseconds - static_cast<double>(kDraw) +
              static_cast<double>(kDrawing[Choice(i).draw]);
    }
    return cost;
  }
};

TEST_F(DrawingTest, AmpleBudgetDrawsEverything) {
  for (int frame = 0; frame < 60; ++frame) {
    Plan(kSeconds, 60000);
    UpdateAll(frame / 60.0);
    for (uint32_t i = 0; i < kCharacters; ++i) ASSERT_EQ(Choice(i).draw, static_cast<uint32_t>(DCLOTH_DRAW_FULL)) << i;
  }
}

// A host that gives no costs of less drawing draws everything, whatever the budget.
TEST_F(DrawingTest, NothingIsLeftOutUnlessOffered) {
  for (uint32_t i = 0; i < kCharacters; ++i) ASSERT_EQ(Set(i, 1), DCLOTH_OK);
  EXPECT_EQ(Plan(kSeconds, 500), kCharacters * kDraw);
  for (uint32_t i = 0; i < kCharacters; ++i) EXPECT_EQ(Choice(i).draw, static_cast<uint32_t>(DCLOTH_DRAW_FULL));
}

// Whatever the budget from the least drawing upwards: never over, the nearest is drawn in every frame, and ticks have
// their part. Those that matter more are never drawn in fewer frames than those that matter less.
TEST_F(DrawingTest, KeepsEveryBudgetByImportance) {
  for (const float budget : {2 * kLeast, 2000.0f, 2600.0f, 4000.0f, 6000.0f, 9000.0f, 14000.0f}) {
    std::array<std::array<int, DCLOTH_DRAW_COUNT>, kCharacters> seen = {};
    int frozen = 0;
    for (int frame = 0; frame < 400; ++frame) {
      const float planned = Plan(kSeconds, budget);
      ASSERT_LE(planned, budget * 1.0001f) << budget << " frame " << frame;
      ASSERT_NEAR(UpdateAll(frame / 60.0), static_cast<double>(planned), 1e-3 * static_cast<double>(planned)) << frame;
      if (frame < 80) continue;
      for (uint32_t i = 0; i < kCharacters; ++i) {
        ++seen[i][Choice(i).draw];
        frozen += Choice(i).level == DCLOTH_LEVEL_FROZEN ? 1 : 0;
      }
    }
    for (uint32_t i = 1; i < kCharacters; ++i) {
      EXPECT_LE(seen[i - 1][DCLOTH_DRAW_NONE], seen[i][DCLOTH_DRAW_NONE] + 1) << budget << " character " << i;
      EXPECT_GE(seen[i - 1][DCLOTH_DRAW_FULL] + 1, seen[i][DCLOTH_DRAW_FULL]) << budget << " character " << i;
    }
    std::printf("%6.0f us: the nearest drawn fully in %d of 320 frames, the farthest coarsely in %d; %.1f frozen\n",
                static_cast<double>(budget), seen[0][DCLOTH_DRAW_FULL], seen[kCharacters - 1][DCLOTH_DRAW_COARSE],
                frozen / 320.0);
    EXPECT_EQ(seen[0][DCLOTH_DRAW_FULL] + seen[0][DCLOTH_DRAW_POSITIONS], 320) << budget;
    EXPECT_LT(frozen, budget < 2000 ? 320 * 25 : 1) << "drawing leaves too little to ticks";
  }
}

// Nobody goes undrawn for longer than asked, but for one frame where shares fall unevenly; normals are at most one
// frame old, and are of the mesh that is drawn.
TEST_F(DrawingTest, ChangesOfDetailComeInTime) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> importance(0.01f, 1);
  std::vector<uint32_t> undrawn(kCharacters), before(kCharacters, DCLOTH_DRAW_NONE);
  float budget = 0;
  for (int frame = 0; frame < 3000; ++frame) {
    if (frame % 100 == 0) budget = std::array<float, 5>{2 * kLeast, 4000, 2000, 12000, 3000}[frame / 100 % 5];
    ASSERT_EQ(dcloth_scene_set_importance(scene_, random() % kCharacters, importance(random)), DCLOTH_OK);
    ASSERT_LE(Plan(kSeconds, budget), budget * 1.0001f) << frame;
    for (uint32_t i = 0; i < kCharacters; ++i) {
      const uint32_t draw = Choice(i).draw;
      undrawn[i] = draw == DCLOTH_DRAW_NONE ? undrawn[i] + 1 : 0;
      ASSERT_LE(undrawn[i], kMostUndrawnAsked + 1) << "character " << i << " frame " << frame;
      if (draw == DCLOTH_DRAW_POSITIONS) {
        ASSERT_EQ(before[i], static_cast<uint32_t>(DCLOTH_DRAW_FULL)) << "character " << i << " frame " << frame;
      }
      before[i] = draw;
    }
    UpdateAll(frame / 60.0);
  }
}

// Contact costs ten times what all else does: the nearest get it, nobody loses drawing or ticks for it that is worth
// more, and what is left of the budget is spent.
TEST_F(DrawingTest, ContactIsForTheNearest) {
  constexpr float kContact = 1000;
  for (uint32_t i = 0; i < kCharacters; ++i) {
    dcloth_scene_character character = Character(i, 1.0f / static_cast<float>((1 + i) * (1 + i)));
    character.draw_microseconds = kContact;
    character.plain_microseconds = kDrawing[DCLOTH_DRAW_FULL];
    character.coarse_microseconds = kDrawing[DCLOTH_DRAW_COARSE];
    character.undrawn_microseconds = kDrawing[DCLOTH_DRAW_NONE];
    character.most_undrawn = kMostUndrawnAsked;
    ASSERT_EQ(dcloth_scene_set(scene_, i, &character), DCLOTH_OK);
  }
  uint32_t before = 0;
  for (const float budget : {2000.0f, 6000.0f, 12000.0f, 16000.0f, 30000.0f}) {
    std::array<uint32_t, DCLOTH_DRAW_COUNT> drawn = {};
    for (int frame = 0; frame < 100; ++frame) {
      ASSERT_LE(Plan(kSeconds, budget), budget * 1.0001f);
      for (uint32_t i = 0; i < kCharacters; ++i) Run(i, PoseAt(model_.numbers, frame / 60.0 + i), kSeconds);
    }
    uint32_t nearest = 0;
    while (nearest < kCharacters && Choice(nearest).draw == DCLOTH_DRAW_FULL) ++nearest;
    for (uint32_t i = 0; i < kCharacters; ++i) {
      ++drawn[Choice(i).draw];
      EXPECT_TRUE(budget == 2000 || Choice(i).level != DCLOTH_LEVEL_FROZEN) << budget << " character " << i;
    }
    std::printf("%6.0f us: %u with contact, %u without, %u coarse\n", static_cast<double>(budget),
                drawn[DCLOTH_DRAW_FULL], drawn[DCLOTH_DRAW_PLAIN], drawn[DCLOTH_DRAW_COARSE]);
    EXPECT_EQ(nearest, drawn[DCLOTH_DRAW_FULL]) << budget;
    EXPECT_GE(nearest, before);
    before = nearest;
  }
  EXPECT_GE(before, 4u);
}

// Searches for a plan that costs more than a budget which covers the least drawing of all and the dearest coarse mesh
// beside it: costs, importances and budgets at random, few characters above all.
TEST_F(DrawingTest, NoPlanCostsMoreThanItsBudget) {
  std::mt19937 random(11);
  const auto draw = [&](float low, float high) { return std::uniform_real_distribution<float>(low, high)(random); };
  float worst = 0;
  for (int round = 0; round < 300; ++round) {
    const uint32_t count = 1 + random() % (round % 3 == 0 ? kCharacters : 4);
    float least = 0, dearest = 0;
    for (uint32_t i = 0; i < kCharacters; ++i) ASSERT_EQ(dcloth_scene_set(scene_, i, nullptr), DCLOTH_OK);
    for (uint32_t i = 0; i < count; ++i) {
      dcloth_scene_character character = Character(i, draw(0, 1));
      character.undrawn_microseconds = draw(0, 5);
      character.coarse_microseconds = draw(10, 100);
      character.plain_microseconds = character.coarse_microseconds + draw(0, 100);
      character.positions_microseconds = character.plain_microseconds + draw(0, 500);
      character.draw_microseconds = character.positions_microseconds + draw(0, 100);
      character.most_undrawn = random() % 16;
      ASSERT_EQ(dcloth_scene_set(scene_, i, &character), DCLOTH_OK);
      least += character.undrawn_microseconds + (character.coarse_microseconds - character.undrawn_microseconds) /
                                                    static_cast<float>(character.most_undrawn + 1);
      dearest = std::max(dearest, character.coarse_microseconds);
    }
    for (int frame = 0; frame < 60; ++frame) {
      const float budget = (least + dearest) * draw(1, 4);
      const float planned = Plan(kSeconds, budget);
      worst = std::max(worst, planned / budget);
      ASSERT_LE(planned, budget * 1.0001f) << "round " << round << ", frame " << frame << ", " << count;
      for (uint32_t i = 0; i < count; ++i) Run(i, PoseAt(model_.numbers, frame / 60.0 + i), kSeconds);
    }
  }
  std::printf("dearest plan: %.3f of its budget\n", static_cast<double>(worst));
}

// Steady inputs: nobody changes between meshes, and normals come in every second frame.
TEST_F(DrawingTest, DetailsStay) {
  std::vector<uint32_t> last(kCharacters);
  int changes = 0;
  for (int frame = 0; frame < 600; ++frame) {
    Plan(kSeconds, 4500);
    UpdateAll(frame / 60.0);
    for (uint32_t i = 0; i < kCharacters; ++i) {
      const uint32_t draw = Choice(i).draw;
      if (draw == DCLOTH_DRAW_NONE) continue;
      const uint32_t mesh = draw == DCLOTH_DRAW_COARSE ? DCLOTH_DRAW_COARSE : DCLOTH_DRAW_FULL;
      if (frame > 30 && mesh != last[i]) ++changes;
      last[i] = mesh;
    }
  }
  EXPECT_EQ(changes, 0);
}

}  // namespace
}  // namespace dcloth::testing

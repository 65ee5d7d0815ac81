// What a fit may cost, whatever skin it is given: the work is counted and ends with its budget, nothing that takes time
// goes uncounted, and a hero's skin passes.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <iostream>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "fit/make_fit.h"
#include "tests/attack/corruption.h"
#include "tests/unit/engine/cloth_fixture.h"
#include "tests/unit/engine/figure.h"
#include "tests/unit/engine/joint_matrices.h"
#include "tests/unit/engine/test_body.h"

namespace dcloth::testing {
namespace {

constexpr uint64_t kSmallBudget = uint64_t{1} << 24;
// A unit of work takes 2 to 4 ns, under another load as long again. What goes uncounted shows as a multiple of that.
constexpr double kMostSecondsPerUnit = 4e-8;

struct Skin {
  std::vector<float> positions, weights;
  std::vector<uint32_t> joints, triangles;
  uint32_t influences = 1;

  uint32_t Add(double x, double y, double z) {
    for (const double value : {x, y, z}) positions.push_back(static_cast<float>(value));
    for (uint32_t k = 0; k < influences; ++k) {
      joints.push_back(0);
      weights.push_back(1);
    }
    return static_cast<uint32_t>(positions.size() / 3 - 1);
  }
};

class FitCostTest : public ::testing::Test {
 protected:
  // `gather` lays garment and body into one cell of the search.
  explicit FitCostTest(uint32_t rings = 6, uint32_t segments = 10, uint32_t body_rings = 14, bool gather = false)
      : model_([&] {
          ModelSpec spec;
          spec.skeleton_joints = Figure();
          spec.joints = spec.bones = static_cast<uint32_t>(spec.skeleton_joints.size());
          spec.rings = rings;
          spec.segments = segments;
          spec.skeleton = spec.mesh = false;
          TestModel model = BuildModel(spec);
          egg_ = AddBody(&model, body_rings, 20);
          format::ModelT* const m = model.tables.get();
          for (const auto* tensor : {&m->garment->template_positions, &m->body->positions}) {
            for (size_t i = 0; gather && i < 3 * size_t{(*tensor)->shape[0]}; ++i) {
              float* const at = Data<float>(m, **tensor, i);
              *at = 0.05f * *at + (i % 3 == 1 ? 0.9f : 0.03f);
            }
          }
          return model;
        }()),
        opened_(model_),
        cloth_(opened_) {
    for (const NamedJoint& joint : Figure()) joint_names_.push_back(joint.first);
    for (const std::string& name : joint_names_) names_.push_back(name.c_str());
  }

  dcloth_character Wearing(const Skin& skin) const {
    dcloth_character character = {};
    character.struct_size = sizeof(character);
    character.joint_count = static_cast<uint32_t>(names_.size());
    character.joint_names = names_.data();
    character.bind_matrices = bind_.data();
    character.body_vertex_count = static_cast<uint32_t>(skin.positions.size() / 3);
    character.body_positions = skin.positions.data();
    character.body_joints = skin.joints.data();
    character.body_weights = skin.weights.data();
    character.body_influences = skin.influences;
    character.body_triangles = skin.triangles.empty() ? nullptr : skin.triangles.data();
    character.body_triangle_count = static_cast<uint32_t>(skin.triangles.size() / 3);
    return character;
  }

  struct Outcome {
    dcloth_status status;
    std::string text;
    uint64_t work;
    double seconds;  // of the processor
  };

  Outcome Fit(const Skin& skin, uint64_t budget) {
    const dcloth_character character = Wearing(skin);
    const size_t size = dcloth_fit_storage_size(opened_.get(), &character);
    if (storage_.size() != size) storage_ = AlignedBytes(size);
    dcloth_error error = EmptyError();
    dcloth_fit report = {};
    format::Diagnostic diagnostic(&error);
    uint64_t left = budget;
    const std::clock_t begin = std::clock();
    fit::MakeFit(*reinterpret_cast<const format::ModelView*>(opened_.get()), engine::Space(), character,
                 storage_.data(), size, &left, &report, &diagnostic);
    const double seconds = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
    if (diagnostic.status() == DCLOTH_OK) {
      EXPECT_EQ(dcloth_cloth_set_fit(cloth_.get(), storage_.data(), report.file_bytes, &error), DCLOTH_OK)
          << error.text;
    }
    return {diagnostic.status(), error.text, budget - left, seconds};
  }

  // The figure's own skin, wider by `girth`, each triangle cut into `cuts` squared.
  Skin OwnSkin(uint32_t cuts, double girth) const {
    Skin skin;
    for (size_t f = 0; f < egg_.faces.size(); f += 3) {
      std::vector<uint32_t> row, above;
      for (uint32_t i = 0; i <= cuts; ++i, above = row) {
        row.clear();
        for (uint32_t j = 0; j <= i; ++j) {
          double at[3];
          for (size_t c = 0; c < 3; ++c) {
            const auto corner = [&](size_t k) {
              return static_cast<double>(egg_.positions[size_t{3} * egg_.faces[f + k] + c]);
            };
            at[c] = ((cuts - i) * corner(0) + (i - j) * corner(1) + j * corner(2)) / cuts;
          }
          row.push_back(skin.Add(girth * at[0], at[1], girth * at[2]));
        }
        for (uint32_t j = 0; j < i; ++j) {
          skin.triangles.insert(skin.triangles.end(), {above[j], row[j], row[j + 1]});
          if (j + 1 < i) skin.triangles.insert(skin.triangles.end(), {above[j], row[j + 1], above[j + 1]});
        }
      }
    }
    return skin;
  }

  // The same egg in triangles of less than a centimetre.
  static Skin FineSkin(uint32_t rings) {
    Skin skin;
    for (uint32_t r = 0; r <= rings; ++r) {
      for (uint32_t s = 0; s < rings; ++s) {
        const double down = std::numbers::pi * r / rings, turn = 2 * std::numbers::pi * s / rings;
        skin.Add(0.3 * std::sin(down) * std::cos(turn), 0.6 + 0.45 * std::cos(down),
                 0.26 * std::sin(down) * std::sin(turn));
        if (r == rings) continue;
        const uint32_t a = r * rings + s, b = r * rings + (s + 1) % rings;
        skin.triangles.insert(skin.triangles.end(), {a, b, b + rings, a, b + rings, a + rings});
      }
    }
    return skin;
  }

  EggBody egg_;
  TestModel model_;
  OpenedModel opened_;
  OwnedCloth cloth_;
  std::vector<std::string> joint_names_;
  std::vector<const char*> names_;
  std::vector<float> bind_ = BindMatrices(model_.numbers, Figure().size());
  AlignedBytes storage_;
};

// A skin by numbers: how many triangles, how long and how wide, how far apart they lie, and the joints of each corner.
struct Recipe {
  const char* name;
  uint32_t triangles;
  double length, width, spread;
  uint32_t influences = 1;
  bool points = false;  // without triangles
};

Skin Make(const Recipe& recipe, uint32_t seed) {
  std::mt19937 random(seed);
  const auto within = [&](double most) { return std::uniform_real_distribution<double>(-most, most)(random); };
  Skin skin;
  skin.influences = recipe.influences;
  for (uint32_t t = 0; t < recipe.triangles; ++t) {
    const double x = within(recipe.spread), y = 0.9 + within(recipe.spread), z = within(recipe.spread);
    const double turn = within(3.2), c = std::cos(turn), s = std::sin(turn);
    const uint32_t first = skin.Add(x, y, z);
    skin.Add(x + recipe.length * c, y + within(recipe.width), z + recipe.length * s);
    skin.Add(x - recipe.width * s, y + within(recipe.width), z + recipe.width * c);
    if (!recipe.points) skin.triangles.insert(skin.triangles.end(), {first, first + 1, first + 2});
  }
  return skin;
}

const Recipe kRecipes[] = {{"few of a metre", 100, 1, 1, 0.3},
                           {"of a hundred metres", 100, 100, 100, 0.3},
                           {"slivers", 20000, 1, 1e-6, 0.3},
                           {"without an area", 20000, 0, 0, 0.3},
                           {"tiny ones", 100000, 1e-3, 1e-3, 0.3},
                           {"all at one place", 20000, 1e-3, 1e-3, 1e-3},
                           {"shells over shells", 20000, 0.05, 0.05, 0.1},
                           {"far away", 100000, 0.05, 0.05, 0.01},
                           {"sixteen joints a corner", 50000, 0.01, 0.01, 0.3, 16},
                           {"points alone", 100000, 0.1, 0.1, 0.2, 1, true},
                           {"points of sixteen joints", 50000, 0.1, 0.1, 0.2, 16, true}};

class DenseFitCostTest : public FitCostTest {
 protected:
  DenseFitCostTest() : FitCostTest(255, 257, 400, true) {}  // 65,535 vertices of garment and 8,002 of body
};

class PersonFitCostTest : public FitCostTest {
 protected:
  PersonFitCostTest() : FitCostTest(100, 100, 400) {}  // as many vertices as a large garment and body have
};

template <typename Fit>
void ExpectCounted(Fit fit) {
  double worst = 0;
  std::string worst_name;
  for (const Recipe& recipe : kRecipes) {
    // A step downhill from each: more, larger, closer.
    for (const double more : {1.0, 3.0}) {
      for (const double larger : {1.0, 0.2, 5.0}) {
        Recipe changed = recipe;
        changed.triangles = static_cast<uint32_t>(more * recipe.triangles);
        changed.length *= larger, changed.width *= larger, changed.spread /= larger;
        const auto outcome = fit(Make(changed, 5));
        const std::string name = std::string(recipe.name) + ", " + std::to_string(more) + ", " + std::to_string(larger);
        EXPECT_LE(outcome.work, kSmallBudget) << name;
        EXPECT_EQ(outcome.status, outcome.work == kSmallBudget ? DCLOTH_ERROR_ARGUMENT : DCLOTH_OK)
            << name << ": " << outcome.text;
        const double unit = outcome.seconds / static_cast<double>(std::max(outcome.work, kSmallBudget / 4));
        if (unit > worst) worst = unit, worst_name = name;
      }
    }
  }
  std::cout << "dearest unit of work: " << 1e9 * worst << " ns, " << worst_name << '\n';
  EXPECT_LE(worst, kMostSecondsPerUnit) << worst_name;
}

TEST_F(FitCostTest, NoSkinTakesTimeThatIsNotCounted) {
  ExpectCounted([&](const Skin& skin) { return Fit(skin, kSmallBudget); });
}

TEST_F(DenseFitCostTest, NorDoesOneBesideAGarmentInOnePlace) {
  ExpectCounted([&](const Skin& skin) { return Fit(skin, kSmallBudget); });
}

TEST_F(PersonFitCostTest, AHeroOfAHundredThousandTrianglesIsFitted) {
  const Skin skin = FineSkin(230);
  ASSERT_GT(skin.triangles.size() / 3, 100000u);
  const Outcome outcome = Fit(skin, fit::kFitWork);
  std::cout << skin.triangles.size() / 3 << " triangles: " << outcome.work << " of " << fit::kFitWork
            << " units of work, " << outcome.seconds << " s\n";
  EXPECT_EQ(outcome.status, DCLOTH_OK) << outcome.text;
  EXPECT_LE(outcome.work, fit::kFitWork / 4 * 3);  // heroes of more triangles fit too
}

// Into the same memory as the fit before, which the cloth wears on.
TEST_F(FitCostTest, RefusedItSaysWhatToDoAndLeavesTheFitBefore) {
  const Skin own = OwnSkin(1, 1.15);
  ASSERT_EQ(Fit(own, fit::kFitWork).status, DCLOTH_OK);
  const auto drawn = [&] {
    std::vector<float> positions(3 * model_.numbers.n);
    dcloth_output output = FloatOutput(model_.numbers.n, positions.data(), 12, nullptr);
    output.flags = DCLOTH_OUTPUT_OUTSIDE_BODY;
    const dcloth_pose pose = OwnedCloth::Pose(bind_);
    EXPECT_EQ(dcloth_cloth_reset(cloth_.get()), DCLOTH_OK);
    EXPECT_EQ(dcloth_cloth_tick(cloth_.get(), &pose, DCLOTH_STAGES_STATIC, nullptr), DCLOTH_OK);
    EXPECT_EQ(dcloth_cloth_skin(cloth_.get(), &pose, 1, &output, nullptr), DCLOTH_OK);
    return positions;
  };
  const std::vector<float> before = drawn();
  for (const bool points : {false, true}) {
    const Skin wide = Make({"wide", 900, 1, 1, 0.3, 1, points}, 3);
    for (const uint64_t budget : {uint64_t{1}, uint64_t{1} << 12, uint64_t{1} << 20, uint64_t{1} << 21}) {
      const Outcome outcome = Fit(wide, budget);
      if (points && outcome.status == DCLOTH_OK) continue;
      ASSERT_EQ(outcome.status, DCLOTH_ERROR_ARGUMENT) << budget;
      EXPECT_EQ(outcome.text.find(points ? "character.body_vertex_count: found 2700"
                                         : "character.body_triangle_count: "
                                           "found 900"),
                0u)
          << outcome.text;
      EXPECT_NE(outcome.text.find("; allowed: what 100,000 triangles of a person's skin take; reduce the mesh"),
                std::string::npos)
          << outcome.text;
      EXPECT_EQ(drawn(), before) << budget;
    }
    Fit(own, fit::kFitWork);
  }
}

}  // namespace
}  // namespace dcloth::testing

// Poses that no character takes. Numbers that are none are refused without a trace; everything else is
// defined: vertices are finite, normals are unit vectors, recurrent state stays within its bounds, and a
// reset forgets all of it.
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <random>

#include "engine/src/cloth.h"
#include "tests/attack/variants.h"
#include "tests/unit/engine/cloth_fixture.h"

namespace dcloth::testing {
namespace {

constexpr float kLargest = 1e9f;  // the header's limit of a pose's numbers

using Matrices = std::vector<float>;

float* Joint(Matrices* pose, size_t joint) { return pose->data() + 16 * joint; }
size_t Joints(const Matrices& pose) { return pose.size() / 16; }

struct PoseAttack {
  const char* name;
  std::function<void(Matrices*, std::mt19937*)> spoil;
};

// Multiplies columns 0 to 2 of every joint's rotation.
void Scale(Matrices* pose, float x, float y, float z) {
  const float factors[3] = {x, y, z};
  for (size_t j = 0; j < Joints(*pose); ++j) {
    for (size_t e = 0; e < 12; ++e) {
      if (e % 4 < 3) Joint(pose, j)[e] *= factors[e % 4];
    }
  }
}

std::vector<PoseAttack> PoseAttacks() {
  using R = std::mt19937;
  return {
      {"zero", [](Matrices* p, R*) { std::fill(p->begin(), p->end(), 0.0f); }},
      {"minus_zero", [](Matrices* p, R*) { std::fill(p->begin(), p->end(), -0.0f); }},
      {"largest", [](Matrices* p, R*) { std::fill(p->begin(), p->end(), kLargest); }},
      {"largest_of_both_signs",
       [](Matrices* p, R* random) {
         for (float& x : *p) x = (*random)() % 2 == 0 ? kLargest : -kLargest;
       }},
      {"subnormal", [](Matrices* p, R*) { std::fill(p->begin(), p->end(), 1e-42f); }},
      {"flat", [](Matrices* p, R*) { Scale(p, 1, 0, 1); }},
      {"needle", [](Matrices* p, R*) { Scale(p, 0, 1, 0); }},
      {"nearly_flat", [](Matrices* p, R*) { Scale(p, 1, 1e-30f, 1); }},
      {"reflected", [](Matrices* p, R*) { Scale(p, -1, 1, 1); }},
      {"turned_inside_out", [](Matrices* p, R*) { Scale(p, -1, -1, -1); }},
      {"giant", [](Matrices* p, R*) { Scale(p, 1e8f, 1e8f, 1e8f); }},
      {"sheared",
       [](Matrices* p, R*) {
         for (size_t j = 0; j < Joints(*p); ++j) Joint(p, j)[1] += 1000;
       }},
      {"transposed",
       [](Matrices* p, R*) {
         for (size_t j = 0; j < Joints(*p); ++j) {
           for (size_t r = 0; r < 4; ++r) {
             for (size_t c = 0; c < r; ++c) std::swap(Joint(p, j)[4 * r + c], Joint(p, j)[4 * c + r]);
           }
         }
       }},
      {"last_row_of_anything",
       [](Matrices* p, R*) {
         for (size_t j = 0; j < Joints(*p); ++j) std::fill_n(Joint(p, j) + 12, 4, -kLargest);
       }},
      {"far_away",
       [](Matrices* p, R*) {
         for (size_t j = 0; j < Joints(*p); ++j) Joint(p, j)[3] = Joint(p, j)[11] = kLargest;
       }},
      {"torn_apart",
       [](Matrices* p, R*) {
         for (size_t j = 0; j < Joints(*p); ++j) Joint(p, j)[3] = j % 2 == 0 ? kLargest : -kLargest;
       }},
      {"joints_unordered",
       [](Matrices* p, R* random) {
         for (size_t j = Joints(*p) - 1; j > 0; --j) {
           std::swap_ranges(Joint(p, j), Joint(p, j) + 16, Joint(p, (*random)() % j));
         }
       }},
      {"all_joints_the_same",
       [](Matrices* p, R*) {
         for (size_t j = 1; j < Joints(*p); ++j) std::copy_n(Joint(p, 0), 16, Joint(p, j));
       }},
      {"any_numbers",
       [](Matrices* p, R* random) {
         for (float& x : *p) {
           const auto bits = static_cast<uint32_t>((*random)());
           std::memcpy(&x, &bits, sizeof(x));
           if (!(std::abs(x) <= kLargest)) x = 1;
         }
       }},
  };
}

class PoseTest : public ::testing::TestWithParam<Variant> {
 protected:
  Matrices Sound(int tick) const { return PoseAt(model_.numbers, tick / 30.0); }
  uint32_t stages() const { return opened_.info().stages; }

  // h' = (1 - z) h + z g with |g| <= 1 never leaves [-1, 1] by more than its roundings, whatever the pose.
  void ExpectBoundedState(OwnedCloth* cloth, const std::string& where) const {
    const auto* inside = reinterpret_cast<const engine::Cloth*>(cloth->get());
    const auto bounded = [](float h) { return std::abs(h) <= 1 + 0x1p-20f; };
    const ModelSpec& spec = model_.numbers.spec;
    if (spec.skeleton) {
      EXPECT_TRUE(std::all_of(inside->coefficients, inside->coefficients + spec.units, bounded)) << where;
    }
    if (spec.skeleton && spec.mesh) {
      const size_t count = spec.layers * kernels::GsgruStateFloats(model_.numbers.n, spec.feature_width);
      EXPECT_TRUE(std::all_of(inside->mesh.state, inside->mesh.state + count, bounded)) << where;
    }
    if (spec.patches != 0) {
      const float* h = inside->patches.hidden;
      EXPECT_TRUE(std::all_of(h, h + size_t{spec.patches} * spec.patch_width, bounded)) << where;
      const float* cloth_floats = inside->patches.cloth;
      const size_t count = engine::PatchClothFloats(inside->model->patch_stage);
      EXPECT_TRUE(std::all_of(cloth_floats, cloth_floats + count, [](float x) { return std::isfinite(x); })) << where;
    }
  }
  void ExpectSoundFrame(OwnedCloth* cloth, const Matrices& pose, const std::string& where) const {
    ASSERT_EQ(cloth->Skin(pose, 0.5f), DCLOTH_OK) << where;
    for (const float x : cloth->positions()) ASSERT_TRUE(std::isfinite(x)) << where;
    const std::vector<float>& n = cloth->normals();
    for (size_t i = 0; i < n.size(); i += 3) {
      // Square root, division and three products round: a few units in the last place.
      const double square = static_cast<double>(n[i]) * static_cast<double>(n[i]) +
                            static_cast<double>(n[i + 1]) * static_cast<double>(n[i + 1]) +
                            static_cast<double>(n[i + 2]) * static_cast<double>(n[i + 2]);
      ASSERT_NEAR(square, 1, 20 * 0x1p-24) << where << ", normal " << i / 3;
    }
  }

  TestModel model_ = BuildModel(GetParam().spec);
  OpenedModel opened_{model_};
};

TEST_P(PoseTest, EveryAttackIsDefinedAndForgotten) {
  std::mt19937 random(5);
  for (const std::string& isa : UsableIsas()) {
    ASSERT_EQ(dcloth_isa_select(isa.c_str()), DCLOTH_OK);
    for (const PoseAttack& attack : PoseAttacks()) {
      const std::string where = isa + ", " + attack.name;
      OwnedCloth attacked(opened_), fresh(opened_);
      for (int tick = 0; tick < 6; ++tick) {
        Matrices pose = Sound(tick);
        if (tick % 2 == 1) attack.spoil(&pose, &random);
        ASSERT_EQ(attacked.Tick(pose, stages()), DCLOTH_OK) << where;
        ExpectSoundFrame(&attacked, pose, where);
        ExpectBoundedState(&attacked, where);
      }
      ExpectSoundFrame(&attacked, Sound(6), where + ", then a sound pose");
      ASSERT_EQ(dcloth_cloth_reset(attacked.get()), DCLOTH_OK);
      for (int tick = 0; tick < 3; ++tick) {
        for (OwnedCloth* cloth : {&attacked, &fresh}) {
          ASSERT_EQ(cloth->Tick(Sound(tick), stages()), DCLOTH_OK);
          ASSERT_EQ(cloth->Skin(Sound(tick), 1), DCLOTH_OK);
        }
        ASSERT_EQ(attacked.positions(), fresh.positions()) << where;
        ASSERT_EQ(attacked.normals(), fresh.normals()) << where;
      }
    }
  }
  dcloth_isa_select(nullptr);
}

// A thousand ticks of all attacks at random, one after another, without a reset.
TEST_P(PoseTest, StateIsNeverPoisoned) {
  std::mt19937 random(23);
  const std::vector<PoseAttack> attacks = PoseAttacks();
  OwnedCloth cloth(opened_);
  for (int tick = 0; tick < 1000; ++tick) {
    Matrices pose = Sound(tick);
    const PoseAttack& attack = attacks[random() % attacks.size()];
    attack.spoil(&pose, &random);
    ASSERT_EQ(cloth.Tick(pose, stages()), DCLOTH_OK) << attack.name;
    ExpectBoundedState(&cloth, attack.name);
    if (tick % 10 == 0) ExpectSoundFrame(&cloth, pose, attack.name);
  }
}

// Each number of a pose in turn, each kind of number that is none, the least beyond the limit: refused,
// nothing written, and what follows is what follows without.
TEST_P(PoseTest, NumbersThatAreNoneAreRefusedWithoutTrace) {
  using Limits = std::numeric_limits<float>;
  const float none[] = {Limits::quiet_NaN(),
                        Limits::signaling_NaN(),
                        -Limits::quiet_NaN(),
                        Limits::infinity(),
                        -Limits::infinity(),
                        std::nextafter(kLargest, 2e9f),
                        -std::nextafter(kLargest, 2e9f),
                        Limits::max(),
                        Limits::lowest()};
  OwnedCloth disturbed(opened_), twin(opened_);
  size_t refused = 0;
  for (int tick = 0; tick < 3; ++tick) {
    const Matrices sound = Sound(tick);
    const std::vector<float> before = disturbed.positions();
    for (size_t i = 0; i < sound.size(); ++i) {
      for (const float bad : none) {
        Matrices pose = sound;
        std::memcpy(&pose[i], &bad, sizeof(bad));
        ASSERT_EQ(disturbed.Tick(pose, stages()), DCLOTH_ERROR_POSE) << i << ", " << bad;
        ASSERT_EQ(disturbed.Skin(pose, 1), DCLOTH_ERROR_POSE) << i << ", " << bad;
        ++refused;
      }
    }
    ASSERT_EQ(disturbed.positions(), before);
    for (OwnedCloth* cloth : {&disturbed, &twin}) {
      ASSERT_EQ(cloth->Tick(sound, stages()), DCLOTH_OK);
      ASSERT_EQ(cloth->Skin(sound, 1), DCLOTH_OK);
    }
    ASSERT_EQ(disturbed.positions(), twin.positions());
  }
  EXPECT_EQ(refused, 3u * 9 * Sound(0).size());
}

// Weights may be no numbers: vertices are none either, and a reset is all it takes.
TEST(PoisonedWeights, ReachVerticesAndNothingElse) {
  const Variant variant = Variants()[0];
  ASSERT_EQ(variant.spec.precision, format::DType_F32);
  TestModel model = BuildModel(variant.spec);
  const format::TensorT& basis = *model.tables->displacement->basis->weights;
  std::memset(model.tables->weights.data() + basis.offset, 0xFF, 64);
  const OpenedModel opened(model);
  ASSERT_EQ(opened.status(), DCLOTH_OK) << opened.error().text;
  OwnedCloth cloth(opened);
  const Matrices pose = PoseAt(model.numbers, 0);
  ASSERT_EQ(cloth.Tick(pose, DCLOTH_STAGES_MESH), DCLOTH_OK);
  ASSERT_EQ(cloth.Skin(pose, 1), DCLOTH_OK);
  EXPECT_TRUE(std::isnan(cloth.positions()[0]));
  for (const float x : cloth.normals()) EXPECT_FALSE(std::isnan(x));
  ASSERT_EQ(dcloth_cloth_reset(cloth.get()), DCLOTH_OK);
  ASSERT_EQ(cloth.Tick(pose, DCLOTH_STAGES_STATIC), DCLOTH_OK);
  ASSERT_EQ(cloth.Skin(pose, 1), DCLOTH_OK);
  for (const float x : cloth.positions()) EXPECT_TRUE(std::isfinite(x));
}

INSTANTIATE_TEST_SUITE_P(Every, PoseTest, ::testing::ValuesIn(Variants()),
                         [](const auto& test) { return test.param.name; });

}  // namespace
}  // namespace dcloth::testing

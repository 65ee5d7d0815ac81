// Cloth deep in a limb is laid over it.
#include "engine/src/body/deep_cloth.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include "tests/unit/engine/body/limbs.h"

namespace dcloth::testing {
namespace {

class DeepClothTest : public ThighAndSheet {};
class SleeveTest : public ArmInSleeve {};

float FromAxis(const std::vector<float>& sheet, size_t i) { return std::hypot(sheet[i], sheet[i + 2]); }

TEST_F(DeepClothTest, CoresAreTheFreeSpaceAroundBones) {
  ASSERT_EQ(*limbs_.count, 2u);
  for (const auto& slice : limbs_.cores[0].radii) {
    for (const float radius : slice) {
      EXPECT_TRUE(&slice == &limbs_.cores[0].radii[0] ? radius == 0 : std::fabs(radius - 0.9f * kThigh) < 1e-4f)
          << radius;
    }
  }
  model_.parents = nullptr;
  engine::MeasureLimbCores(model_, limbs_);
  EXPECT_EQ(*limbs_.count, 0u) << "a file without parents has none";
}

// In front of the axis, on it, and behind it up to where the sheet leaves the thigh again.
TEST_F(DeepClothTest, ASheetThroughTheThighComesToLieInFrontOfIt) {
  for (const float z : {0.06f, 0.03f, 0.0f, -0.03f, -0.05f}) {
    std::vector<float> sheet = SheetAt(0, z);
    const std::vector<float> before = sheet;
    Lay(&sheet);
    size_t moved = 0, rows = 0;
    for (size_t i = 0; i < sheet.size(); i += 3) {
      moved += std::memcmp(&before[i], &sheet[i], 12) != 0;
      // The core begins an eighth along the bone.
      if (sheet[i + 1] > -0.06f || std::fabs(sheet[i]) > 0.04f) continue;
      ++rows;
      EXPECT_GT(FromAxis(sheet, i), 0.9f * kThigh - 1e-4f) << z << " vertex " << i / 3;
      EXPECT_GT(sheet[i + 2], 0) << z << " vertex " << i / 3 << ": behind the thigh";
    }
    EXPECT_GT(rows, 100u);
    EXPECT_GT(moved, 200u) << z;
    EXPECT_LT(moved, sheet.size() / 3 - 100) << z << ": cloth beside the thigh stays";
  }
}

TEST_F(SleeveTest, CoresJoinWhereALimbBends) {
  ASSERT_EQ(*limbs_.count, 3u);
  const engine::LimbCore *upper = limbs_.cores, *fore = limbs_.cores + 1;
  EXPECT_EQ(upper->above, engine::kMostCores);
  EXPECT_EQ(fore->above, 0u);
  EXPECT_TRUE(upper->bends && fore->bends);
  EXPECT_GT(upper->cap, 0.5f * kArm);
  for (size_t k = 0; k < engine::kCoreSectors; ++k) {
    EXPECT_EQ(upper->radii[0][k], 0);
    EXPECT_FLOAT_EQ(fore->radii[0][k], std::fmin(upper->cap, fore->radii[1][k]));
  }
}

// A trunk is no limb: what lies on it is not measured as over a hinge.
TEST_F(SleeveTest, WideBonesDoNotBend) {
  for (size_t i = 0; i < body_.size(); i += 3) body_[i] *= 4, body_[i + 2] *= 4;
  engine::MeasureLimbCores(model_, limbs_);
  ASSERT_GT(*limbs_.count, 1u);
  for (uint32_t k = 0; k < *limbs_.count; ++k) {
    EXPECT_EQ(limbs_.cores[k].above, engine::kMostCores) << k;
    EXPECT_FALSE(limbs_.cores[k].bends) << k;
  }
}

// The arm has come out through the sleeve's side, all along it.
TEST_F(SleeveTest, ASleeveBesideItsArmComesToLieAroundIt) {
  for (const float angle : {0.0f, 0.8f, 1.4f}) {
    Bend(angle);
    std::vector<float> sleeve(bound_.size());
    for (size_t i = 0; i < bound_.size(); i += 3) {
      const float* matrix = matrices_.data() + (bound_[i + 1] > -kBone ? 0 : 12);
      for (size_t r = 0; r < 3; ++r) {
        sleeve[i + r] = matrix[4 * r + 3];
        for (size_t c = 0; c < 3; ++c) sleeve[i + r] += matrix[4 * r + c] * bound_[i + c];
      }
      sleeve[i] += 0.07f;
    }
    Lay(&sleeve);
    for (size_t i = 0; i < bound_.size(); i += 3) {
      float place[3];
      Unbend(i, &sleeve[i], place);
      const float height = (place[0] * bound_[i] + place[2] * bound_[i + 2]) / kSleeve;
      EXPECT_GT(height, 0) << "bent by " << angle << ", vertex " << i / 3 << " at " << bound_[i + 1];
      // 0.9 of it is core; in the crease of the elbow a vertex is near two of them.
      EXPECT_GT(std::hypot(place[0], place[2]), 0.85f * kArm) << angle << " vertex " << i / 3;
    }
  }
}

// As one does where the forearm is turned in it. Its near side lies in the arm.
TEST_F(SleeveTest, ASleeveTurnedAboutItsArmStaysOnItsSides) {
  constexpr float kAside = 0.035f;
  engine::FindSleeves(model_, limbs_, sleeves_);
  for (const float turn : {1.5f, 3.1f}) {
    std::vector<float> sleeve = bound_;
    for (size_t i = 0; i < sleeve.size(); i += 3) {
      sleeve[i] = std::cos(turn) * bound_[i] - std::sin(turn) * bound_[i + 2] + kAside;
      sleeve[i + 2] = std::sin(turn) * bound_[i] + std::cos(turn) * bound_[i + 2];
    }
    const std::vector<float> before = sleeve;
    Lay(&sleeve);
    size_t moved = 0;
    for (size_t i = 0; i < sleeve.size(); i += 3) {
      moved += std::memcmp(&sleeve[i], &before[i], 12) != 0;
      EXPECT_GT(FromAxis(sleeve, i), 0.85f * kArm) << turn << " vertex " << i / 3;
      EXPECT_LT(std::hypot(sleeve[i] - before[i], sleeve[i + 1] - before[i + 1], sleeve[i + 2] - before[i + 2]), kAside)
          << turn << " vertex " << i / 3;
    }
    EXPECT_GT(moved, 100u);
  }
}

// A wide armhole of an arm that hangs beside the trunk: what lies on the trunk is of the same patch, and faces the arm.
TEST_F(SleeveTest, AnArmholeInItsArmComesOutOnItsOwnSide) {
  constexpr size_t kRows = 36, kTop = 6;  // the sleeve begins at the sixth row, the core at the fourth
  constexpr size_t kTrunk = 4;
  Clear();
  AppendTube(kSleeve, 0, kRows, kAround, 0);
  for (size_t i = 0; i < 3 * kTop * kAround; ++i) bound_[i] *= i % 3 == 1 ? 1.0f : 2.0f;
  for (int j = 0; j < 4; ++j) {
    const float inverse[12] = {1, 0, 0, 0, 0, 1, 0, kBone * static_cast<float>(j), 0, 0, 1, 0};
    inverse_bind_.insert(inverse_bind_.end(), inverse, inverse + 12);
  }
  for (int ring = 0; ring <= 90; ++ring) AppendRing(kArm, -0.01f * static_cast<float>(ring), kAround, 0, &body_);
  for (size_t i = 0; i < body_.size() / 3; ++i)
    body_joints_.push_back(static_cast<uint8_t>(i < 30 * kAround ? 0 : i < 60 * kAround ? 1 : 2));
  body_weights_.assign(body_joints_.size(), 1.0f);
  const auto faces_trunk = [](size_t vertex) {
    const size_t column = vertex % kAround;
    return vertex < kTop * kAround && column > kAround / 2 - 6 && column < kAround / 2 + 6;
  };
  std::stable_partition(order_.begin(), order_.end(), faces_trunk);
  View(chain_);
  engine::MeasureLimbCores(model_, limbs_);
  engine::FindSleeves(model_, limbs_, sleeves_);
  std::vector<float> posed = bound_;
  for (size_t v = 0; v < kTop * kAround; ++v) {
    if (!faces_trunk(v)) continue;
    const size_t row = v / kAround;
    posed[3 * v] = row < kTrunk ? -0.1f : -0.02f;
    if (row < kTrunk) posed[3 * v + 1] -= 0.1f * static_cast<float>(kTrunk - row);
  }
  const std::vector<float> before = posed;
  Lay(&posed);
  size_t checked = 0;
  for (size_t v = kTrunk * kAround; v < kTop * kAround; ++v) {
    const size_t column = v % kAround;
    if (!faces_trunk(v) || column < kAround / 2 - 3 || column > kAround / 2 + 3) continue;
    ++checked;
    EXPECT_LT(posed[3 * v], 0) << v << ": through the arm";
    EXPECT_GT(FromAxis(posed, 3 * v), 0.85f * kArm) << v;
  }
  EXPECT_EQ(checked, 14u);
}

// The thigh was swung through the sheet: above, the sheet is still in it, below it hangs behind it.
TEST_F(DeepClothTest, ClothThatHangsBehindTheLimbComesToLieInFrontOfIt) {
  std::vector<float> sheet = SheetAt(0, 0);
  for (size_t i = 0; i < sheet.size(); i += 3) sheet[i + 2] = 0.06f + 0.8f * (sheet[i + 1] + 0.05f);
  const std::vector<float> before = sheet;
  Lay(&sheet);
  size_t behind = 0, beside = 0;
  for (size_t i = 0; i < sheet.size(); i += 3) {
    // Further out cloth goes down the thigh's side, and so do the ends of the last two rows.
    if (before[i + 2] < -kThigh && before[i + 1] > -0.335f && std::fabs(before[i]) < 0.025f) {
      ++behind;
      EXPECT_GT(sheet[i + 2], 0) << i / 3 << ": behind the thigh";
      EXPECT_GT(FromAxis(sheet, i), 0.9f * kThigh - 1e-4f) << i / 3;
    }
    if (std::fabs(before[i]) < 0.15f) continue;
    ++beside;
    ASSERT_EQ(std::memcmp(&before[i], &sheet[i], 12), 0) << i / 3;
  }
  EXPECT_GT(behind, 50u);
  EXPECT_GT(beside, 200u);
}

// So does cloth behind the limb that was bound there, next to deep cloth.
TEST_F(DeepClothTest, ClothOfTheFarSideStaysBehindTheLimb) {
  for (size_t i = 0; i < bound_.size(); i += 3) bound_[i + 2] = -kSheetZ;
  for (size_t i = 0; i + 2 < faces_.size(); i += 3) std::swap(faces_[i], faces_[i + 1]);
  std::vector<float> sheet = SheetAt(0, 0);
  for (size_t i = 0; i < sheet.size(); i += 3) sheet[i + 2] = -0.06f + 0.8f * (sheet[i + 1] + 0.05f);
  Lay(&sheet);
  for (size_t i = 0; i < sheet.size(); i += 3) ASSERT_LT(sheet[i + 2], 0) << i / 3;
}

TEST_F(DeepClothTest, ClothOutsideOfCoresKeepsItsBits) {
  for (const float z : {-0.15f, kSheetZ, 0.075f}) {
    std::vector<float> sheet = SheetAt(0, z);
    const std::vector<float> before = sheet;
    Lay(&sheet);
    EXPECT_EQ(sheet, before) << z;
    for (size_t v = 0; v < order_.size(); ++v) ASSERT_EQ(deep_.places[v], engine::kNotDeep);
  }
}

// So nothing jumps from one frame to the next as cloth comes into a core, and pleats stay.
TEST_F(DeepClothTest, PleatsHardlyInACoreHardlyMove) {
  constexpr float kDepth = 0.0005f, kPleat = 0.004f;
  std::vector<float> sheet = SheetAt(0, 0.9f * kThigh - kDepth);
  for (size_t i = 0; i < sheet.size(); i += 3) sheet[i + 2] += (i / 3) % kColumns % 2 == 0 ? 0.0f : kPleat;
  const std::vector<float> before = sheet;
  Lay(&sheet);
  float most = 0;
  for (size_t i = 0; i < sheet.size(); ++i) most = std::fmax(most, std::fabs(sheet[i] - before[i]));
  EXPECT_GT(most, 0);
  EXPECT_LT(most, 0.0015f) << "lifted by what the surface is searched to, 1 mm, at most";
}

// The arm was outside of the sheet when it was bound: cloth in it is PushOut's.
TEST_F(DeepClothTest, ALimbBesideTheGarmentLaysNothing) {
  std::vector<float> sheet = SheetAt(kBeside, kBeside);
  const std::vector<float> before = sheet;
  size_t checked = 0;
  Lay(&sheet);
  for (size_t i = 0; i < sheet.size(); i += 3) {
    if (std::fabs(sheet[i] - kBeside) > kArm) continue;
    ASSERT_EQ(std::memcmp(&before[i], &sheet[i], 12), 0) << i / 3;
    ++checked;
  }
  EXPECT_GT(checked, 200u);
}

// A host's space that mirrors, in centimetres: a sheet in the thigh, and one that ends behind it.
TEST_F(DeepClothTest, MirroredSpacesGiveTheMirrorImage) {
  const std::vector<float> metres = matrices_;
  for (const float slope : {0.0f, 0.8f}) {
    std::vector<float> sheet = SheetAt(0.004f, 0.01f);
    for (size_t i = 0; i < sheet.size(); i += 3) sheet[i + 2] += slope * (sheet[i + 1] + 0.1f);
    std::vector<float> host = sheet;
    matrices_ = metres;
    Lay(&sheet);
    for (size_t j = 0; j < 4; ++j) {
      for (size_t r = 0; r < 3; ++r) matrices_[12 * j + 5 * r] = r == 0 ? -100.0f : 100.0f;
    }
    for (size_t i = 0; i < host.size(); ++i) host[i] *= i % 3 == 0 ? -100.0f : 100.0f;
    Lay(&host, true);
    for (size_t i = 0; i < host.size(); ++i) ASSERT_NEAR(host[i], (i % 3 == 0 ? -100 : 100) * sheet[i], 0.2f) << i / 3;
  }
}

TEST_F(DeepClothTest, NumbersThatAreNoneAndPosesWithoutSizeMoveNothingElsewhere) {
  std::vector<float> sheet = SheetAt(0, 0);
  for (size_t i = 0; i < sheet.size(); i += 30) sheet[i] = std::numeric_limits<float>::quiet_NaN();
  Lay(&sheet);
  for (float& entry : matrices_) entry = 0;
  sheet = SheetAt(0, 0);
  const std::vector<float> before = sheet;
  Lay(&sheet);
  EXPECT_EQ(sheet, before);
}

}  // namespace
}  // namespace dcloth::testing

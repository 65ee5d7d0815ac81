// A thigh of 80 mm with a sheet of cloth in front of it and an arm before the sheet; an arm in a sleeve; a leg in a
// skirt.
#ifndef DCLOTH_TESTS_UNIT_ENGINE_BODY_LIMBS_H_
#define DCLOTH_TESTS_UNIT_ENGINE_BODY_LIMBS_H_

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "engine/src/body/deep_cloth.h"
#include "engine/src/body/sleeves.h"
#include "engine/src/body/swept_limbs.h"

namespace dcloth::testing {

constexpr float kThigh = 0.08f, kArm = 0.05f, kLength = 0.4f, kBeside = 0.3f, kSheetZ = 0.15f;
constexpr size_t kColumns = 41, kRows = 31;
constexpr float kSpacing = 0.01f;

inline void AppendRing(float radius, float y, size_t around, float offset, std::vector<float>* positions) {
  for (size_t i = 0; i < around; ++i) {
    const float turn = 6.28318531f * (static_cast<float>(i) + offset) / static_cast<float>(around);
    positions->insert(positions->end(), {radius * std::cos(turn), y, radius * std::sin(turn)});
  }
}

// Joints: the thigh's and its knee, the arm's and its hand. Both bones point down -y.
class ThighAndSheet : public ::testing::Test {
 protected:
  ThighAndSheet() {
    for (const float x : {0.0f, kBeside}) {
      for (const float y : {0.0f, -kLength}) {
        const float inverse[12] = {1, 0, 0, -x, 0, 1, 0, -y, 0, 0, 1, -x};
        inverse_bind_.insert(inverse_bind_.end(), inverse, inverse + 12);
      }
      const float radius = x == 0 ? kThigh : kArm;
      for (int ring = 0; ring <= 40; ++ring) {
        for (int i = 0; i < 32; ++i) {
          const float turn = static_cast<float>(i) * 0.19634954f, y = -kLength * static_cast<float>(ring) / 40;
          body_.insert(body_.end(), {x + radius * std::cos(turn), y, x + radius * std::sin(turn)});
          body_joints_.push_back(x == 0 ? 0 : 2);
        }
      }
    }
    body_weights_.assign(body_joints_.size(), 1.0f);
    for (size_t r = 0; r < kRows; ++r) {
      for (size_t c = 0; c < kColumns; ++c) {
        const float x = kSpacing * (static_cast<float>(c) - 0.5f * (kColumns - 1));
        bound_.insert(bound_.end(), {x, -0.05f - kSpacing * static_cast<float>(r), kSheetZ});
        order_.push_back(static_cast<uint16_t>(order_.size()));
      }
    }
    for (size_t r = 0; r + 1 < kRows; ++r) {
      for (size_t c = 0; c + 1 < kColumns; ++c) {
        const auto a = static_cast<uint16_t>(r * kColumns + c), b = static_cast<uint16_t>(a + kColumns);
        for (const int corner : {0, 2, 1, 1, 2, 3}) {
          const uint16_t corners[4] = {a, static_cast<uint16_t>(a + 1), b, static_cast<uint16_t>(b + 1)};
          faces_.push_back(corners[corner]);
        }
      }
    }
    View(parents_);
    for (size_t j = 0; j < 4; ++j) {
      const float identity[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
      matrices_.insert(matrices_.end(), identity, identity + 12);
    }
    engine::Arena sizes(nullptr);
    engine::PlaceLimbCores(&sizes);
    engine::PlaceDeepCloth(model_, engine::PlaceSleeves(model_, &sizes), &sizes);
    memory_.resize(sizes.size() + 64);
    const auto address = reinterpret_cast<uintptr_t>(memory_.data());
    engine::Arena arena(memory_.data() + (64 - address % 64) % 64);
    limbs_ = engine::PlaceLimbCores(&arena);
    sleeves_ = engine::PlaceSleeves(model_, &arena);
    deep_ = engine::PlaceDeepCloth(model_, sleeves_, &arena);
    std::memset(sleeves_.cores, engine::kNoSleeve, model_.vertex_count);
    engine::MeasureLimbCores(model_, limbs_);
  }

  // The model of what the vectors hold.
  void View(const uint16_t* parents) {
    model_.parents = parents;
    model_.joint_count = 4;
    model_.inverse_bind = inverse_bind_.data();
    model_.template_positions = bound_.data();
    model_.faces = faces_.data();
    model_.vertex_count = static_cast<uint32_t>(order_.size());
    model_.triangle_count = static_cast<uint32_t>(faces_.size() / 3);
    model_.body.positions = body_.data();
    model_.body.joints = body_joints_.data();
    model_.body.weights = body_weights_.data();
    model_.body.vertex_count = static_cast<uint32_t>(body_joints_.size());
    model_.body.influences = 1;
    lists_.order = order_.data();
  }

  // Forgets thigh, arm and sheet.
  void Clear() {
    for (auto* of : {&inverse_bind_, &body_, &body_weights_, &bound_}) of->clear();
    for (auto* of : {&order_, &faces_}) of->clear();
    body_joints_.clear();
  }

  // Cloth, downward from `y`.
  void AppendTube(float radius, float y, size_t rows, size_t around, float offset) {
    for (size_t r = 0; r < rows; ++r) AppendRing(radius, y - kSpacing * static_cast<float>(r), around, offset, &bound_);
    for (size_t i = 0; i < rows * around; ++i) {
      order_.push_back(static_cast<uint16_t>(i));
      if (i + around >= rows * around) continue;
      const size_t next = i % around == around - 1 ? i + 1 - around : i + 1;
      for (const size_t corner : {i, next, i + around, next, next + around, i + around})
        faces_.push_back(static_cast<uint16_t>(corner));
    }
  }

  std::vector<float> SheetAt(float x, float z) const {
    std::vector<float> sheet = bound_;
    for (size_t i = 0; i < sheet.size(); i += 3) sheet[i] += x, sheet[i + 2] = z;
    return sheet;
  }

  void Lay(std::vector<float>* sheet, bool mirrored = false) {
    engine::PoseLimbCores(matrices_.data(), limbs_);
    engine::Surface surface = {};
    surface.positions = sheet->data();
    surface.position_stride_bytes = 12;
    engine::LayOverLimbs(model_, mirrored, limbs_, 0, lists_, deep_, surface);
  }

  const uint16_t parents_[4] = {format::kNoParent, 0, format::kNoParent, 2};
  std::vector<float> inverse_bind_, body_, body_weights_, bound_, matrices_;
  std::vector<uint8_t> body_joints_, memory_;
  std::vector<uint16_t> order_, faces_;
  format::ModelView model_ = {};
  engine::TouchLists lists_ = {};
  engine::LimbCores limbs_ = {};
  engine::DeepCloth deep_ = {};
  engine::Sleeves sleeves_ = {};
};

// Two bones of an arm that bends between them about x, a hand, and a sleeve around the elbow: rings of 32 vertices, so
// that each patch of 64 goes around the arm and has no side.
class ArmInSleeve : public ThighAndSheet {
 protected:
  static constexpr float kBone = 0.3f, kSleeve = 0.06f;
  static constexpr size_t kRings = 25, kAround = 32;

  ArmInSleeve() {
    Clear();
    for (int j = 0; j < 4; ++j) {
      const float inverse[12] = {1, 0, 0, 0, 0, 1, 0, kBone * static_cast<float>(j), 0, 0, 1, 0};
      inverse_bind_.insert(inverse_bind_.end(), inverse, inverse + 12);
    }
    for (int ring = 0; ring <= 90; ++ring) {
      const float y = -0.01f * static_cast<float>(ring);
      AppendRing(kArm, y, kAround, 0, &body_);
      body_joints_.insert(body_joints_.end(), kAround, static_cast<uint8_t>(ring < 30 ? 0 : ring < 60 ? 1 : 2));
    }
    body_weights_.assign(body_joints_.size(), 1.0f);
    AppendTube(kSleeve, -0.18f, kRings, kAround, 0);
    View(chain_);
    engine::MeasureLimbCores(model_, limbs_);
  }

  // The forearm and the hand turn about the elbow.
  void Bend(float angle) {
    const float c = std::cos(angle), s = std::sin(angle);
    const float matrix[12] = {1, 0, 0, 0, 0, c, -s, kBone * (c - 1), 0, s, c, kBone * s};
    for (const size_t j : {1, 2}) std::memcpy(&matrices_[12 * j], matrix, sizeof(matrix));
  }

  // The forearm and the hand turn about their own axis.
  void TurnForearm(float angle) {
    const float c = std::cos(angle), s = std::sin(angle);
    for (const size_t j : {1, 2}) {
      for (size_t r = 0; r < 3; ++r) {
        float* row = &matrices_[12 * j + 4 * r];
        const float x = row[0], z = row[2];
        row[0] = c * x - s * z;
        row[2] = s * x + c * z;
      }
    }
  }

  // A vertex's place in the frame of its bone.
  void Unbend(size_t i, const float* position, float* out) const {
    const float* matrix = matrices_.data() + (bound_[i + 1] > -kBone ? 0 : 12);
    for (size_t c = 0; c < 3; ++c) {
      out[c] = 0;
      for (size_t r = 0; r < 3; ++r) out[c] += matrix[4 * r + c] * (position[r] - matrix[4 * r + 3]);
    }
  }

  const uint16_t chain_[4] = {format::kNoParent, 0, 1, 2};
};

// A leg of two bones and a foot that hangs from a hip, in a skirt.
class LegInSkirt : public ThighAndSheet {
 protected:
  static constexpr float kSkirt = 0.22f, kFoot = 0.15f;
  static constexpr size_t kRows = 61, kAround = 120;

  LegInSkirt() {
    Clear();
    for (const float y : {0.0f, 0.0f, -kLength, -2 * kLength, -2 * kLength - kFoot}) {
      const float inverse[12] = {1, 0, 0, 0, 0, 1, 0, -y, 0, 0, 1, 0};
      inverse_bind_.insert(inverse_bind_.end(), inverse, inverse + 12);
    }
    for (int ring = 0; ring <= 95; ++ring) {
      const float y = -0.01f * static_cast<float>(ring);
      AppendRing(ring < 40 ? kThigh : kArm, y, 32, 0.3f, &body_);
      body_joints_.insert(body_joints_.end(), 32, static_cast<uint8_t>(ring < 40 ? 1 : ring < 80 ? 2 : 3));
    }
    body_weights_.assign(body_joints_.size(), 1.0f);
    AppendTube(kSkirt, 0, kRows, kAround, 0.3f);
    View(chain_);
    model_.joint_count = 5;
    matrices_.insert(matrices_.end(), matrices_.begin(), matrices_.begin() + 12);
    engine::Arena sizes(nullptr);
    engine::PlaceDeepCloth(model_, engine::PlaceSleeves(model_, &sizes), &sizes);
    engine::PlaceSweptCloth(model_, &sizes);
    memory_of_skirt_.resize(sizes.size() + 64);
    const auto address = reinterpret_cast<uintptr_t>(memory_of_skirt_.data());
    engine::Arena arena(memory_of_skirt_.data() + (64 - address % 64) % 64);
    sleeves_ = engine::PlaceSleeves(model_, &arena);
    deep_ = engine::PlaceDeepCloth(model_, sleeves_, &arena);
    swept_ = engine::PlaceSweptCloth(model_, &arena);
    engine::MeasureLimbCores(model_, limbs_);
    engine::FindSleeves(model_, limbs_, sleeves_);
    engine::FindSweptCloth(model_, limbs_, sleeves_, swept_);
  }

  // The leg is lifted forward by `hip`, and its knee bent by `knee`.
  void Lift(float hip, float knee) {
    const float c = std::cos(hip), s = std::sin(hip), d = std::cos(hip - knee), t = std::sin(hip - knee);
    const float thigh[12] = {1, 0, 0, 0, 0, c, s, 0, 0, -s, c, 0};
    const float shank[12] = {1, 0, 0, 0, 0, d, t, kLength * (d - c), 0, -t, d, kLength * (s - t)};
    std::memcpy(&matrices_[12], thigh, sizeof(thigh));
    for (const size_t j : {2, 3, 4}) std::memcpy(&matrices_[12 * j], shank, sizeof(shank));
  }

  // Blown backward, so much a metre below the hip.
  std::vector<float> Skirt(float slope) const {
    std::vector<float> skirt = bound_;
    for (size_t i = 2; i < skirt.size(); i += 3) skirt[i] += slope * skirt[i - 1];
    return skirt;
  }

  uint8_t LayOrSweep(std::vector<float>* skirt, bool mirrored = false) {
    engine::PoseLimbCores(matrices_.data(), limbs_);
    engine::Surface surface = {};
    surface.positions = skirt->data();
    surface.position_stride_bytes = 12;
    return engine::LayOrSweep(model_, mirrored, matrices_.data(), limbs_, lists_, deep_, swept_, surface);
  }

  // From here on the host's space is in centimetres, and mirrored; so is the skirt.
  void MirrorSpace(std::vector<float>* skirt) {
    for (size_t i = 0; i < skirt->size(); ++i) (*skirt)[i] *= i % 3 == 0 ? -100.0f : 100.0f;
    for (size_t i = 0; i < matrices_.size(); ++i) matrices_[i] *= i % 12 < 4 ? -100.0f : 100.0f;
  }

  // Joints without size or torn apart, cloth that is nowhere: an end, and nothing that is no number where there was
  // none.
  template <typename Act>
  void ExpectBrokenPosesEnd(Act act) {
    const std::vector<float> matrices = matrices_;
    for (const size_t broken : {2, 4}) {
      for (const float scale : {0.0f, 1e-30f, 1e18f}) {
        matrices_ = matrices;
        for (size_t i = 12; i < 12 + 12 * broken; ++i) matrices_[i] *= scale;
        for (const float size : {0.0f, 1.0f, 1e15f}) {
          std::vector<float> skirt = Skirt(0);
          for (float& x : skirt) x *= size;
          act(&skirt);
          for (const float x : skirt) ASSERT_TRUE(std::isfinite(x)) << broken << " " << scale << " " << size;
        }
      }
    }
  }

  // Triangles of which the middle is deep in the leg.
  int TornOn(const std::vector<float>& skirt) const {
    int count = 0;
    for (size_t t = 0; t < faces_.size(); t += 3) {
      float middle[3] = {}, away[3], radius;
      for (size_t i = 0; i < 9; ++i) middle[i % 3] += skirt[3 * faces_[t + i / 3] + i % 3] / 3;
      for (uint32_t k = 0; k < *limbs_.count; ++k) {
        if (engine::IsInCore(limbs_.cores[k], middle, away, &radius))
          count += std::sqrt(engine::Dot(away, away)) < 0.5f * radius;
      }
    }
    return count;
  }

  // Triangles that a bone goes through.
  int CrossedBy(const std::vector<float>& skirt) const {
    const auto volume = [](const float* a, const float* b, const float* c, const float* d) {
      float ab[3], ac[3], ad[3];
      for (size_t i = 0; i < 3; ++i) ab[i] = b[i] - a[i], ac[i] = c[i] - a[i], ad[i] = d[i] - a[i];
      return ab[0] * (ac[1] * ad[2] - ac[2] * ad[1]) + ab[1] * (ac[2] * ad[0] - ac[0] * ad[2]) +
             ab[2] * (ac[0] * ad[1] - ac[1] * ad[0]);
    };
    int count = 0;
    for (uint32_t k = 0; k < *limbs_.count; ++k) {
      const engine::LimbCore& bone = limbs_.cores[k];
      float to[3];
      for (size_t c = 0; c < 3; ++c) to[c] = bone.posed_from[c] + bone.along[c];
      for (size_t t = 0; t < faces_.size(); t += 3) {
        const float* at[3] = {&skirt[3 * faces_[t]], &skirt[3 * faces_[t + 1]], &skirt[3 * faces_[t + 2]]};
        if (volume(at[0], at[1], at[2], bone.posed_from) * volume(at[0], at[1], at[2], to) > 0) continue;
        int sides = 0;
        for (size_t i = 0; i < 3; ++i) sides += volume(bone.posed_from, to, at[i], at[(i + 1) % 3]) > 0 ? 1 : -1;
        count += std::abs(sides) == 3;
      }
    }
    return count;
  }

  const uint16_t chain_[5] = {format::kNoParent, 0, 1, 2, 3};
  std::vector<uint8_t> memory_of_skirt_;
  engine::SweptCloth swept_ = {};
};

}  // namespace dcloth::testing

#endif  // DCLOTH_TESTS_UNIT_ENGINE_BODY_LIMBS_H_

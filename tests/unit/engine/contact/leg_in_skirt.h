// A leg of two bones and a foot that hangs from a hip, in a skirt.
#ifndef DCLOTH_TESTS_UNIT_ENGINE_CONTACT_LEG_IN_SKIRT_H_
#define DCLOTH_TESTS_UNIT_ENGINE_CONTACT_LEG_IN_SKIRT_H_

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <string>
#include <vector>

#include "engine/src/contact/contact.h"

namespace dcloth::testing {

// A tube of triangles, downward from y = 0.
struct Tube {
  Tube(const std::vector<float>& radii, float spacing, size_t around) {
    for (size_t r = 0; r < radii.size(); ++r) {
      for (size_t i = 0; i < around; ++i) {
        const float turn = 6.28318531f * (static_cast<float>(i) + 0.3f) / static_cast<float>(around);
        positions.insert(positions.end(),
                         {radii[r] * std::cos(turn), -spacing * static_cast<float>(r), radii[r] * std::sin(turn)});
        if (r == 0) continue;
        const size_t below = r * around + i, next = i + 1 == around ? below + 1 - around : below + 1;
        for (const size_t corner : {below - around, next - around, below, next - around, next, below})
          faces.push_back(static_cast<uint16_t>(corner));
      }
    }
  }
  size_t count() const { return positions.size() / 3; }

  std::vector<float> positions;
  std::vector<uint16_t> faces;
};

class LegInSkirt : public ::testing::Test {
 protected:
  static constexpr float kThigh = 0.08f, kShank = 0.05f, kLength = 0.4f, kSkirt = 0.22f, kFoot = 0.15f;
  static constexpr float kClearance = 0.004f;
  static constexpr size_t kJoints = 5;

  LegInSkirt() {
    for (const float y : {0.0f, 0.0f, -kLength, -2 * kLength, -2 * kLength - kFoot}) {
      const float inverse[12] = {1, 0, 0, 0, 0, 1, 0, -y, 0, 0, 1, 0};
      inverse_bind_.insert(inverse_bind_.end(), inverse, inverse + 12);
    }
    row_starts_.resize(leg_.count() + 1);
    for (const uint16_t corner : leg_.faces) ++row_starts_[corner + size_t{1}];
    for (size_t v = 0; v < leg_.count(); ++v) row_starts_[v + 1] += row_starts_[v];
    columns_.resize(leg_.faces.size());
    std::vector<uint32_t> ends(row_starts_.begin(), row_starts_.end() - 1);
    for (size_t i = 0; i < leg_.faces.size(); ++i) columns_[ends[leg_.faces[i]]++] = static_cast<uint16_t>(i / 3);
    for (size_t v = 0; v < leg_.count(); ++v) {
      const size_t ring = v / 32;
      leg_joints_.push_back(static_cast<uint8_t>(ring < 40 ? 1 : ring < 80 ? 2 : 3));
    }
    leg_weights_.assign(leg_.count(), 1.0f);
    model_.parents = parents_;
    model_.joint_count = kJoints;
    model_.inverse_bind = inverse_bind_.data();
    model_.template_positions = skirt_.positions.data();
    model_.faces = skirt_.faces.data();
    model_.vertex_count = static_cast<uint32_t>(skirt_.count());
    model_.triangle_count = static_cast<uint32_t>(skirt_.faces.size() / 3);
    format::BodyView& body = model_.body;
    body.positions = leg_.positions.data();
    body.joints = leg_joints_.data();
    body.weights = leg_weights_.data();
    body.faces = leg_.faces.data();
    body.row_starts = row_starts_.data();
    body.columns = columns_.data();
    body.vertex_count = static_cast<uint32_t>(leg_.count());
    body.face_count = static_cast<uint32_t>(leg_.faces.size() / 3);
    body.influences = 1;
    body.clearance = kClearance;
    body.reach = 1;
    engine::Arena sizes(nullptr);
    engine::PlaceContactMemory(model_, &sizes);
    storage_.resize(sizes.size() + 64);
    const auto address = reinterpret_cast<uintptr_t>(storage_.data());
    engine::Arena arena(storage_.data() + (64 - address % 64) % 64);
    memory_ = engine::PlaceContactMemory(model_, &arena);
    engine::PrepareContact(*kernels::FindKernels("scalar"), model_, memory_);
    Lift(0, 0);
  }

  // The leg is lifted forward by `hip`, and its knee bent by `knee`, radians.
  void Lift(double hip, double knee) {
    const double c = std::cos(hip), s = std::sin(hip), d = std::cos(hip - knee), t = std::sin(hip - knee);
    for (engine::Affine& joint : joints_) joint = {{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};
    joints_[1] = {{{1, 0, 0, 0}, {0, c, s, 0}, {0, -s, c, 0}}};
    const double length = static_cast<double>(kLength);
    for (const size_t j : {2, 3, 4})
      joints_[j] = {{{1, 0, 0, 0}, {0, d, t, length * (d - c)}, {0, -t, d, length * (s - t)}}};
  }

  // What is drawn of a target.
  std::vector<float> Draw(std::vector<float> cloth, float seconds = 1.0f / 30, const engine::Space& space = {}) {
    engine::Surface surface = {};
    surface.positions = cloth.data();
    surface.position_stride_bytes = 12;
    engine::Stopwatch watch(nullptr);
    clock_.Pass(seconds);
    engine::KeepOutside(*kernels::FindKernels("scalar"), model_, space, {joints_, {}}, memory_, &clock_, surface,
                        &watch);
    return cloth;
  }

  // Triangles that a bone goes through.
  int PiercedBy(const std::vector<float>& cloth) const {
    int count = 0;
    for (uint32_t k = 0; k < *memory_.limbs.count; ++k) {
      const engine::LimbCore& core = memory_.limbs.cores[k];
      for (size_t t = 0; t < skirt_.faces.size(); t += 3) {
        engine::Vecf at[3];
        for (size_t i = 0; i < 3; ++i) at[i] = core.now.Into(engine::VecfAt(&cloth[size_t{3} * skirt_.faces[t + i]]));
        int sides = 0;
        float z = 0;
        for (size_t i = 0; i < 3; ++i) {
          sides += at[i].x * at[(i + 1) % 3].y - at[i].y * at[(i + 1) % 3].x > 0 ? 1 : -1;
          z += at[i].z / 3;
        }
        count += std::abs(sides) == 3 && z > 0 && z < core.length ? 1 : 0;
      }
    }
    return count;
  }

  const uint16_t parents_[kJoints] = {format::kNoParent, 0, 1, 2, 3};
  const Tube leg_{Radii(), 0.01f, 32};
  const Tube skirt_{std::vector<float>(41, kSkirt), 0.015f, 90};
  std::vector<float> inverse_bind_, leg_weights_;
  std::vector<uint8_t> leg_joints_, storage_;
  std::vector<uint32_t> row_starts_;
  std::vector<uint16_t> columns_;
  format::ModelView model_ = {};
  engine::ContactMemory memory_ = {};
  engine::ContactClock clock_ = {};
  engine::Affine joints_[kJoints] = {};

 private:
  static std::vector<float> Radii() {
    std::vector<float> radii(96, kShank);
    for (size_t r = 0; r < 40; ++r) radii[r] = kThigh;
    return radii;
  }
};

}  // namespace dcloth::testing

#endif  // DCLOTH_TESTS_UNIT_ENGINE_CONTACT_LEG_IN_SKIRT_H_

#include "tests/stability/player.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <limits>

#include "dcloth/dcloth.hpp"
#include "engine/src/cloth.h"

namespace dcloth::stability {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

double LargestOf(std::span<const float> values) {
  double largest = 0;
  for (const float value : values) {
    // Written so that NaN counts.
    if (!(std::abs(value) <= std::numeric_limits<float>::max())) return kInfinity;
    largest = std::max(largest, std::abs(static_cast<double>(value)));
  }
  return largest;
}

double DistanceMm(const float* a, const float* b) {
  double sum = 0;
  for (int c = 0; c < 3; ++c) sum += std::pow(static_cast<double>(a[c]) - static_cast<double>(b[c]), 2);
  return 1e3 * std::sqrt(sum);
}

}  // namespace

Player::Player(const Garment& garment, Precision precision)
    : garment_(garment),
      model_(garment.model(precision)),
      memory_(dcloth_cloth_storage_size(model_.model())),
      matrices_(16 * garment.rig.bind.size()),
      positions_(3 * garment.vertex_count()) {
  EXPECT_EQ(dcloth_cloth_create(model_.model(), memory_.data(), memory_.size(), &cloth_, nullptr), DCLOTH_OK);
}

void Player::Reset() { EXPECT_EQ(dcloth_cloth_reset(cloth_), DCLOTH_OK); }

dcloth_pose Player::Load(const Pose& pose) {
  for (size_t j = 0; j < pose.size(); ++j) {
    for (int r = 0; r < 4; ++r) {
      for (int c = 0; c < 4; ++c) {
        matrices_[16 * j + static_cast<size_t>(4 * r + c)] = static_cast<float>(pose[j](r, c));
      }
    }
  }
  return {sizeof(dcloth_pose), static_cast<uint32_t>(pose.size()), matrices_.data(), 0, 0};
}

void Player::Tick(const Pose& pose) {
  const dcloth_pose loaded = Load(pose);
  const auto start = std::chrono::steady_clock::now();
  EXPECT_EQ(dcloth_cloth_tick(cloth_, &loaded, model_.info().stages, nullptr), DCLOTH_OK);
  tick_ms_.push_back(std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count());
}

const std::vector<float>& Player::Skin(const Pose& pose) {
  const dcloth_pose loaded = Load(pose);
  const dcloth_output output = dcloth::MakeOutput(positions_.data(), nullptr, model_.info().vertex_count);
  EXPECT_EQ(dcloth_cloth_skin(cloth_, &loaded, 1.0f, &output, nullptr), DCLOTH_OK);
  const float* const hips = matrices_.data() + 16 * garment_.rig.hips;
  const float origin[3] = {hips[3], hips[7], hips[11]};
  for (size_t i = 0; i < positions_.size(); i += 3) {
    const double distance = DistanceMm(positions_.data() + i, origin) / 1e3;
    worst_reach_m_ = std::isfinite(distance) ? std::max(worst_reach_m_, distance) : kInfinity;
  }
  return positions_;
}

std::span<float> Player::SkeletonState() const {
  auto* const cloth = reinterpret_cast<engine::Cloth*>(cloth_);
  return {cloth->coefficients, cloth->model->skeleton_stage.units};
}

std::span<float> Player::MeshState() const {
  auto* const cloth = reinterpret_cast<engine::Cloth*>(cloth_);
  const format::MeshStageView& stage = cloth->model->mesh_stage;
  return {cloth->mesh.state,
          stage.layer_count * kernels::GsgruStateFloats(cloth->model->vertex_count, stage.feature_width)};
}

std::span<float> Player::PatchState() const {
  auto* const cloth = reinterpret_cast<engine::Cloth*>(cloth_);
  const format::PatchStageView& stage = cloth->model->patch_stage;
  return {cloth->patches.hidden, size_t{stage.patch_count} * stage.width};
}

double Player::LargestState() const {
  return std::max({LargestSkeletonState(), LargestOf(MeshState()), LargestOf(PatchState())});
}

double Player::LargestSkeletonState() const { return LargestOf(SkeletonState()); }

void Player::FillState(const std::function<float()>& value) {
  for (const std::span<float> state : {SkeletonState(), MeshState(), PatchState()}) {
    std::generate(state.begin(), state.end(), value);
  }
}

void Player::Restore(const std::vector<std::byte>& saved) {
  ASSERT_EQ(saved.size(), memory_.size());
  std::memcpy(memory_.data(), saved.data(), saved.size());
}

double MeanDistanceMm(std::span<const float> a, std::span<const float> b) {
  EXPECT_EQ(a.size(), b.size());
  double sum = 0;
  for (size_t i = 0; i < a.size(); i += 3) sum += DistanceMm(&a[i], &b[i]);
  return 3 * sum / static_cast<double>(a.size());
}

double LargestDistanceMm(std::span<const float> a, std::span<const float> b) {
  EXPECT_EQ(a.size(), b.size());
  double largest = 0;
  for (size_t i = 0; i < a.size(); i += 3) {
    const double distance = DistanceMm(&a[i], &b[i]);
    largest = std::isfinite(distance) ? std::max(largest, distance) : kInfinity;
  }
  return largest;
}

}  // namespace dcloth::stability

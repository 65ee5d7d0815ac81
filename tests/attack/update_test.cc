// Time that no clock tells, and every way into a frame at once: updates with negative, infinite, missing and
// endless time, hostile poses, changing flags, stages, spaces and formats. State stays sound and every frame
// is defined.
#include <algorithm>
#include <cmath>
#include <iostream>
#include <limits>
#include <random>

#include "engine/src/cloth.h"
#include "tests/attack/variants.h"
#include "tests/unit/engine/all_finite.h"
#include "tests/unit/engine/cloth_fixture.h"
#include "tests/unit/kernels/guarded_buffer.h"

namespace dcloth::testing {
namespace {

using kernels::GuardedBuffer;
using kernels::Place;
using Limits = std::numeric_limits<float>;

bool Bounded(OwnedCloth* cloth, const Numbers& numbers) {
  const auto* inside = reinterpret_cast<const engine::Cloth*>(cloth->get());
  const auto bounded = [](float h) { return std::abs(h) <= 1 + 0x1p-20f; };
  const ModelSpec& spec = numbers.spec;
  if (spec.skeleton && !std::all_of(inside->coefficients, inside->coefficients + spec.units, bounded)) return false;
  const float* h = inside->patches.hidden;
  if (spec.patches != 0 && !std::all_of(h, h + size_t{spec.patches} * spec.patch_width, bounded)) return false;
  if (!spec.skeleton || !spec.mesh) return true;
  const size_t count = spec.layers * kernels::GsgruStateFloats(numbers.n, spec.feature_width);
  return std::all_of(inside->mesh.state, inside->mesh.state + count, bounded);
}

class UpdateAttackTest : public ::testing::TestWithParam<Variant> {
 protected:
  std::vector<float> Pose(double seconds) const { return PoseAt(model_.numbers, seconds); }
  uint32_t stages() const { return opened_.info().stages; }

  TestModel model_ = BuildModel(GetParam().spec);
  OpenedModel opened_{model_};
};

// Refused times leave no trace; an hour, a year and the largest float are hitches: at most two ticks, a
// finite frame, and the same vertices as after the same pose at rest for long enough that all of it was
// skipped.
TEST_P(UpdateAttackTest, TimeIsRefusedOrAHitch) {
  OwnedCloth disturbed(opened_), twin(opened_);
  const float refused[] = {-1e-45f,
                           -1e-30f,
                           -1.0f / 60,
                           -3600,
                           Limits::lowest(),
                           Limits::infinity(),
                           -Limits::infinity(),
                           Limits::quiet_NaN(),
                           Limits::signaling_NaN()};
  const float taken[] = {0, 1e-45f, 1e-9f, 1.0f / 60, 3600, 3.2e7f, Limits::max()};
  for (uint32_t flags = 0; flags < 32; ++flags) {
    for (const float seconds : taken) {
      const std::vector<float> pose = Pose(0.3);
      for (const float bad : refused)
        ASSERT_EQ(disturbed.Update(pose, bad, stages(), flags), DCLOTH_ERROR_ARGUMENT) << bad;
      for (OwnedCloth* cloth : {&disturbed, &twin})
        ASSERT_EQ(cloth->Update(pose, seconds, stages(), flags), DCLOTH_OK) << seconds;
      ASSERT_EQ(disturbed.positions(), twin.positions()) << seconds;
      ASSERT_TRUE(AllFinite(twin.positions()) && AllFinite(twin.normals())) << seconds;
      dcloth_cloth_info info = {};
      info.struct_size = sizeof(info);
      ASSERT_EQ(dcloth_cloth_describe(twin.get(), &info), DCLOTH_OK);
      // A tick left in work may be finished beside the ones that are due.
      EXPECT_LE(info.tick_share, DCLOTH_MAX_TICKS + 1.001f) << seconds;
      EXPECT_LE(info.lag_seconds, 2 * opened_.info().tick_seconds) << seconds;
    }
  }
}

// An hour between every two frames, for a thousand frames, poses hostile in between.
TEST_P(UpdateAttackTest, StateIsNeverPoisoned) {
  std::mt19937 random(31);
  const float times[] = {0, 1e-30f, 1 / 240.0f, 1 / 60.0f, 1 / 24.0f, 0.5f, 3600, Limits::max()};
  OwnedCloth cloth(opened_), fresh(opened_);
  size_t refused = 0;
  for (int frame = 0; frame < 1000; ++frame) {
    std::vector<float> pose = Pose(frame / 60.0);
    switch (random() % 6) {
      case 0:
        std::fill(pose.begin(), pose.end(), random() % 2 == 0 ? 1e9f : 0.0f);
        break;
      case 1:
        for (float& x : pose) x = random() % 2 == 0 ? 1e9f : -1e9f;
        break;
      case 2:  // mirrored, for which a blend of rotations has no answer
        for (size_t e = 0; e < pose.size(); e += 4) pose[e] = -pose[e];
        break;
      case 3:
        pose[random() % pose.size()] = Limits::quiet_NaN();
        break;
      default:
        break;
    }
    const bool sound = std::none_of(pose.begin(), pose.end(), [](float x) { return std::isnan(x); });
    const uint32_t wanted[] = {DCLOTH_STAGES_STATIC, DCLOTH_STAGES_SKELETON, DCLOTH_STAGES_MESH};
    const uint32_t asked = std::min(wanted[random() % 3], stages());
    const dcloth_status status = cloth.Update(pose, times[random() % 8], asked, random() % 32);
    ASSERT_EQ(status, sound ? DCLOTH_OK : DCLOTH_ERROR_POSE) << frame;
    refused += !sound;
    ASSERT_TRUE(Bounded(&cloth, model_.numbers)) << frame;
    // A refused frame leaves the vertices of the one before.
    ASSERT_TRUE(AllFinite(cloth.positions()) && AllFinite(cloth.normals())) << frame;
  }
  EXPECT_GT(refused, 50u);
  ASSERT_EQ(dcloth_cloth_reset(cloth.get()), DCLOTH_OK);
  for (int frame = 0; frame < 10; ++frame) {
    for (OwnedCloth* each : {&cloth, &fresh})
      ASSERT_EQ(each->Update(Pose(frame / 60.0), 1 / 60.0f, stages()), DCLOTH_OK);
    ASSERT_EQ(cloth.positions(), fresh.positions()) << frame;
  }
}

// Every attribute in every format, one buffer each or all in one, between guard pages.
TEST_P(UpdateAttackTest, EveryVertexBufferBetweenGuardPages) {
  const uint32_t n = opened_.info().vertex_count;
  OwnedCloth cloth(opened_);
  for (const Place place : {Place::kEnd, Place::kStart}) {
    for (uint32_t formats = 0; formats < 8; ++formats) {
      const auto bytes = [&](int attribute, uint32_t numbers) {
        return numbers * ((formats >> attribute & 1) ? 2u : 4u);
      };
      GuardedBuffer<uint8_t> positions(size_t{n} * bytes(0, 3), place), normals(size_t{n} * bytes(1, 3), place),
          tangents(size_t{n} * bytes(2, 4), place);
      GuardedBuffer<float> coordinates(2 * size_t{n}, place), bounds(6, place);
      for (uint32_t i = 0; i < 2 * n; ++i) coordinates[i] = static_cast<float>(i % 7) / 7;
      GuardedBuffer<dcloth_output> output(1, place);
      output[0] = {};
      output[0].struct_size = sizeof(dcloth_output);
      output[0].vertex_count = n;
      output[0].positions = positions.data();
      output[0].normals = normals.data();
      output[0].tangents = tangents.data();
      output[0].texture_coordinates = coordinates.data();
      output[0].position_stride_bytes = bytes(0, 3);
      output[0].normal_stride_bytes = bytes(1, 3);
      output[0].tangent_stride_bytes = bytes(2, 4);
      output[0].texture_stride_bytes = 8;
      output[0].position_format = formats & 1;
      output[0].normal_format = formats >> 1 & 1;
      output[0].tangent_format = formats >> 2 & 1;
      output[0].bounds = bounds.data();
      GuardedBuffer<float> scratch(dcloth_output_scratch_size(output.data()) / 4, place);
      output[0].scratch = scratch.size() != 0 ? scratch.data() : nullptr;
      output[0].scratch_size = 4 * scratch.size();
      const GuardedBuffer<float> matrices(Pose(formats / 60.0), place);
      GuardedBuffer<dcloth_pose> pose(1, place);
      pose[0] = {sizeof(dcloth_pose), opened_.info().joint_count, matrices.data(), 0, 0};
      GuardedBuffer<dcloth_frame> frame(1, place);
      frame[0] = {sizeof(dcloth_frame), stages(), 1 / 60.0f, 0, nullptr};
      ASSERT_EQ(dcloth_cloth_update(cloth.get(), pose.data(), frame.data(), output.data(), nullptr), DCLOTH_OK)
          << formats;
      for (const auto* buffer : {&positions, &normals, &tangents}) ASSERT_TRUE(buffer->SlackUntouched()) << formats;
      ASSERT_TRUE(scratch.SlackUntouched() && bounds.SlackUntouched() && coordinates.SlackUntouched()) << formats;
      ASSERT_TRUE(matrices.SlackUntouched() && pose.SlackUntouched() && frame.SlackUntouched()) << formats;
      for (size_t i = 0; i < bounds.size(); ++i) ASSERT_TRUE(std::isfinite(bounds[i])) << formats;
      if (scratch.size() == 0) continue;
      output[0].scratch_size -= 1;
      ASSERT_EQ(dcloth_cloth_update(cloth.get(), pose.data(), frame.data(), output.data(), nullptr),
                DCLOTH_ERROR_ARGUMENT)
          << "one byte of scratch less, " << formats;
    }
  }
}

// Hostile texture coordinates and poses beyond the floats' squares: tangents stay unit vectors across the
// normal.
TEST_P(UpdateAttackTest, TangentsAreDefinedWhateverTheInput) {
  const uint32_t n = opened_.info().vertex_count;
  OwnedCloth cloth(opened_);
  std::vector<float> positions(3 * n), normals(3 * n), tangents(4 * n), coordinates(2 * n);
  dcloth_output output = {};
  output.struct_size = sizeof(output);
  output.vertex_count = n;
  output.positions = positions.data();
  output.normals = normals.data();
  output.tangents = tangents.data();
  output.texture_coordinates = coordinates.data();
  output.position_stride_bytes = output.normal_stride_bytes = 12;
  output.tangent_stride_bytes = 16;
  output.texture_stride_bytes = 8;
  for (const float size : {1.0f, 0.0f, 1e-30f, 1e30f, 3e38f, Limits::infinity(), Limits::quiet_NaN()}) {
    for (uint32_t i = 0; i < 2 * n; ++i) coordinates[i] = static_cast<float>(i % 5) * size;
    for (const float scale : {1.0f, 1e8f, 0.0f}) {
      std::vector<float> matrices = Pose(0);
      for (float& x : matrices) x *= scale;
      const dcloth_pose pose = OwnedCloth::Pose(matrices);
      const dcloth_frame frame = {sizeof(frame), stages(), 1 / 60.0f, 0, nullptr};
      ASSERT_EQ(dcloth_cloth_update(cloth.get(), &pose, &frame, &output, nullptr), DCLOTH_OK);
      for (uint32_t i = 0; i < n; ++i) {
        const float* t = &tangents[4 * i];
        // Square root, division and products round: a few units in the last place.
        const double square = double{t[0]} * double{t[0]} + double{t[1]} * double{t[1]} + double{t[2]} * double{t[2]};
        ASSERT_NEAR(square, 1, 40 * 0x1p-24) << "coordinates " << size << ", pose " << scale << ", vertex " << i;
        ASSERT_EQ(std::abs(t[3]), 1.0f) << i;
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Every, UpdateAttackTest, ::testing::ValuesIn(Variants()),
                         [](const auto& test) { return test.param.name; });

}  // namespace
}  // namespace dcloth::testing

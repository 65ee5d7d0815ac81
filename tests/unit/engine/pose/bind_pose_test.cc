// A rig whose joints have axes, places and scales of their own draws the garment of the rig of training, once its bind
// pose is known.
#include <algorithm>
#include <cmath>
#include <random>
#include <string>

#include "engine/src/pose/affine.h"
#include "tests/unit/engine/cloth_fixture.h"
#include "tests/unit/engine/joint_matrices.h"

namespace dcloth::testing {
namespace {

using engine::Affine;

constexpr uint32_t kAll = DCLOTH_STAGES_MESH;
constexpr float kFrame = 1 / 45.0f;
// Matrices are floats: 2^-24 of what they hold, some metres and scales of ten, in a pose and in the bind pose.
constexpr float kRounding = 2e-5f;

// Axes from a random quaternion, a scale for each of them, a place up to 30 cm away.
Affine RandomFrame(std::mt19937* random, double least_scale, double largest_scale) {
  std::normal_distribution<double> normal;
  double q[4], length = 0;
  for (double& x : q) x = normal(*random), length += x * x;
  for (double& x : q) x /= std::sqrt(length);
  const auto [w, x, y, z] = std::array{q[0], q[1], q[2], q[3]};
  Affine frame = {{{1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y), 0},
                   {2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x), 0},
                   {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y), 0}}};
  std::uniform_real_distribution<double> scale(least_scale, largest_scale), place(-0.3, 0.3);
  for (int c = 0; c < 3; ++c) {
    const double s = scale(*random);
    for (int r = 0; r < 3; ++r) frame.m[r][c] *= s;
  }
  for (auto& row : frame.m) row[3] = place(*random);
  return frame;
}

class BindPoseTest : public ::testing::Test {
 protected:
  // What another rig has for a pose of the model's joints.
  struct Rig {
    std::vector<Affine> frames;
    std::vector<float> operator()(const std::vector<float>& pose) const {
      std::vector<float> host;
      for (size_t j = 0; j < frames.size(); ++j) Put(At(pose, j) * frames[j], &host);
      return host;
    }
  };

  Rig MakeRig(uint32_t seed, double least_scale, double largest_scale) const {
    std::mt19937 random(seed);
    Rig rig;
    for (size_t j = 0; j < joints(); ++j) rig.frames.push_back(RandomFrame(&random, least_scale, largest_scale));
    return rig;
  }

  std::vector<float> Training() const { return BindMatrices(model_.numbers, joints()); }

  static dcloth_status SetBindPose(OwnedCloth* cloth, const std::vector<float>& matrices,
                                   dcloth_error* error = nullptr) {
    const dcloth_pose pose = OwnedCloth::Pose(matrices);
    return dcloth_cloth_set_bind_pose(cloth->get(), &pose, error);
  }

  static void ExpectNear(const OwnedCloth& a, const OwnedCloth& b) {
    for (size_t i = 0; i < a.positions().size(); ++i) ASSERT_NEAR(a.positions()[i], b.positions()[i], kRounding) << i;
  }

  size_t joints() const { return model_.numbers.spec.joints; }
  std::vector<float> Pose(int frame) const { return PoseAt(model_.numbers, frame / 45.0); }

  TestModel model_ = BuildModel({});
  OpenedModel opened_{model_};
};

TEST_F(BindPoseTest, AnyRigWearsTheSameGarment) {
  for (uint32_t seed = 0; seed < 8; ++seed) {
    const Rig rig = seed == 0 ? MakeRig(0, 1, 1) : MakeRig(seed, 0.1, 10);
    OwnedCloth plain(opened_), other(opened_), untold(opened_);
    ASSERT_EQ(SetBindPose(&other, rig(Training())), DCLOTH_OK);
    float untold_off = 0;
    for (int frame = 0; frame < 12; ++frame) {
      ASSERT_EQ(plain.Update(Pose(frame), kFrame, kAll), DCLOTH_OK);
      ASSERT_EQ(other.Update(rig(Pose(frame)), kFrame, kAll), DCLOTH_OK);
      ASSERT_EQ(untold.Update(rig(Pose(frame)), kFrame, kAll), DCLOTH_OK);
      ExpectNear(other, plain);
      for (size_t i = 0; i < plain.positions().size(); ++i)
        untold_off = std::max(untold_off, std::abs(untold.positions()[i] - plain.positions()[i]));
    }
    EXPECT_GT(untold_off, 0.05f) << "this rig would not need it";
  }
}

// Centimetres, +Z up, left-handed, joints in another order: whichever of the three calls comes first.
TEST_F(BindPoseTest, SpaceAndNamesMayComeBeforeOrAfter) {
  const Rig rig = MakeRig(3, 1, 1);
  const auto host = [&](const std::vector<float>& pose) {
    const std::vector<float> own = rig(pose);
    std::vector<float> out(own.size(), 0);
    for (size_t j = 0; j < joints(); ++j) {
      // left -Y, up +Z, forward +X; the joints' own axes stay.
      const float* g = &own[16 * j];
      float* h = &out[16 * (joints() - 1 - j)];
      for (size_t c = 0; c < 4; ++c) {
        const float unit = c == 3 ? 100 : 1;
        h[4 * 1 + c] = -g[c] * unit, h[4 * 2 + c] = g[4 + c] * unit, h[4 * 0 + c] = g[8 + c] * unit;
      }
      h[15] = 1;
    }
    return out;
  };
  std::vector<std::string> names;
  for (size_t j = joints(); j-- > 0;) names.push_back("joint_" + std::to_string(j));
  std::vector<const char*> pointers;
  for (const std::string& name : names) pointers.push_back(name.c_str());
  for (const bool first : {false, true}) {
    for (const uint32_t joint_frames : {DCLOTH_JOINT_FRAMES_CONVERTED, DCLOTH_JOINT_FRAMES_KEPT}) {
      OwnedCloth plain(opened_), other(opened_);
      const dcloth_space space = {sizeof(space), DCLOTH_AXIS_MINUS_Y, DCLOTH_AXIS_Z, DCLOTH_AXIS_X,
                                  0.01f,         joint_frames};
      ASSERT_EQ(dcloth_cloth_bind_joints(other.get(), pointers.data(), static_cast<uint32_t>(joints()), nullptr),
                DCLOTH_OK);
      for (const bool now : {first, !first}) {
        ASSERT_EQ(now ? SetBindPose(&other, host(Training())) : dcloth_cloth_set_space(other.get(), &space, nullptr),
                  DCLOTH_OK);
      }
      for (int frame = 0; frame < 12; ++frame) {
        if (frame == 6) {
          for (OwnedCloth* cloth : {&plain, &other}) ASSERT_EQ(dcloth_cloth_reset(cloth->get()), DCLOTH_OK);
        }
        ASSERT_EQ(plain.Update(Pose(frame), kFrame, kAll), DCLOTH_OK);
        ASSERT_EQ(other.Update(host(Pose(frame)), kFrame, kAll), DCLOTH_OK);
        for (size_t i = 0; i < plain.positions().size(); i += 3) {
          ASSERT_NEAR(other.positions()[i + 1], -100 * plain.positions()[i], 100 * kRounding);
          ASSERT_NEAR(other.positions()[i + 2], 100 * plain.positions()[i + 1], 100 * kRounding);
          ASSERT_NEAR(other.positions()[i], 100 * plain.positions()[i + 2], 100 * kRounding);
        }
      }
    }
  }
}

// A save game does not know the rig: poses in it are the model's.
TEST_F(BindPoseTest, StatesGoFromRigToRig) {
  const Rig rig = MakeRig(4, 1, 1);
  OwnedCloth plain(opened_), other(opened_);
  ASSERT_EQ(SetBindPose(&other, rig(Training())), DCLOTH_OK);
  for (int frame = 0; frame < 8; ++frame) ASSERT_EQ(plain.Update(Pose(frame), kFrame, kAll), DCLOTH_OK);
  std::vector<std::byte> state(dcloth_cloth_state_size(plain.get()));
  ASSERT_EQ(dcloth_cloth_save(plain.get(), state.data(), state.size(), nullptr), DCLOTH_OK);
  ASSERT_EQ(dcloth_cloth_restore(other.get(), state.data(), state.size(), 0, nullptr), DCLOTH_OK);
  for (int frame = 8; frame < 16; ++frame) {
    ASSERT_EQ(plain.Update(Pose(frame), kFrame, kAll), DCLOTH_OK);
    ASSERT_EQ(other.Update(rig(Pose(frame)), kFrame, kAll), DCLOTH_OK);
    ExpectNear(other, plain);
  }
}

TEST_F(BindPoseTest, WhatHasNoInverseIsRefused) {
  const Rig rig = MakeRig(5, 1, 1);
  OwnedCloth plain(opened_), other(opened_);
  ASSERT_EQ(SetBindPose(&other, rig(Training())), DCLOTH_OK);
  dcloth_error error = EmptyError();
  const auto refused = [&](const char* found, auto change) {
    std::vector<float> bind = rig(Training());
    change(&bind);
    EXPECT_EQ(SetBindPose(&other, bind, &error), DCLOTH_ERROR_POSE) << found;
    EXPECT_NE(std::string(error.text).find(found), std::string::npos) << error.text;
  };
  refused("another count", [](std::vector<float>* bind) { bind->resize(bind->size() - 16); });
  refused("NaN", [](std::vector<float>* bind) { (*bind)[35] = NAN; });
  refused("NaN", [](std::vector<float>* bind) { (*bind)[35] = 2e9f; });
  refused("joint 'joint_2'", [](std::vector<float>* bind) { std::fill_n(bind->begin() + 32, 16, 0.0f); });
  refused("joint 'joint_1'", [](std::vector<float>* bind) { std::copy_n(bind->begin() + 16, 4, bind->begin() + 20); });
  refused("joint 'joint_0'", [](std::vector<float>* bind) {  // a scale of a ten-millionth
    for (size_t i = 0; i < 12; ++i) (*bind)[i] *= i % 4 == 3 ? 1.0f : 1e-7f;
  });
  const dcloth_pose none = {sizeof(dcloth_pose), static_cast<uint32_t>(joints()), nullptr, 0, 0};
  EXPECT_EQ(dcloth_cloth_set_bind_pose(other.get(), &none, &error), DCLOTH_ERROR_ARGUMENT);
  EXPECT_NE(std::string(error.text).find("allowed: "), std::string::npos) << error.text;
  EXPECT_EQ(dcloth_cloth_set_bind_pose(other.get(), nullptr, nullptr), DCLOTH_ERROR_ARGUMENT);
  const std::vector<float> bind = rig(Training());
  const dcloth_pose usable = OwnedCloth::Pose(bind);
  EXPECT_EQ(dcloth_cloth_set_bind_pose(nullptr, &usable, nullptr), DCLOTH_ERROR_ARGUMENT);
  for (int frame = 0; frame < 4; ++frame) {
    ASSERT_EQ(plain.Update(Pose(frame), kFrame, kAll), DCLOTH_OK);
    ASSERT_EQ(other.Update(rig(Pose(frame)), kFrame, kAll), DCLOTH_OK);
    ExpectNear(other, plain);
  }
}

// The largest that poses and bind poses may hold leaves the state finite: the garment is back after a few calm frames.
TEST_F(BindPoseTest, TheLargestNumbersDoNoLastingHarm) {
  OwnedCloth cloth(opened_);
  std::vector<float> tiny = Training();
  for (size_t i = 0; i < tiny.size(); ++i) tiny[i] *= i % 16 < 12 && i % 4 != 3 ? 2e-6f : 1.0f;
  ASSERT_EQ(SetBindPose(&cloth, tiny), DCLOTH_OK);
  std::vector<float> huge(tiny.size(), 1e9f);
  ASSERT_EQ(cloth.Update(huge, kFrame, kAll), DCLOTH_ERROR_POSE);
  huge.assign(tiny.size(), 1e5f);
  ASSERT_EQ(cloth.Update(huge, kFrame, kAll), DCLOTH_OK);
  ASSERT_EQ(SetBindPose(&cloth, Training()), DCLOTH_OK);
  for (int frame = 0; frame < 30; ++frame) ASSERT_EQ(cloth.Update(Pose(frame), kFrame, kAll), DCLOTH_OK);
  EXPECT_TRUE(
      std::all_of(cloth.positions().begin(), cloth.positions().end(), [](float x) { return std::isfinite(x); }));
}

// A model tells the bind pose of training, which taken as the host's changes nothing.
TEST_F(BindPoseTest, TheModelTellsItsOwn) {
  const std::vector<float> expected = Training();
  std::vector<float> found(expected.size(), -1);
  for (uint32_t j = 0; j < joints(); ++j)
    ASSERT_EQ(dcloth_model_joint_bind(opened_.get(), j, found.data() + size_t{16} * j), DCLOTH_OK);
  for (size_t i = 0; i < found.size(); ++i) EXPECT_NEAR(found[i], expected[i], 1e-6f) << i;
  float untouched = 7;
  EXPECT_EQ(dcloth_model_joint_bind(opened_.get(), static_cast<uint32_t>(joints()), &untouched), DCLOTH_ERROR_ARGUMENT);
  EXPECT_EQ(dcloth_model_joint_bind(nullptr, 0, &untouched), DCLOTH_ERROR_ARGUMENT);
  EXPECT_EQ(dcloth_model_joint_bind(opened_.get(), 0, nullptr), DCLOTH_ERROR_ARGUMENT);
  EXPECT_EQ(untouched, 7);
}

// A bind pose that is tiny makes poses huge. What a cloth takes it can also save, and take back.
TEST_F(BindPoseTest, WhatIsTakenCanBeSavedAndRestored) {
  std::vector<float> tiny = Training();
  for (size_t i = 0; i < tiny.size(); ++i) tiny[i] *= i % 16 < 12 && i % 4 != 3 ? 1e-4f : 1.0f;
  size_t taken = 0, refused = 0;
  for (const uint32_t flags : {uint32_t{0}, uint32_t{DCLOTH_FRAME_PIPELINED}}) {
    for (const float size : {1e9f, 1e8f, 3e7f, 1e7f, 1e5f}) {
      OwnedCloth cloth(opened_), other(opened_);
      ASSERT_EQ(SetBindPose(&cloth, tiny), DCLOTH_OK);
      ASSERT_EQ(SetBindPose(&other, tiny), DCLOTH_OK);
      for (int frame = 0; frame < 4; ++frame) {
        std::vector<float> huge(tiny.size(), frame % 2 == 0 ? size : -size);
        dcloth_error error = EmptyError();
        const dcloth_pose pose = OwnedCloth::Pose(huge);
        const dcloth_frame time = {sizeof(time), kAll, kFrame, flags, &error};
        const dcloth_status status = dcloth_cloth_update(cloth.get(), &pose, &time, nullptr, nullptr);
        ++(status == DCLOTH_OK ? taken : refused);
        if (status != DCLOTH_OK) {
          EXPECT_EQ(status, DCLOTH_ERROR_POSE);
          EXPECT_NE(std::string(error.text).find("bind pose puts beyond 1e12 m"), std::string::npos) << error.text;
        }
        std::vector<uint8_t> state(dcloth_cloth_state_size(cloth.get()));
        ASSERT_EQ(dcloth_cloth_save(cloth.get(), state.data(), state.size(), &error), DCLOTH_OK) << error.text;
        ASSERT_EQ(dcloth_cloth_restore(other.get(), state.data(), state.size(), 0, &error), DCLOTH_OK)
            << size << ": " << error.text;
      }
    }
  }
  EXPECT_GT(taken, 10u);
  EXPECT_GT(refused, 3u);
}

// A model may hold any numbers; its joints then have no axes to be read by.
TEST_F(BindPoseTest, ModelsWithoutInverseAreRefused) {
  TestModel broken = BuildModel({});
  const auto& values = model_.numbers.inverse_bind;
  AlignedBytes bytes = broken.Bytes();
  // The first joint's rows, wherever the file holds them.
  std::vector<float> rows(values.begin(), values.begin() + 12);
  const auto* wanted = reinterpret_cast<const uint8_t*>(rows.data());
  uint8_t* const end = bytes.data() + bytes.size();
  uint8_t* const found = std::search(bytes.data(), end, wanted, wanted + sizeof(float) * rows.size());
  ASSERT_NE(found, end);
  std::fill_n(found, sizeof(float) * rows.size(), uint8_t{0});
  const OpenedModel opened(std::move(bytes));
  ASSERT_EQ(opened.status(), DCLOTH_OK);
  OwnedCloth cloth(opened);
  dcloth_error error = EmptyError();
  EXPECT_EQ(SetBindPose(&cloth, Training(), &error), DCLOTH_ERROR_POSE);
  EXPECT_NE(std::string(error.text).find("joint 'joint_0'"), std::string::npos) << error.text;
}

}  // namespace
}  // namespace dcloth::testing

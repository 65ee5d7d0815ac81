// The host's own conventions: axes, handedness, units, joint order and names.
#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

#include "tests/unit/engine/cloth_fixture.h"

namespace dcloth::testing {
namespace {

constexpr uint32_t kAll = DCLOTH_STAGES_MESH;

struct Axes {
  size_t axis[3];
  float sign[3];

  bool mirrored() const {
    const bool even = (axis[1] + 3 - axis[0]) % 3 == 1;
    return (sign[0] * sign[1] * sign[2] < 0) == even;
  }
  dcloth_space Space(float metres_per_unit, uint32_t joint_frames) const {
    uint32_t code[3];
    for (size_t i = 0; i < 3; ++i) code[i] = static_cast<uint32_t>(2 * axis[i]) + (sign[i] < 0 ? 1 : 0);
    return {sizeof(dcloth_space), code[0], code[1], code[2], metres_per_unit, joint_frames};
  }
};

std::vector<Axes> AllAxes() {
  std::vector<Axes> all;
  size_t order[3] = {0, 1, 2};
  do {
    for (int signs = 0; signs < 8; ++signs) {
      Axes axes = {{order[0], order[1], order[2]}, {}};
      for (int i = 0; i < 3; ++i) axes.sign[i] = (signs >> i & 1) != 0 ? -1.0f : 1.0f;
      all.push_back(axes);
    }
  } while (std::next_permutation(order, order + 3));
  return all;
}

// What a host in that space has for the same pose.
std::vector<float> HostPose(const std::vector<float>& pose, const Axes& axes, float metres_per_unit, bool converted) {
  std::vector<float> host = pose;
  for (size_t j = 0; j < pose.size(); j += 16) {
    for (size_t r = 0; r < 3; ++r) {
      for (size_t c = 0; c < 3; ++c) {
        const float value = axes.sign[r] * pose[j + 4 * r + c];
        host[j + 4 * axes.axis[r] + (converted ? axes.axis[c] : c)] = converted ? axes.sign[c] * value : value;
      }
      host[j + 4 * axes.axis[r] + 3] = axes.sign[r] * pose[j + 4 * r + 3] / metres_per_unit;
    }
  }
  return host;
}

class HostTest : public ::testing::Test {
 protected:
  std::vector<float> Pose(int tick) const { return PoseAt(model_.numbers, tick / 30.0); }

  TestModel model_ = BuildModel({});
  OpenedModel opened_{model_};
};

// All 48 spaces and both kinds of joint frames, with a unit that is a power of two: the same positions to the
// bit, turned. Normals add three squares in another order, two roundings.
TEST_F(HostTest, EverySpaceHasTheSameGarment) {
  OwnedCloth plain(opened_);
  for (int tick = 0; tick < 3; ++tick) ASSERT_EQ(plain.Tick(Pose(tick), kAll), DCLOTH_OK);
  ASSERT_EQ(plain.Skin(Pose(3), 0.5f), DCLOTH_OK);
  size_t left_handed = 0;
  for (const Axes& axes : AllAxes()) {
    left_handed += axes.mirrored();
    for (const bool converted : {true, false}) {
      for (const float unit : {1.0f, 0.125f}) {
        OwnedCloth cloth(opened_);
        const dcloth_space space = axes.Space(unit, converted ? 0 : 1);
        ASSERT_EQ(dcloth_cloth_set_space(cloth.get(), &space, nullptr), DCLOTH_OK);
        for (int tick = 0; tick < 3; ++tick)
          ASSERT_EQ(cloth.Tick(HostPose(Pose(tick), axes, unit, converted), kAll), DCLOTH_OK);
        ASSERT_EQ(dcloth_cloth_set_space(cloth.get(), &space, nullptr), DCLOTH_OK) << "at any time";
        ASSERT_EQ(cloth.Skin(HostPose(Pose(3), axes, unit, converted), 0.5f), DCLOTH_OK);
        for (size_t i = 0; i < plain.positions().size(); ++i) {
          const size_t r = i % 3, at = i - r + axes.axis[r];
          ASSERT_EQ(cloth.positions()[at] * unit, axes.sign[r] * plain.positions()[i]) << i;
          ASSERT_NEAR(cloth.normals()[at], axes.sign[r] * plain.normals()[i], 0x1p-22f) << i;
        }
      }
    }
  }
  EXPECT_EQ(left_handed, 24u);
}

// Centimetres are no power of two: hosts round 100 times their metres, up to 2^-24 of 8 m, at the joints and
// at the vertices, and the network sees velocities off by twice that times 30.
TEST_F(HostTest, CentimetresDifferByRounding) {
  const Axes unreal = {{1, 2, 0}, {-1, 1, 1}};
  OwnedCloth plain(opened_), centimetres(opened_);
  const dcloth_space space = unreal.Space(0.01f, 0);
  EXPECT_EQ(space.left, uint32_t{DCLOTH_AXIS_MINUS_Y});
  EXPECT_TRUE(unreal.mirrored());
  ASSERT_EQ(dcloth_cloth_set_space(centimetres.get(), &space, nullptr), DCLOTH_OK);
  for (int tick = 0; tick < 30; ++tick) {
    ASSERT_EQ(plain.Update(Pose(tick), 1 / 30.0f, kAll), DCLOTH_OK);
    ASSERT_EQ(centimetres.Update(HostPose(Pose(tick), unreal, 0.01f, true), 1 / 30.0f, kAll), DCLOTH_OK);
    for (size_t i = 0; i < plain.positions().size(); ++i) {
      const size_t r = i % 3, at = i - r + unreal.axis[r];
      ASSERT_NEAR(centimetres.positions()[at] * 0.01f, unreal.sign[r] * plain.positions()[i], 60 * 8 * 0x1p-24f);
    }
  }
}

// The hand of a tangent turns with the space; the texture on the garment does not.
TEST_F(HostTest, TangentsTurnWithTheSpace) {
  const size_t n = model_.numbers.n;
  std::vector<float> texture;
  for (size_t i = 0; i < n; ++i)
    texture.insert(texture.end(), {0.1f * static_cast<float>(i % 10), 0.2f * static_cast<float>(i / 10)});
  const auto draw = [&](const Axes& axes) {
    OwnedCloth cloth(opened_);
    const dcloth_space space = axes.Space(1, 0);
    EXPECT_EQ(dcloth_cloth_set_space(cloth.get(), &space, nullptr), DCLOTH_OK);
    const std::vector<float> matrices = HostPose(Pose(0), axes, 1, true);
    std::vector<float> vertices(10 * n);
    dcloth_output output = FloatOutput(n, vertices.data(), 40, vertices.data() + 3);
    output.tangents = vertices.data() + 6;
    output.tangent_stride_bytes = 40;
    output.texture_coordinates = texture.data();
    output.texture_stride_bytes = 8;
    const dcloth_pose pose = OwnedCloth::Pose(matrices);
    const dcloth_frame frame = {sizeof(frame), kAll, 0, 0, nullptr};
    EXPECT_EQ(dcloth_cloth_update(cloth.get(), &pose, &frame, &output, nullptr), DCLOTH_OK);
    return vertices;
  };
  const std::vector<float> plain = draw({{0, 1, 2}, {1, 1, 1}});
  const Axes unity = {{0, 1, 2}, {-1, 1, 1}}, blender = {{0, 2, 1}, {1, 1, -1}};
  EXPECT_TRUE(unity.mirrored());
  EXPECT_FALSE(blender.mirrored());
  for (const Axes& axes : {unity, blender}) {
    const std::vector<float> turned = draw(axes);
    for (size_t i = 0; i < n; ++i) {
      for (size_t r = 0; r < 3; ++r) {
        // Sums in another order, divided by what is left perpendicular to the normal.
        ASSERT_NEAR(turned[10 * i + 6 + axes.axis[r]], axes.sign[r] * plain[10 * i + 6 + r], 1e-4f) << i;
      }
      ASSERT_EQ(turned[10 * i + 9], axes.mirrored() ? -plain[10 * i + 9] : plain[10 * i + 9]) << i;
    }
  }
}

TEST_F(HostTest, BrokenSpacesAreRefusedByTheFieldThatIsWrong) {
  OwnedCloth cloth(opened_);
  const auto refused = [&](const std::string& field, const std::string& found, auto change) {
    dcloth_space space = {sizeof(space), DCLOTH_AXIS_X, DCLOTH_AXIS_Y, DCLOTH_AXIS_Z, 1, 0};
    change(&space);
    dcloth_error error = EmptyError();
    EXPECT_EQ(dcloth_cloth_set_space(cloth.get(), &space, &error), DCLOTH_ERROR_ARGUMENT);
    EXPECT_EQ(std::string(error.text + error.what_at, error.what_size), field) << error.text;
    EXPECT_EQ(std::string(error.text + error.found_at, error.found_size), found) << error.text;
    EXPECT_GT(error.allowed_size, 0) << error.text;
  };
  refused("space", "a null pointer, or a struct_size smaller than in 0.1.0",
          [](dcloth_space* s) { s->struct_size = 12; });
  refused("space.left", "6", [](dcloth_space* s) { s->left = 6; });
  refused("space.up", "4294967295", [](dcloth_space* s) { s->up = UINT32_MAX; });
  refused("space.up", "the axis of left", [](dcloth_space* s) { s->up = DCLOTH_AXIS_X; });
  refused("space.up", "the axis of left", [](dcloth_space* s) { s->up = DCLOTH_AXIS_MINUS_X; });
  refused("space.forward", "the axis of left", [](dcloth_space* s) { s->forward = DCLOTH_AXIS_MINUS_X; });
  refused("space.forward", "the axis of up", [](dcloth_space* s) { s->up = DCLOTH_AXIS_MINUS_Z; });
  for (const auto& [unit, found] : std::initializer_list<std::pair<float, const char*>>{{0.0f, "0.00000"},
                                                                                        {-1.0f, "-1.00000"},
                                                                                        {INFINITY, "infinity"},
                                                                                        {NAN, "NaN"},
                                                                                        {2e-5f, "2.00000e-5"},
                                                                                        {2e3f, "2.00000e3"}})
    refused("space.metres_per_unit", found, [unit = unit](dcloth_space* s) { s->metres_per_unit = unit; });
  refused("space.joint_frames", "2", [](dcloth_space* s) { s->joint_frames = 2; });

  const dcloth_space good = {sizeof(good), DCLOTH_AXIS_X, DCLOTH_AXIS_Y, DCLOTH_AXIS_Z, 1, 0};
  dcloth_error error = EmptyError();
  EXPECT_EQ(dcloth_cloth_set_space(nullptr, &good, &error), DCLOTH_ERROR_ARGUMENT);
  EXPECT_EQ(std::string(error.text + error.what_at, error.what_size), "cloth") << error.text;
  EXPECT_EQ(dcloth_cloth_set_space(cloth.get(), nullptr, &error), DCLOTH_ERROR_ARGUMENT);
  EXPECT_EQ(std::string(error.text + error.what_at, error.what_size), "space") << error.text;
  EXPECT_EQ(dcloth_cloth_set_space(nullptr, nullptr, nullptr), DCLOTH_ERROR_ARGUMENT);
}

// A whole skeleton in an order of its own, with joints that the model does not know: the same bits.
TEST_F(HostTest, JointsAreFoundByName) {
  const size_t joints = model_.numbers.spec.joints;
  std::vector<std::string> names;
  for (size_t j = 0; j < joints; ++j) names.push_back("joint_" + std::to_string(j));
  for (const char* other : {"tail", "joint_", "Joint_1", "joint_10"}) names.emplace_back(other);
  std::shuffle(names.begin(), names.end(), std::mt19937(4));
  names.emplace_back("joint_0");  // a second one of the name
  std::vector<const char*> pointers;
  for (const std::string& name : names) pointers.push_back(name.c_str());
  pointers.push_back(nullptr);
  OwnedCloth bound(opened_), plain(opened_);
  ASSERT_EQ(dcloth_cloth_bind_joints(bound.get(), pointers.data(), static_cast<uint32_t>(pointers.size()), nullptr),
            DCLOTH_OK);
  for (int tick = 0; tick < 5; ++tick) {
    const std::vector<float> pose = Pose(tick);
    std::vector<float> host(16 * pointers.size(), NAN);  // what the model does not ask for may hold anything
    for (size_t j = 0; j < joints; ++j) {
      const auto at = std::find(names.begin(), names.end(), "joint_" + std::to_string(j)) - names.begin();
      std::copy_n(pose.begin() + static_cast<ptrdiff_t>(16 * j), 16, host.begin() + 16 * at);
    }
    ASSERT_EQ(bound.Update(host, 1 / 45.0f, kAll), DCLOTH_OK);
    ASSERT_EQ(plain.Update(pose, 1 / 45.0f, kAll), DCLOTH_OK);
    ASSERT_EQ(bound.positions(), plain.positions());
    ASSERT_EQ(bound.Update(pose, 1 / 45.0f, kAll), DCLOTH_ERROR_POSE) << "too few";
  }
}

TEST_F(HostTest, MissingJointsAreListed) {
  OwnedCloth cloth(opened_);
  const char* some[] = {"joint_0", "joint_2", "joint_4", "joint_5", "joint_6", "joint_7", "joint_8"};
  dcloth_error error = EmptyError();
  EXPECT_EQ(dcloth_cloth_bind_joints(cloth.get(), some, 7, &error), DCLOTH_ERROR_JOINTS);
  EXPECT_NE(std::string(error.text).find("2 of 9 joints missing: 'joint_1', 'joint_3'; "), std::string::npos)
      << error.text;
  EXPECT_EQ(error.status, DCLOTH_ERROR_JOINTS);
  EXPECT_EQ(cloth.Tick(Pose(0), kAll), DCLOTH_OK) << "the binding before stays";
  EXPECT_EQ(dcloth_cloth_bind_joints(cloth.get(), some, 0, &error), DCLOTH_ERROR_ARGUMENT);
  EXPECT_EQ(dcloth_cloth_bind_joints(cloth.get(), nullptr, 7, &error), DCLOTH_ERROR_ARGUMENT);
  EXPECT_EQ(dcloth_cloth_bind_joints(nullptr, some, 7, &error), DCLOTH_ERROR_ARGUMENT);

  TestModel rude = BuildModel({});
  rude.tables->character->joint_names[3] = "\x1B[2Jjoint\n";
  const OpenedModel named(rude);
  OwnedCloth told(named);
  EXPECT_EQ(dcloth_cloth_bind_joints(told.get(), some, 7, &error), DCLOTH_ERROR_JOINTS);
  EXPECT_NE(std::string(error.text).find("'joint_1', '?[2Jjoint?'; "), std::string::npos) << error.text;

  ModelSpec spec;
  spec.joints = 100;
  const OpenedModel large(BuildModel(spec));
  OwnedCloth dressed(large);
  EXPECT_EQ(dcloth_cloth_bind_joints(dressed.get(), some, 7, &error), DCLOTH_ERROR_JOINTS);
  const std::string text = error.text;
  EXPECT_NE(text.find("93 of 100 joints missing: 'joint_1', 'joint_3'"), std::string::npos) << text;
  EXPECT_NE(text.find(" more; "), std::string::npos) << text;
  EXPECT_NE(text.find("as in training"), std::string::npos) << "the mend fits too: " << text;
}

}  // namespace
}  // namespace dcloth::testing

// A garment on characters that it was not trained on: other axes, units, bind poses, sizes and names draw what the
// figure would wear; rigs that would crumple it are refused with a word on why; a body moves the cut and the push-out
// onto itself.
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "engine/src/pose/affine.h"
#include "tests/unit/engine/joint_matrices.h"
#include "tests/unit/fit/fit_fixture.h"

namespace dcloth::testing {
namespace {

using engine::Affine;

// Matrices are floats: 2^-24 of some metres, in a pose and in the bind pose, and centimetres on the way.
constexpr float kRounding = 4e-5f;

// About an axis of the world, 0 to 2, through a place.
Affine TurnAbout(int axis, double degrees, const std::array<double, 3>& place) {
  const double angle = degrees * std::numbers::pi / 180, c = std::cos(angle), s = std::sin(angle);
  Affine turn = {};
  const int next = (axis + 1) % 3, last = (axis + 2) % 3;
  turn.m[axis][axis] = 1;
  turn.m[next][next] = turn.m[last][last] = c;
  turn.m[next][last] = -s;
  turn.m[last][next] = s;
  for (int r = 0; r < 3; ++r) {
    turn.m[r][3] = place[static_cast<size_t>(r)];
    for (int k = 0; k < 3; ++k) turn.m[r][3] -= turn.m[r][k] * place[static_cast<size_t>(k)];
  }
  return turn;
}

// A joint's own axes and scale.
Affine RandomFrame(std::mt19937* random, double scale) {
  std::normal_distribution<double> normal;
  double q[4], length = 0;
  for (double& x : q) x = normal(*random), length += x * x;
  for (double& x : q) x /= std::sqrt(length);
  const auto [w, x, y, z] = std::array{q[0], q[1], q[2], q[3]};
  Affine frame = {{{1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y), 0},
                   {2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x), 0},
                   {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y), 0}}};
  for (auto& row : frame.m) {
    for (double& value : row) value *= scale;
  }
  return frame;
}

// Of so many patches: 0 are the paper's stages.
class NetworkFitTest : public FitTest, public ::testing::WithParamInterface<uint32_t> {
 protected:
  NetworkFitTest() : FitTest(0, 0, GetParam()) {}
};
INSTANTIATE_TEST_SUITE_P(Every, NetworkFitTest, ::testing::Values(0u, 6u),
                         [](const auto& test) { return test.param == 0 ? "Stages" : "Patches"; });

// The same body under each naming, with joints of any axes and scale, in any order: the garment of the figure.
TEST_F(FitTest, AnyNamingWearsTheSameGarment) {
  const std::vector<std::string> unreal = {
      "pelvis",     "spine_01", "spine_02", "spine_03", "neck_01", "head",   "clavicle_l", "upperarm_l",
      "lowerarm_l", "hand_l",   "thigh_l",  "calf_l",   "foot_l",  "ball_l", "clavicle_r", "upperarm_r",
      "lowerarm_r", "hand_r",   "thigh_r",  "calf_r",   "foot_r",  "ball_r"};
  const std::vector<std::string> unity = {
      "Hips",          "Spine",         "Chest",         "UpperChest",    "Neck",          "Head",
      "LeftShoulder",  "LeftUpperArm",  "LeftLowerArm",  "LeftHand",      "LeftUpperLeg",  "LeftLowerLeg",
      "LeftFoot",      "LeftToes",      "RightShoulder", "RightUpperArm", "RightLowerArm", "RightHand",
      "RightUpperLeg", "RightLowerLeg", "RightFoot",     "RightToes"};
  const std::vector<std::string> rigify = {
      "DEF-spine",      "DEF-spine.001",   "DEF-spine.002",  "DEF-spine.003",   "DEF-spine.004", "DEF-spine.006",
      "DEF-shoulder.L", "DEF-upper_arm.L", "DEF-forearm.L",  "DEF-hand.L",      "DEF-thigh.L",   "DEF-shin.L",
      "DEF-foot.L",     "DEF-toe.L",       "DEF-shoulder.R", "DEF-upper_arm.R", "DEF-forearm.R", "DEF-hand.R",
      "DEF-thigh.R",    "DEF-shin.R",      "DEF-foot.R",     "DEF-toe.R"};
  std::vector<std::string> mixamo, sketchfab;  // which numbers what it is given, as "Spine_02": not its second one
  for (const std::string& name : names_) mixamo.push_back("mixamorig:" + name);
  for (const std::string& name : mixamo) sketchfab.push_back(name + "_0" + std::to_string(sketchfab.size() + 1));
  std::vector<std::string> humanik, prefixed, prefixed_unreal;
  for (const std::string& name : names_) humanik.push_back("Character1_" + name);
  for (const std::string& name : sketchfab) prefixed.push_back("SK_Hero2-" + name);
  for (const std::string& name : unreal) prefixed_unreal.push_back("Knight:Body_" + name);
  prefixed[5] = "Head";  // one joint in ten may be called otherwise
  uint32_t seed = 1;
  for (const auto& names : {names_, mixamo, sketchfab, unity, unreal, rigify, humanik, prefixed, prefixed_unreal,
                            std::vector<std::string>()}) {
    SCOPED_TRACE(names.empty() ? "roles" : names[0]);
    std::mt19937 random(seed++);
    std::vector<size_t> order(joints());
    for (size_t j = 0; j < joints(); ++j) order[j] = j;
    std::shuffle(order.begin(), order.end(), random);
    std::vector<Affine> frames;
    for (size_t j = 0; j < joints(); ++j) frames.push_back(RandomFrame(&random, j % 2 == 0 ? 1 : 0.01));
    const auto rig = [&](const std::vector<float>& pose) {
      std::vector<float> host;
      for (const size_t j : order) Put(At(pose, j) * frames[j], &host);
      return host;
    };
    Host host;
    host.bind = rig(Training());
    for (const size_t j : order) {
      if (!names.empty()) host.names.push_back(names[j]);
      if (names.empty()) host.roles.push_back(dcloth_role_of_name(names_[j].c_str()));
    }
    OwnedCloth plain(opened_), other(opened_);
    dcloth_fit fit = EmptyFit();
    dcloth_error error = EmptyError();
    ASSERT_EQ(Fit(&other, host, &fit, &error), DCLOTH_OK) << error.text;
    EXPECT_NEAR(fit.scale, 1, 1e-4);
    EXPECT_EQ(fit.warnings, 0u);
    EXPECT_LT(fit.stance_degrees, 0.1f);
    EXPECT_EQ(fit.joints[DCLOTH_ROLE_LEFT_UPPER_LEG],
              std::find(order.begin(), order.end(), Index("LeftUpLeg")) - order.begin());
    for (int frame = 0; frame < 12; ++frame) {
      ASSERT_EQ(plain.Update(Pose(frame), kFrame, kAll), DCLOTH_OK);
      ASSERT_EQ(other.Update(rig(Pose(frame)), kFrame, kAll), DCLOTH_OK);
      for (size_t i = 0; i < plain.positions().size(); ++i)
        ASSERT_NEAR(other.positions()[i], plain.positions()[i], kRounding) << i;
    }
  }
}

// Unreal's axes and centimetres, 1.3 times the size, bound while it faced another way: the figure's garment, 1.3 times.
TEST_P(NetworkFitTest, AnotherSizeAnotherSpaceAnotherWayToFace) {
  const dcloth_space space = {sizeof(space), DCLOTH_AXIS_MINUS_Y,          DCLOTH_AXIS_Z, DCLOTH_AXIS_X,
                              0.01f,         DCLOTH_JOINT_FRAMES_CONVERTED};
  constexpr double kSize = 1.3;
  const auto rig = [&](const std::vector<float>& pose, const Affine& way) {
    std::vector<float> host;
    for (size_t j = 0; j < joints(); ++j) {
      const Affine g = way * At(pose, j);
      Affine h = {};
      for (int c = 0; c < 4; ++c) {
        const double unit = c == 3 ? 100 * kSize : 1;
        h.m[1][c] = -g.m[0][c] * unit, h.m[2][c] = g.m[1][c] * unit, h.m[0][c] = g.m[2][c] * unit;
      }
      Put(h, &host);
    }
    return host;
  };
  const Affine still = TurnAbout(1, 0, {});
  OwnedCloth plain(opened_), other(opened_);
  ASSERT_EQ(dcloth_cloth_set_space(other.get(), &space, nullptr), DCLOTH_OK);
  Host host = FigureHost();
  host.bind = rig(Training(), TurnAbout(1, 130, {0.3, 0, 0.8}));
  dcloth_fit fit = EmptyFit();
  dcloth_error error = EmptyError();
  ASSERT_EQ(Fit(&other, host, &fit, &error), DCLOTH_OK) << error.text;
  EXPECT_NEAR(fit.scale, kSize, 1e-4);
  EXPECT_EQ(fit.warnings, 0u);
  // The bind pose faces 130 degrees to the left of that of the poses, and so does what moves from it.
  for (int frame = 0; frame < 12; ++frame) {
    ASSERT_EQ(plain.Update(Pose(frame), kFrame, kAll), DCLOTH_OK);
    ASSERT_EQ(other.Update(rig(Pose(frame), still), kFrame, kAll), DCLOTH_OK);
    for (size_t i = 0; i < plain.positions().size(); i += 3) {
      const float *p = &plain.positions()[i], *q = &other.positions()[i];
      const float expected[3] = {p[2], -p[0], p[1]};
      for (int a = 0; a < 3; ++a)
        ASSERT_NEAR(q[a], expected[a] * 100 * static_cast<float>(kSize), 100 * 1.3f * kRounding) << i;
    }
  }
}

// Bound with hanging arms and legs apart: the figure's T-pose is made of it.
TEST_P(NetworkFitTest, AStanceOfItsOwn) {
  std::vector<float> bind = Training(), moved;
  for (size_t j = 0; j < joints(); ++j) {
    const std::string& name = names_[j];
    Affine turn = TurnAbout(0, 0, {});
    const double side = name.rfind("Left", 0) == 0 ? 1 : -1;
    if (name.find("Arm") != std::string::npos || name.find("Hand") != std::string::npos)
      turn = TurnAbout(2, -side * 52, {side * 0.17, 1.36, 0});
    if (name.find("Leg") != std::string::npos) turn = TurnAbout(2, side * 8, {side * 0.096, 0.88, 0});
    if (name.find("Foot") != std::string::npos || name.find("Toe") != std::string::npos) {
      // Feet stay level where the legs take them.
      const Affine leg = TurnAbout(2, side * 8, {side * 0.096, 0.88, 0});
      for (int r = 0; r < 3; ++r) turn.m[r][3] = leg.m[r][0] * side * 0.096 + leg.m[r][1] * 0.07 + leg.m[r][3];
      turn.m[0][3] -= side * 0.096, turn.m[1][3] -= 0.07;
    }
    Put(turn * At(bind, j), &moved);
  }
  Host host = FigureHost();
  host.bind = moved;
  OwnedCloth plain(opened_), other(opened_);
  dcloth_fit fit = EmptyFit();
  dcloth_error error = EmptyError();
  ASSERT_EQ(Fit(&other, host, &fit, &error), DCLOTH_OK) << error.text;
  EXPECT_NEAR(fit.stance_degrees, 52, 0.1);
  EXPECT_EQ(fit.warnings, 0u);
  for (int frame = 0; frame < 12; ++frame) {
    ASSERT_EQ(plain.Update(Pose(frame), kFrame, kAll), DCLOTH_OK);
    ASSERT_EQ(other.Update(Pose(frame), kFrame, kAll), DCLOTH_OK);
    for (size_t i = 0; i < plain.positions().size(); ++i)
      ASSERT_NEAR(other.positions()[i], plain.positions()[i], kRounding) << i;
  }
}

// What the figure has and the character lacks is moved by the next joint of the body, and told.
TEST_F(FitTest, OthersStandInForMissingJoints) {
  Host host;
  const std::vector<float> bind = Training();
  for (size_t j = 0; j < joints(); ++j) {
    const std::string& name = names_[j];
    if (name.find("Toe") != std::string::npos || name == "Neck" || name == "Spine1" || name == "Spine2" ||
        name.find("Shoulder") != std::string::npos)
      continue;
    host.names.push_back(name);
    Put(At(bind, j), &host.bind);
  }
  OwnedCloth cloth(opened_);
  dcloth_fit fit = EmptyFit();
  dcloth_error error = EmptyError();
  ASSERT_EQ(Fit(&cloth, host, &fit, &error), DCLOTH_OK) << error.text;
  EXPECT_EQ(fit.warnings, uint32_t{DCLOTH_FIT_STAND_IN | DCLOTH_FIT_FACING});
  EXPECT_EQ(fit.stand_in_role, uint32_t{DCLOTH_ROLE_NECK});
  EXPECT_EQ(fit.joints[DCLOTH_ROLE_NECK], -1);
  EXPECT_EQ(fit.joints[DCLOTH_ROLE_UPPER_CHEST], 1) << "one joint of the spine moves all of it";
  EXPECT_NEAR(fit.scale, 1, 1e-3);
  ASSERT_EQ(cloth.Update(host.bind, kFrame, kAll), DCLOTH_OK);
}

// One fault each, on a rig that else fits.
TEST_F(FitTest, RefusesRigsThatWouldCrumpleIt) {
  const Host good = FigureHost();
  const auto changed = [&](const std::function<Affine(const std::string&, const Affine&)>& change) {
    Host host = good;
    host.bind.clear();
    for (size_t j = 0; j < joints(); ++j) Put(change(names_[j], At(good.bind, j)), &host.bind);
    return host;
  };
  const auto has = [](const std::string& name, const char* part) { return name.find(part) != std::string::npos; };
  {
    SCOPED_TRACE("sits");
    ExpectRefused(changed([&](const std::string& name, const Affine& m) {
                    const double side = has(name, "Left") ? 1 : -1;
                    return has(name, "Leg") || has(name, "Foot") || has(name, "Toe")
                               ? TurnAbout(0, -90, {side * 0.096, 0.88, 0}) * m
                               : m;
                  }),
                  DCLOTH_ERROR_POSE, "'LeftUpLeg' (left upper leg) at 90 degrees", "T or A pose");
  }
  {
    SCOPED_TRACE("a frame of a dance: one arm across");
    ExpectRefused(changed([&](const std::string& name, const Affine& m) {
                    return has(name, "RightArm") || has(name, "RightFore") || has(name, "RightHand")
                               ? TurnAbout(1, 170, {-0.17, 1.36, 0}) * m
                               : m;
                  }),
                  DCLOTH_ERROR_POSE, "(right upper arm) at 170 degrees", "not a pose of an animation");
  }
  {
    SCOPED_TRACE("+Z up in a space that says +Y");
    ExpectRefused(changed([&](const std::string&, const Affine& m) { return TurnAbout(0, 90, {}) * m; }),
                  DCLOTH_ERROR_POSE, "stands along +Z", "set the space");
  }
  {
    SCOPED_TRACE("centimetres in a space that says metres");
    ExpectRefused(changed([&](const std::string&, const Affine& m) {
                    Affine scaled = m;
                    for (auto& row : scaled.m) row[3] *= 100;
                    return scaled;
                  }),
                  DCLOTH_ERROR_POSE, "100 times", "centimetres");
  }
  {
    SCOPED_TRACE("metres in a space that says centimetres");
    const dcloth_space space = {sizeof(space), DCLOTH_AXIS_X, DCLOTH_AXIS_Y, DCLOTH_AXIS_Z, 0.01f, 0};
    ExpectRefused(good, DCLOTH_ERROR_POSE, "0.01 times", "metres", &space);
  }
  {
    SCOPED_TRACE("left and right swapped by name");
    Host host = good;
    for (std::string& name : host.names) {
      if (has(name, "Left"))
        name = "Right" + name.substr(4);
      else if (has(name, "Right"))
        name = "Left" + name.substr(5);
    }
    ExpectRefused(host, DCLOTH_ERROR_POSE, "toes that point backwards", "swapped");
  }
  {
    SCOPED_TRACE("a left-handed host that did not say so");
    ExpectRefused(changed([&](const std::string&, const Affine& m) {
                    Affine mirrored = m;
                    for (int c = 0; c < 4; ++c) mirrored.m[0][c] = -m.m[0][c];
                    return mirrored;
                  }),
                  DCLOTH_ERROR_POSE, "toes that point backwards", "handedness");
  }
  {
    SCOPED_TRACE("arms swapped, legs not");
    Host host = good;
    for (std::string& name : host.names) {
      if (name == "LeftArm")
        name = "RightArm";
      else if (name == "RightArm")
        name = "LeftArm";
    }
    ExpectRefused(host, DCLOTH_ERROR_POSE, "to the right of", "swapped");
  }
  {
    SCOPED_TRACE("local matrices in place of joint to world");
    ExpectRefused(changed([&](const std::string& name, const Affine& m) {
                    Affine local = m;
                    for (auto& row : local.m) row[3] = 0;
                    if (name == "Hips") local.m[1][3] = 0.93;
                    return local;
                  }),
                  DCLOTH_ERROR_POSE, "in one place", "joint to world");
  }
  {
    SCOPED_TRACE("a bone torn off");
    ExpectRefused(changed([&](const std::string& name, const Affine& m) {
                    Affine far = m;
                    if (name == "LeftHand") far.m[0][3] += 1.5;
                    return far;
                  }),
                  DCLOTH_ERROR_POSE, "7.82 times the figure's length from 'LeftForeArm'", "joint to world");
  }
  {
    SCOPED_TRACE("no legs");
    Host host = good;
    for (std::string& name : host.names) {
      if (has(name, "UpLeg")) name = "wheel";
    }
    ExpectRefused(host, DCLOTH_ERROR_JOINTS, "'left upper leg', 'right upper leg'", "joint_roles");
  }
  {
    SCOPED_TRACE("no names that say anything");
    Host host = good;
    for (size_t j = 0; j < host.names.size(); ++j) host.names[j] = "pole" + std::to_string(j);
    ExpectRefused(host, DCLOTH_ERROR_JOINTS, "'left upper arm' and 14 more", "joint_roles");
  }
  {
    SCOPED_TRACE("no spine");
    Host host = good;
    for (std::string& name : host.names) {
      if (has(name, "Spine")) name = "pole";
    }
    ExpectRefused(host, DCLOTH_ERROR_JOINTS, "no joint for 'spine'", "joint_roles");
  }
  for (const float wrong : {std::nanf(""), HUGE_VALF, 2e9f}) {
    SCOPED_TRACE(wrong);
    Host host = good;
    host.bind[16 * Index("Spine1") + 5] = wrong;
    ExpectRefused(host, DCLOTH_ERROR_POSE, "NaN, a number beyond 1e9", "joint to world");
  }
  {
    SCOPED_TRACE("a joint of no size");
    Host host = good;
    for (size_t i = 0; i < 12; ++i) {
      if (i % 4 != 3) host.bind[16 * Index("RightFoot") + i] = 0;
    }
    ExpectRefused(host, DCLOTH_ERROR_POSE, "without inverse", "a scale other than 0");
  }
  {
    SCOPED_TRACE("a role twice");
    Host host = good;
    for (const std::string& name : names_) host.roles.push_back(dcloth_role_of_name(name.c_str()));
    host.roles[Index("Head")] = DCLOTH_ROLE_HIPS;
    OwnedCloth cloth(opened_);
    dcloth_error error = EmptyError();
    EXPECT_EQ(Fit(&cloth, host, nullptr, &error), DCLOTH_ERROR_ARGUMENT);
    EXPECT_NE(std::string(error.text).find("a role that another joint has"), std::string::npos) << error.text;
    host.roles[Index("Head")] = 23;
    EXPECT_EQ(Fit(&cloth, host), DCLOTH_ERROR_ARGUMENT);
  }
}

TEST_F(FitTest, RefusesBrokenCalls) {
  OwnedCloth cloth(opened_);
  const Host host = FigureHost();
  dcloth_character character = {};
  EXPECT_EQ(dcloth_cloth_fit(cloth.get(), nullptr, nullptr, 0, nullptr, nullptr), DCLOTH_ERROR_ARGUMENT);
  EXPECT_EQ(dcloth_cloth_fit(cloth.get(), &character, nullptr, 0, nullptr, nullptr), DCLOTH_ERROR_ARGUMENT);
  EXPECT_EQ(dcloth_fit_storage_size(opened_.get(), &character), 0u);
  EXPECT_EQ(dcloth_fit_storage_size(nullptr, nullptr), 0u);
  character.struct_size = sizeof(character);
  character.joint_count = static_cast<uint32_t>(joints());
  EXPECT_EQ(dcloth_cloth_fit(cloth.get(), &character, nullptr, 0, nullptr, nullptr), DCLOTH_ERROR_ARGUMENT);
  character.bind_matrices = host.bind.data();
  EXPECT_EQ(dcloth_cloth_fit(cloth.get(), &character, nullptr, 0, nullptr, nullptr), DCLOTH_ERROR_ARGUMENT);
  EXPECT_EQ(dcloth_cloth_fit(nullptr, &character, nullptr, 0, nullptr, nullptr), DCLOTH_ERROR_ARGUMENT);
  ASSERT_EQ(Fit(&cloth, host), DCLOTH_OK);
  // What the fit decided is not changed piece by piece; another fit may follow.
  const dcloth_space space = {sizeof(space), DCLOTH_AXIS_X, DCLOTH_AXIS_Y, DCLOTH_AXIS_Z, 1, 0};
  const dcloth_pose bind = OwnedCloth::Pose(host.bind);
  const auto refused = [&](auto call) {  // by the cloth: nothing is wrong with the other argument
    dcloth_error error = EmptyError();
    EXPECT_EQ(call(&error), DCLOTH_ERROR_ARGUMENT);
    EXPECT_EQ(std::string(error.text + error.what_at, error.what_size), "cloth") << error.text;
    EXPECT_NE(std::string(error.text).find("before dcloth_cloth_set_fit"), std::string::npos) << error.text;
  };
  refused([&](dcloth_error* error) { return dcloth_cloth_set_space(cloth.get(), &space, error); });
  refused([&](dcloth_error* error) { return dcloth_cloth_set_bind_pose(cloth.get(), &bind, error); });
  dcloth_fit fit = EmptyFit();
  ASSERT_EQ(Fit(&cloth, host, &fit), DCLOTH_OK);
  EXPECT_NEAR(fit.scale, 1, 1e-4) << "the scale of the fit before is none of the host's";
}

TEST_F(BodyFitTest, MovesTheSurfaceOntoTheSkin) {
  for (const double girth : {1.0, 0.9, 1.15}) {
    SCOPED_TRACE(girth);
    OwnedCloth cloth(opened_);
    dcloth_fit fit = EmptyFit();
    dcloth_error error = EmptyError();
    const Host host = Wearer(girth);
    ASSERT_EQ(Fit(&cloth, host, &fit, &error), DCLOTH_OK) << error.text;
    EXPECT_NEAR(fit.bone_scale, 1, 1e-4);
    if (fit.hips_ratio != 0) {
      EXPECT_NEAR(fit.hips_ratio, girth, 0.03);
    }
    const double fitted = Deepest(&cloth, host);
    // The model's 2 mm and 3 more. Vertices of the surface meet the skin, its triangles of 4 cm bend a little under it;
    // the test's coarse cloth is lifted further, until none of its edges and triangles cuts the egg, and gives way
    // around.
    EXPECT_LT(fitted, -0.004);
    EXPECT_GT(fitted, -0.025);
    if (girth <= 1) continue;
    OwnedCloth bones(opened_);
    Host bare = host;
    bare.body.clear();
    ASSERT_EQ(Fit(&bones, bare), DCLOTH_OK);
    EXPECT_GT(Deepest(&bones, host), 0.01) << "a test in which the body makes no difference";
  }
}

// A knob of skin as large as a toe beside the egg, as the next toe is beside a toe: the outermost skin over the egg's
// vertices, and none of theirs. A file may turn its triangles either way.
TEST_F(BodyFitTest, SkinOfAPartBesideDoesNotMoveTheSurface) {
  constexpr double kGap = 0.04, kRadius = 0.03;
  constexpr int kRings = 12, kSegments = 16;
  const auto drawn = [&](Host host) {
    OwnedCloth cloth(opened_);
    dcloth_fit fit = EmptyFit();
    EXPECT_EQ(Fit(&cloth, host, &fit), DCLOTH_OK);
    EXPECT_NEAR(fit.scale, 1, 0.002);
    std::vector<float> positions(3 * size_t{opened_.info().vertex_count});
    dcloth_output output = FloatOutput(positions.size() / 3, positions.data(), 12, nullptr);
    output.flags = DCLOTH_OUTPUT_OUTSIDE_BODY;
    const dcloth_pose pose = OwnedCloth::Pose(host.bind);
    const dcloth_frame frame = {sizeof(frame), kAll, kFrame, 0, nullptr};
    EXPECT_EQ(dcloth_cloth_update(cloth.get(), &pose, &frame, &output, nullptr), DCLOTH_OK);
    return positions;
  };
  const Host alone = Wearer(1);
  Host host = alone;
  // Over the vertices of one meridian, up and down: one knob each.
  for (size_t vertex = 0; vertex < egg_.positions.size() / 3 - 2; vertex += 15) {
    const float* at = &egg_.positions[3 * vertex];
    const double out[3] = {static_cast<double>(at[0]) / 0.09, (static_cast<double>(at[1]) - 0.6) / 0.2025,
                           static_cast<double>(at[2]) / 0.0676};
    const double length = std::sqrt(out[0] * out[0] + out[1] * out[1] + out[2] * out[2]);
    const auto first = static_cast<uint32_t>(host.body.size() / 3);
    for (int r = 0; r <= kRings; ++r) {
      for (int s = 0; s < kSegments; ++s) {
        const double down = std::numbers::pi * r / kRings, turn = 2 * std::numbers::pi * s / kSegments;
        const double ball[3] = {std::sin(down) * std::cos(turn), std::cos(down), std::sin(down) * std::sin(turn)};
        for (size_t c = 0; c < 3; ++c)
          host.body.push_back(
              static_cast<float>(static_cast<double>(at[c]) + (kGap + kRadius) * out[c] / length + kRadius * ball[c]));
        for (size_t k = 0; k < 2; ++k) {
          host.body_joints.push_back(egg_.joints[2 * vertex + k]);
          host.body_weights.push_back(egg_.weights[2 * vertex + k]);
        }
        if (r == kRings) continue;
        const auto next = static_cast<uint32_t>((s + 1) % kSegments);
        const uint32_t a = first + static_cast<uint32_t>(r * kSegments), b = a + kSegments,
                       i = static_cast<uint32_t>(s);
        host.triangles.insert(host.triangles.end(), {a + i, a + next, b + next, a + i, b + next, b + i});
      }
    }
  }
  const std::vector<float> expected = drawn(alone);
  for (const bool turned : {false, true}) {
    for (size_t t = 0; turned && t < host.triangles.size(); t += 3) std::swap(host.triangles[t], host.triangles[t + 1]);
    const std::vector<float> found = drawn(host);
    ASSERT_EQ(found.size(), expected.size());
    float most = 0;
    for (size_t i = 0; i < found.size(); ++i) most = std::max(most, std::fabs(found[i] - expected[i]));
    EXPECT_LT(most, 0.001f) << (turned ? "turned" : "");
  }
}

// A character whose skin goes with other joints than the figure's: the surface bends as that skin does.
TEST_F(BodyFitTest, TheSurfaceIsHeldAsTheSkinIs) {
  EggBody stiff = egg_;
  for (size_t i = 0; i < stiff.weights.size(); ++i) {
    stiff.joints[i] = static_cast<uint8_t>(Index("Spine"));
    stiff.weights[i] = i % 2 == 0 ? 1 : 0;
  }
  Host host = Wearer(1);
  host.body_joints.assign(stiff.joints.begin(), stiff.joints.end());
  host.body_weights = stiff.weights;
  double otherwise = 0;
  for (int frame = 0; frame < 8; ++frame) {
    const std::vector<float> pose = Pose(7 * frame);
    OwnedCloth cloth(opened_), plain(opened_);
    ASSERT_EQ(Fit(&cloth, host), DCLOTH_OK);
    const std::vector<Point> skin = PoseBody(stiff, model_.numbers, pose);
    EXPECT_LT(DeepestUnder(&cloth, pose, egg_, skin), 0.003) << frame;
    otherwise = std::max(otherwise, DeepestUnder(&plain, pose, egg_, skin));
  }
  EXPECT_GT(otherwise, 0.05) << "a test in which the joints make no difference";
}

// Rings 4 cm apart; vertices of the bundled garments' bodies are 2 to 4.
class FineBodyFitTest : public BodyFitTest {
 protected:
  static constexpr uint32_t kRings = 36, kSegments = 32;
  FineBodyFitTest() : BodyFitTest(kRings, kSegments) {}
};

// Hems that stand out of the skin between the surface's vertices, by 15 mm. The skin goes with a joint that carries it
// into the cloth.
TEST_F(FineBodyFitTest, HemsBetweenItsVerticesCount) {
  TestModel fine = BuildModel({.skeleton_joints = Figure()});
  constexpr uint32_t kSkinRings = 8 * kRings + 7;  // three of eight lie in the middle of two of the surface's
  EggBody skin = AddBody(&fine, kSkinRings, kSegments);
  for (size_t v = 0; v < skin.positions.size() / 3; ++v) {
    const double out =
        v < kSkinRings * kSegments && (v / kSegments + 1) % 8 >= 3 && (v / kSegments + 1) % 8 <= 5 ? 1.05 : 1;
    skin.positions[3 * v] *= static_cast<float>(out);
    skin.positions[3 * v + 2] *= static_cast<float>(out);
    skin.joints[2 * v] = static_cast<uint8_t>(Index("Spine"));
    skin.weights[2 * v] = 1, skin.weights[2 * v + 1] = 0;
  }
  Host host = FigureHost();
  host.body = skin.positions;
  host.body_joints.assign(skin.joints.begin(), skin.joints.end());
  host.body_weights = skin.weights;
  host.triangles.assign(skin.faces.begin(), skin.faces.end());
  for (int frame = 0; frame < 8; ++frame) {
    const std::vector<float> pose = Pose(3 * frame);
    OwnedCloth cloth(opened_);
    ASSERT_EQ(Fit(&cloth, host), DCLOTH_OK);
    EXPECT_LT(DeepestUnder(&cloth, pose, skin, PoseBody(skin, model_.numbers, pose)), 0.002) << frame;
  }
}

// A shirt close over the skin; a shell that stands 30 mm and more off it, as a robot's over its joints: cloth lies on
// them.
TEST_F(BodyFitTest, LayersOverTheSkinCount) {
  for (const double girth : {1.02, 1.16}) {
    SCOPED_TRACE(girth);
    const Host layer = Wearer(girth);
    Host host = Wearer(1);
    const auto first = static_cast<uint32_t>(host.body.size() / 3);
    host.body.insert(host.body.end(), layer.body.begin(), layer.body.end());
    host.body_joints.insert(host.body_joints.end(), layer.body_joints.begin(), layer.body_joints.end());
    host.body_weights.insert(host.body_weights.end(), layer.body_weights.begin(), layer.body_weights.end());
    for (const uint32_t corner : layer.triangles) host.triangles.push_back(first + corner);
    OwnedCloth cloth(opened_);
    ASSERT_EQ(Fit(&cloth, host), DCLOTH_OK);
    EXPECT_LT(Deepest(&cloth, layer), 0.003);
  }
}

TEST_F(BodyFitTest, ChecksTheBodyAndItsStorage) {
  OwnedCloth cloth(opened_);
  const auto refused = [&](const std::function<void(Host*)>& spoil) {
    Host host = Wearer(1);
    spoil(&host);
    return Fit(&cloth, host) == DCLOTH_ERROR_ARGUMENT;
  };
  EXPECT_TRUE(refused([](Host* host) { host->body[7] = std::nanf(""); }));
  EXPECT_TRUE(refused([](Host* host) { host->body_joints[3] = 22; }));
  EXPECT_TRUE(refused([](Host* host) { host->body_weights[3] = -1; }));
  EXPECT_TRUE(refused([](Host* host) { host->body_weights[3] = std::nanf(""); }));
  EXPECT_TRUE(refused([](Host* host) { host->triangles[5] = 100000; }));
  // Storage of exactly the size, one byte less, off its alignment.
  const Host host = Wearer(1);
  std::vector<const char*> names;
  for (const std::string& name : host.names) names.push_back(name.c_str());
  dcloth_character character = {};
  character.struct_size = sizeof(character);
  character.joint_count = static_cast<uint32_t>(joints());
  character.joint_names = names.data();
  character.bind_matrices = host.bind.data();
  character.body_vertex_count = static_cast<uint32_t>(host.body.size() / 3);
  character.body_positions = host.body.data();
  character.body_joints = host.body_joints.data();
  character.body_weights = host.body_weights.data();
  character.body_influences = 2;
  const size_t size = dcloth_fit_storage_size(opened_.get(), &character);
  AlignedBytes storage(size);
  EXPECT_EQ(dcloth_cloth_fit(cloth.get(), &character, storage.data(), size - 1, nullptr, nullptr), DCLOTH_ERROR_MEMORY);
  EXPECT_EQ(dcloth_cloth_fit(cloth.get(), &character, nullptr, size, nullptr, nullptr), DCLOTH_ERROR_ARGUMENT);
  EXPECT_EQ(dcloth_cloth_fit(cloth.get(), &character, storage.data(), size, nullptr, nullptr), DCLOTH_OK);
}

}  // namespace
}  // namespace dcloth::testing

// What engine plugins share: its vertices are those of a host of the C ABI to the bit, in Godot's space and in
// Unreal's, near the origin and far from it; what it refuses changes nothing.
#include "garment/garment.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <string>
#include <vector>

#include "engine/src/pose/affine.h"
#include "tests/unit/engine/cloth_fixture.h"
#include "tests/unit/engine/joint_matrices.h"
#include "tests/unit/engine/test_body.h"

namespace dcloth::testing {
namespace {

using engine::Affine;
using platforms::Garment;
using platforms::GarmentFrame;
using platforms::GarmentModel;
using platforms::Match;
using platforms::Wearer;

constexpr float kFrame = 1 / 45.0f;
constexpr dcloth_space kGodot = {sizeof(dcloth_space), DCLOTH_AXIS_X, DCLOTH_AXIS_Y, DCLOTH_AXIS_Z, 1, 0};
constexpr dcloth_space kUnreal = {sizeof(dcloth_space), DCLOTH_AXIS_MINUS_Y, DCLOTH_AXIS_Z, DCLOTH_AXIS_X, 0.01f, 0};

using Columns = std::array<double, 16>;
using Place = std::array<double, 3>;

// A figure in T-pose, metres, facing +Z, left along +X.
std::vector<std::pair<std::string, Place>> Figure() {
  std::vector<std::pair<std::string, Place>> joints = {{"Hips", {0, 0.93, 0}},   {"Spine", {0, 1.05, 0}},
                                                       {"Spine1", {0, 1.16, 0}}, {"Spine2", {0, 1.28, 0}},
                                                       {"Neck", {0, 1.43, 0}},   {"Head", {0, 1.5, 0}}};
  for (const double side : {1.0, -1.0}) {
    const std::string name = side > 0 ? "Left" : "Right";
    joints.insert(joints.end(), {{name + "Shoulder", {side * 0.06, 1.4, 0}},
                                 {name + "Arm", {side * 0.17, 1.36, 0}},
                                 {name + "ForeArm", {side * 0.42, 1.36, 0}},
                                 {name + "Hand", {side * 0.64, 1.36, 0}},
                                 {name + "UpLeg", {side * 0.096, 0.88, 0}},
                                 {name + "Leg", {side * 0.096, 0.48, 0}},
                                 {name + "Foot", {side * 0.096, 0.07, 0}},
                                 {name + "ToeBase", {side * 0.095, 0.025, 0.12}}});
  }
  return joints;
}

// Training's space to Unreal's: x = 100 z, y = -100 x, z = 100 y.
Place UnrealPoint(const Place& p) { return {100 * p[2], -100 * p[0], 100 * p[1]}; }
Columns UnrealMatrix(const Columns& m) {
  const auto turn = [](const double* v) { return Place{v[2], -v[0], v[1]}; };
  // The joint's own axes are converted too: Unreal's x is training's z, its y training's -x, its z training's y.
  const Place x = turn(&m[8]), left = turn(&m[0]), z = turn(&m[4]), at = UnrealPoint({m[12], m[13], m[14]});
  return {x[0], x[1], x[2], 0, -left[0], -left[1], -left[2], 0, z[0], z[1], z[2], 0, at[0], at[1], at[2], 1};
}

class GarmentTest : public ::testing::Test {
 protected:
  GarmentTest()
      : model_([&] {
          ModelSpec spec;
          spec.skeleton_joints = Figure();
          spec.texture = true;
          spec.joints = spec.bones = static_cast<uint32_t>(spec.skeleton_joints.size());
          TestModel model = BuildModel(spec);
          egg_ = AddBody(&model, 28, 30);
          return model;
        }()),
        opened_(model_) {
    const AlignedBytes bytes = model_.Bytes();
    std::string error;
    shared_ = GarmentModel::Open(bytes.data(), bytes.size(), &error);
    EXPECT_NE(shared_, nullptr) << error;
    for (const auto& joint : Figure()) names_.push_back(joint.first);
  }

  size_t joints() const { return names_.size(); }

  // A joint's own axes: each its own turn about x, in a rig that is not the figure's.
  static Affine OwnAxes(size_t joint, double scale) {
    const double c = std::cos(0.3 * static_cast<double>(joint)) * scale,
                 s = std::sin(0.3 * static_cast<double>(joint)) * scale;
    return {{{scale, 0, 0, 0}, {0, c, -s, 0}, {0, s, c, 0}}};
  }
  static Columns ColumnsOf(const Affine& a) {
    Columns m = {};
    for (size_t i = 0; i < 12; ++i) m[4 * (i % 4) + i / 4] = a.m[i / 4][i % 4];
    m[15] = 1;
    return m;
  }
  // The figure's joints [joints, 16], rows contiguous, as a rig with axes (and a scale) of its own has them.
  std::vector<Columns> Rig(const std::vector<float>& matrices, double scale, bool unreal) const {
    std::vector<Columns> rig;
    for (size_t j = 0; j < joints(); ++j) {
      const Columns m = ColumnsOf(At(matrices, j) * OwnAxes(scale == 0 ? 0 : j, scale == 0 ? 1 : scale));
      rig.push_back(unreal ? UnrealMatrix(m) : m);
    }
    return rig;
  }
  std::vector<float> Pose(int frame) const { return PoseAt(model_.numbers, frame / 45.0); }

  Wearer Dressed(double scale, bool unreal) const {
    Wearer wearer;
    const std::vector<Columns> binds = Rig(BindMatrices(model_.numbers, joints()), scale, unreal);
    for (size_t j = 0; j < joints(); ++j) wearer.AddJoint(names_[j], binds[j].data());
    for (size_t v = 0; v < egg_.positions.size() / 3; ++v) {
      const float* p = &egg_.positions[3 * v];
      const Place place = {p[0], p[1], p[2]}, at = unreal ? UnrealPoint(place) : place;
      const uint32_t carriers[] = {egg_.joints[2 * v], egg_.joints[2 * v + 1]};
      wearer.AddBodyVertex(at.data(), carriers, &egg_.weights[2 * v], 2);
    }
    wearer.body_triangles.assign(egg_.faces.begin(), egg_.faces.end());
    return wearer;
  }

  std::unique_ptr<Garment> Make(const dcloth_space& space, const Wearer& wearer, Match match) const {
    std::string error;
    std::unique_ptr<Garment> garment = Garment::Create(shared_, space, wearer, match, &error);
    EXPECT_NE(garment, nullptr) << error;
    return garment;
  }
  static void SetJoints(Garment* garment, const std::vector<Columns>& rig, const Place& offset = {}) {
    for (size_t j = 0; j < rig.size(); ++j) {
      Columns m = rig[j];
      for (size_t i = 0; i < 3; ++i) m[12 + i] += offset[i];
      garment->SetJoint(j, m.data());
    }
  }

  EggBody egg_;  // before what fills it in
  TestModel model_;
  OpenedModel opened_;
  std::shared_ptr<const GarmentModel> shared_;
  std::vector<std::string> names_;
};

// A host of the C ABI with the same numbers.
class Host {
 public:
  Host(const OpenedModel& model, const dcloth_space& space, const Wearer& wearer, Match match)
      : cloth_(model), storage_(1), positions_(3 * model.info().textured_vertex_count), normals_(positions_.size()) {
    dcloth_error error = EmptyError();
    EXPECT_EQ(dcloth_cloth_set_space(cloth_.get(), &space, &error), DCLOTH_OK) << error.text;
    std::vector<const char*> names;
    for (const std::string& name : wearer.joint_names) names.push_back(name.c_str());
    const auto count = static_cast<uint32_t>(names.size());
    if (match == Match::kNames) {
      EXPECT_EQ(dcloth_cloth_bind_joints(cloth_.get(), names.data(), count, &error), DCLOTH_OK) << error.text;
      return;
    }
    dcloth_character character = {};
    character.struct_size = sizeof(character);
    character.joint_count = count;
    character.joint_names = names.data();
    character.bind_matrices = wearer.bind_matrices.data();
    character.column_major = 1;
    if (match == Match::kBody) {
      character.body_vertex_count = wearer.body_vertex_count();
      character.body_positions = wearer.body_positions.data();
      character.body_joints = wearer.body_joints.data();
      character.body_weights = wearer.body_weights.data();
      character.body_influences = Wearer::kInfluences;
      character.body_triangles = wearer.body_triangles.data();
      character.body_triangle_count = static_cast<uint32_t>(wearer.body_triangles.size() / 3);
    }
    storage_ = AlignedBytes(std::max<size_t>(dcloth_fit_storage_size(model.get(), &character), 1));
    EXPECT_EQ(dcloth_cloth_fit(cloth_.get(), &character, match == Match::kBody ? storage_.data() : nullptr,
                               match == Match::kBody ? storage_.size() : 0, nullptr, &error),
              DCLOTH_OK)
        << error.text;
  }

  dcloth_status Update(const std::vector<Columns>& rig, float seconds, uint32_t stages, uint32_t flags, bool outside,
                       bool draw = true) {
    std::vector<float> matrices;
    for (const Columns& m : rig) {
      for (const double value : m) matrices.push_back(static_cast<float>(value));
    }
    const dcloth_pose pose = {sizeof(pose), static_cast<uint32_t>(rig.size()), matrices.data(), 1, 0};
    const dcloth_frame frame = {sizeof(frame), stages, seconds, flags, nullptr};
    dcloth_output output = MakeOutput(positions_.data(), normals_.data(), static_cast<uint32_t>(positions_.size() / 3));
    output.flags = DCLOTH_OUTPUT_TEXTURED | (outside ? uint32_t{DCLOTH_OUTPUT_OUTSIDE_BODY} : 0);
    return dcloth_cloth_update(cloth_.get(), &pose, &frame, draw ? &output : nullptr, nullptr);
  }

  OwnedCloth& cloth() { return cloth_; }
  const std::vector<float>& positions() const { return positions_; }
  const std::vector<float>& normals() const { return normals_; }

 private:
  OwnedCloth cloth_;
  AlignedBytes storage_;
  std::vector<float> positions_, normals_;
};

TEST_F(GarmentTest, EverySpaceAndMatchHasTheVerticesOfTheCAbi) {
  for (const bool unreal : {false, true}) {
    for (const Match match : {Match::kNames, Match::kBones, Match::kBody}) {
      // Names stand for joints with the axes of training; scaled joints are what files in centimetres give.
      const double scale = match == Match::kNames ? 0 : 100;
      const dcloth_space& space = unreal ? kUnreal : kGodot;
      const Wearer wearer = Dressed(scale, unreal);
      const std::unique_ptr<Garment> garment = Make(space, wearer, match);
      Host host(opened_, space, wearer, match);
      GarmentFrame frame;
      frame.seconds = kFrame;
      size_t moved = 0;
      for (int f = 0; f < 60; ++f) {
        const std::vector<Columns> rig = Rig(Pose(f), scale, unreal);
        SetJoints(garment.get(), rig);
        const std::vector<float> before = garment->positions();
        ASSERT_TRUE(garment->Update(frame, nullptr));
        ASSERT_EQ(host.Update(rig, kFrame, DCLOTH_STAGES_MESH, 0, true), DCLOTH_OK);
        ASSERT_EQ(garment->positions(), host.positions()) << "frame " << f;
        ASSERT_EQ(garment->normals(), host.normals()) << "frame " << f;
        moved += garment->positions() != before;
      }
      EXPECT_EQ(moved, 60u);
      EXPECT_EQ(garment->fit().struct_size == 0, match == Match::kNames);
      for (size_t i = 0; i < 3; ++i) {
        float least = std::numeric_limits<float>::infinity(), most = -least;
        for (size_t v = i; v < garment->positions().size(); v += 3) {
          least = std::min(least, garment->positions()[v]);
          most = std::max(most, garment->positions()[v]);
        }
        EXPECT_EQ(garment->bounds()[i], least);
        EXPECT_EQ(garment->bounds()[i + 3], most);
      }
    }
  }
}

// The same figure in both engines, against the figure of training itself.
TEST_F(GarmentTest, EnginesAgreeWithin001Mm) {
  for (const Match match : {Match::kNames, Match::kBones}) {
    const double scale = match == Match::kNames ? 0 : 100;
    const std::unique_ptr<Garment> godot = Make(kGodot, Dressed(scale, false), match),
                                   unreal = Make(kUnreal, Dressed(scale, true), match);
    OwnedCloth plain(opened_);
    GarmentFrame frame;
    frame.seconds = kFrame;
    frame.outside_body = false;
    double worst = 0;
    for (int f = 0; f < 90; ++f) {
      SetJoints(godot.get(), Rig(Pose(f), scale, false));
      SetJoints(unreal.get(), Rig(Pose(f), scale, true));
      ASSERT_TRUE(godot->Update(frame, nullptr) && unreal->Update(frame, nullptr));
      ASSERT_EQ(plain.Update(Pose(f), kFrame, DCLOTH_STAGES_MESH), DCLOTH_OK);
      for (size_t v = 0; v < plain.positions().size(); v += 3) {
        const float* p = &plain.positions()[v];
        const Place there = UnrealPoint({p[0], p[1], p[2]});
        for (size_t i = 0; i < 3; ++i) {
          worst = std::max(worst, std::abs(static_cast<double>(godot->positions()[v + i]) - p[i]));
          worst = std::max(worst, std::abs(static_cast<double>(unreal->positions()[v + i]) - there[i]) / 100);
        }
      }
    }
    EXPECT_LT(worst, 1e-5) << "metres";
    RecordProperty("worst_mm", std::to_string(1000 * worst));
  }
}

// 200 km from the world's origin floats are 16 mm apart; the garment's own origin keeps them small.
TEST_F(GarmentTest, PlaceInTheWorldDoesNotMatter) {
  const Place far = {2e5, 30, -1.5e5};
  const Wearer wearer = Dressed(1, false);
  const std::unique_ptr<Garment> near = Make(kGodot, wearer, Match::kBones),
                                 there = Make(kGodot, wearer, Match::kBones);
  GarmentFrame frame;
  frame.seconds = kFrame;
  EXPECT_TRUE(there->Follow(far.data(), 1000));
  for (int f = 0; f < 30; ++f) {
    const std::vector<Columns> rig = Rig(Pose(f), 1, false);
    EXPECT_FALSE(there->Follow(std::array{far[0] + 0.01 * f, far[1], far[2]}.data(), 1000));
    SetJoints(near.get(), rig);
    SetJoints(there.get(), rig, far);
    ASSERT_TRUE(near->Update(frame, nullptr) && there->Update(frame, nullptr));
    ASSERT_EQ(near->positions(), there->positions()) << "frame " << f;
  }
}

// The origin moves with the character now and then, in the plugins every 100 m. The cloth goes on with the velocity of
// the frame before: it misses that frame's change of speed, of some millimetres, and nobody sees that.
TEST_F(GarmentTest, AMovedOriginIsNotSeen) {
  const Wearer wearer = Dressed(1, false);
  const std::unique_ptr<Garment> still = Make(kGodot, wearer, Match::kBones),
                                 moves = Make(kGodot, wearer, Match::kBones);
  GarmentFrame frame;
  frame.seconds = kFrame;
  int origins = 0;
  double worst = 0;
  for (int f = 0; f < 200; ++f) {
    const std::vector<Columns> rig = Rig(Pose(f), 1, false);
    const Place hips = {rig[0][12], rig[0][13], rig[0][14]};
    origins += moves->Follow(hips.data(), 1);
    SetJoints(still.get(), rig);
    SetJoints(moves.get(), rig);
    ASSERT_TRUE(still->Update(frame, nullptr) && moves->Update(frame, nullptr));
    for (size_t i = 0; i < still->positions().size(); ++i) {
      const double at = moves->positions()[i] + moves->origin()[i % 3];
      worst = std::max(worst, std::abs(at - still->positions()[i]));
    }
  }
  EXPECT_GT(origins, 2);
  EXPECT_LT(worst, 0.003) << "metres, with " << origins << " origins";
  std::printf("%d origins, worst %.2f mm\n", origins, 1000 * worst);
}

TEST_F(GarmentTest, SettingsReachTheCloth) {
  const Wearer wearer = Dressed(0, false);
  const std::unique_ptr<Garment> garment = Make(kGodot, wearer, Match::kNames);
  Host host(opened_, kGodot, wearer, Match::kNames);
  GarmentFrame frame;
  uint32_t random = 7;
  for (int f = 0; f < 300; ++f) {
    random = 1664525 * random + 1013904223;
    const auto bit = [&](int i) { return (random >> (12 + i) & 1) != 0; };
    frame.seconds = bit(0) ? kFrame : 2 * kFrame;
    frame.stages = bit(1) ? DCLOTH_STAGES_MESH : DCLOTH_STAGES_SKELETON;
    frame.pipelined = bit(2);
    frame.half_rate_mesh = bit(3);
    frame.freeze_idle = bit(4);
    frame.outside_body = bit(5);
    frame.draw = bit(6);
    const bool jump = bit(7) && bit(8), reset = bit(9) && bit(10) && bit(11);
    if (reset) garment->Reset(), dcloth_cloth_reset(host.cloth().get());
    if (jump) garment->Jump();
    const uint32_t flags = (frame.pipelined ? DCLOTH_FRAME_PIPELINED : 0) | (jump ? DCLOTH_FRAME_JUMPED : 0) |
                           (frame.half_rate_mesh ? DCLOTH_FRAME_HALF_RATE_MESH : 0) |
                           (frame.freeze_idle ? DCLOTH_FRAME_FREEZE_IDLE : 0);
    const std::vector<Columns> rig = Rig(Pose(f), 0, false);
    SetJoints(garment.get(), rig);
    ASSERT_TRUE(garment->Update(frame, nullptr));
    ASSERT_EQ(host.Update(rig, frame.seconds, frame.stages, flags, frame.outside_body, frame.draw), DCLOTH_OK);
    ASSERT_EQ(garment->positions(), host.positions()) << "frame " << f;
  }
}

// Front faces as each engine computes them: Godot's Plane(a, b, c), Unreal's VectorUtil::Normal(a, b, c).
TEST_F(GarmentTest, FrontsLookOutward) {
  for (const bool unreal : {false, true}) {
    const std::unique_ptr<Garment> garment = Make(unreal ? kUnreal : kGodot, Dressed(0, unreal), Match::kNames);
    SetJoints(garment.get(), Rig(BindMatrices(model_.numbers, joints()), 0, unreal));
    GarmentFrame frame;
    frame.outside_body = false;
    ASSERT_TRUE(garment->Update(frame, nullptr));
    const std::vector<int32_t> corners =
        shared_->Triangles(unreal ? GarmentModel::Front::kCounterClockwise : GarmentModel::Front::kClockwise);
    ASSERT_EQ(corners.size(), 3 * opened_.info().triangle_count);
    EXPECT_EQ(static_cast<uint32_t>(*std::max_element(corners.begin(), corners.end())), shared_->vertex_count() - 1);
    EXPECT_EQ(garment->positions().size(), 3 * size_t{shared_->vertex_count()});
    size_t outward = 0;
    for (size_t t = 0; t < corners.size(); t += 3) {
      const auto at = [&](size_t c, size_t i) {
        return static_cast<double>(garment->positions()[3 * static_cast<size_t>(corners[t + c]) + i]);
      };
      double dot = 0;
      for (size_t i = 0; i < 3; ++i) {
        const size_t j = (i + 1) % 3, k = (i + 2) % 3;
        // (a - c) x (a - b), and (c - a) x (b - a): the same product.
        const double normal =
            (at(0, j) - at(2, j)) * (at(0, k) - at(1, k)) - (at(0, k) - at(2, k)) * (at(0, j) - at(1, j));
        dot += normal * garment->normals()[3 * static_cast<size_t>(corners[t]) + i];
      }
      outward += dot > 0;
    }
    EXPECT_GT(outward, corners.size() / 3 * 99 / 100) << (unreal ? "Unreal" : "Godot");
  }
}

TEST_F(GarmentTest, RefusesInWords) {
  std::string error;
  const AlignedBytes bytes = model_.Bytes();
  EXPECT_EQ(GarmentModel::Open(bytes.data(), bytes.size() / 2, &error), nullptr);
  EXPECT_FALSE(error.empty());
  EXPECT_EQ(GarmentModel::Open(nullptr, 0, &error), nullptr);

  Wearer lacks = Dressed(0, false);
  for (std::string& name : lacks.joint_names) name = "Tail of " + name;
  for (const Match match : {Match::kNames, Match::kBones}) {
    error.clear();
    EXPECT_EQ(Garment::Create(shared_, kGodot, lacks, match, &error), nullptr);
    EXPECT_FALSE(error.empty());
  }
  EXPECT_EQ(Garment::Create(shared_, kGodot, Wearer(), Match::kBones, &error), nullptr);

  const Wearer wearer = Dressed(0, false);
  const std::unique_ptr<Garment> garment = Make(kGodot, wearer, Match::kNames),
                                 same = Make(kGodot, wearer, Match::kNames);
  GarmentFrame frame;
  frame.seconds = kFrame;
  for (int f = 0; f < 10; ++f) {
    const std::vector<Columns> rig = Rig(Pose(f), 0, false);
    for (Garment* one : {garment.get(), same.get()}) {
      SetJoints(one, rig);
      ASSERT_TRUE(one->Update(frame, nullptr));
    }
  }
  std::vector<Columns> broken = Rig(Pose(10), 0, false);
  broken[3][5] = std::nan("");
  SetJoints(garment.get(), broken);
  garment->Jump();  // stays announced
  error.clear();
  EXPECT_FALSE(garment->Update(frame, &error));
  EXPECT_NE(error.find("joint"), std::string::npos) << error;
  const Place nowhere = {std::nan(""), 0, 0};
  EXPECT_FALSE(garment->Follow(nowhere.data(), 1));
  const float storm[] = {0, 0, 101};
  error.clear();
  EXPECT_FALSE(garment->SetWind(storm, &error));
  EXPECT_FALSE(error.empty());
  same->Jump();
  const std::vector<Columns> rig = Rig(Pose(11), 0, false);
  for (Garment* one : {garment.get(), same.get()}) {
    SetJoints(one, rig);
    ASSERT_TRUE(one->Update(frame, nullptr));
  }
  EXPECT_EQ(garment->positions(), same->positions());
}

}  // namespace
}  // namespace dcloth::testing

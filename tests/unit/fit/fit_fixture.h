// A garment of the figure's, and characters as a host has them that it is fitted to.
#ifndef DCLOTH_TESTS_UNIT_FIT_FIT_FIXTURE_H_
#define DCLOTH_TESTS_UNIT_FIT_FIT_FIXTURE_H_

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "dcloth/dcloth_fit.h"
#include "tests/unit/engine/allocation_trap.h"
#include "tests/unit/engine/cloth_fixture.h"
#include "tests/unit/engine/figure.h"
#include "tests/unit/engine/joint_matrices.h"
#include "tests/unit/engine/test_body.h"

namespace dcloth::testing {

inline constexpr uint32_t kAll = DCLOTH_STAGES_MESH;
inline constexpr float kFrame = 1 / 45.0f;

class FitTest : public ::testing::Test {
 protected:
  // With rings, an egg of as many rings and segments is the figure's body; with patches, a patch stage moves the cloth.
  explicit FitTest(uint32_t rings = 0, uint32_t segments = 0, uint32_t patches = 0)
      : model_([&] {
          ModelSpec spec;
          spec.skeleton_joints = Figure();
          spec.joints = spec.bones = static_cast<uint32_t>(spec.skeleton_joints.size());
          spec.patches = patches;
          TestModel model = BuildModel(spec);
          if (rings != 0) egg_ = AddBody(&model, rings, segments);
          return model;
        }()),
        opened_(model_) {
    for (const NamedJoint& joint : Figure()) names_.push_back(joint.first);
  }

  size_t joints() const { return names_.size(); }
  size_t Index(const std::string& name) const {
    return static_cast<size_t>(std::find(names_.begin(), names_.end(), name) - names_.begin());
  }
  std::vector<float> Pose(int frame) const { return PoseAt(model_.numbers, frame / 45.0); }

  std::vector<float> Training() const { return BindMatrices(model_.numbers, joints()); }

  // A rig as a host has it. Empty names: roles are told.
  struct Host {
    std::vector<std::string> names;
    std::vector<float> bind;
    std::vector<uint32_t> roles;
    std::vector<float> body;
    std::vector<uint32_t> body_joints, triangles;
    std::vector<float> body_weights;
  };

  Host FigureHost() const { return {names_, Training(), {}, {}, {}, {}, {}}; }

  dcloth_status Fit(OwnedCloth* cloth, const Host& host, dcloth_fit* fit = nullptr, dcloth_error* error = nullptr) {
    std::vector<const char*> names;
    for (const std::string& name : host.names) names.push_back(name.c_str());
    dcloth_character character = {};
    character.struct_size = sizeof(character);
    character.joint_count = static_cast<uint32_t>(host.bind.size() / 16);
    character.joint_names = names.empty() ? nullptr : names.data();
    character.joint_roles = host.roles.empty() ? nullptr : host.roles.data();
    character.bind_matrices = host.bind.data();
    if (!host.body.empty()) {
      character.body_vertex_count = static_cast<uint32_t>(host.body.size() / 3);
      character.body_positions = host.body.data();
      character.body_joints = host.body_joints.data();
      character.body_weights = host.body_weights.data();
      character.body_influences = static_cast<uint32_t>(host.body_joints.size() / character.body_vertex_count);
      character.body_triangles = host.triangles.empty() ? nullptr : host.triangles.data();
      character.body_triangle_count = static_cast<uint32_t>(host.triangles.size() / 3);
    }
    storage_ = AlignedBytes(std::max<size_t>(dcloth_fit_storage_size(opened_.get(), &character), 1));
    const AllocationTrap trap;
    return dcloth_cloth_fit(cloth->get(), &character, storage_.data(), storage_.size(), fit, error);
  }

  static dcloth_fit EmptyFit() {
    dcloth_fit fit = {};
    fit.struct_size = sizeof(fit);
    return fit;
  }

  // Refused with this status and all four parts of an error, of which `found` and `mend` hold these words; the cloth
  // goes on with the poses it knew.
  void ExpectRefused(const Host& host, dcloth_status status, const std::string& found, const std::string& mend,
                     const dcloth_space* space = nullptr) {
    OwnedCloth cloth(opened_), plain(opened_);
    if (space != nullptr) {
      ASSERT_EQ(dcloth_cloth_set_space(cloth.get(), space, nullptr), DCLOTH_OK);
      ASSERT_EQ(dcloth_cloth_set_space(plain.get(), space, nullptr), DCLOTH_OK);
    }
    dcloth_error error = EmptyError();
    dcloth_fit fit = EmptyFit();
    fit.scale = 7;
    EXPECT_EQ(Fit(&cloth, host, &fit, &error), status) << error.text;
    EXPECT_EQ(Fit(&cloth, host), status) << "without an error to fill";
    EXPECT_EQ(fit.scale, 7) << "a refused fit is not told";
    EXPECT_GT(error.what_size, 0) << error.text;
    EXPECT_GT(error.allowed_size, 0) << error.text;
    EXPECT_NE(std::string(error.text + error.found_at, error.found_size).find(found), std::string::npos) << error.text;
    EXPECT_NE(std::string(error.text + error.mend_at, error.mend_size).find(mend), std::string::npos) << error.text;
    for (int frame = 0; frame < 3; ++frame) {
      ASSERT_EQ(cloth.Update(Pose(frame), kFrame, kAll), DCLOTH_OK);
      ASSERT_EQ(plain.Update(Pose(frame), kFrame, kAll), DCLOTH_OK);
    }
    EXPECT_EQ(cloth.positions(), plain.positions());
  }

  EggBody egg_;  // before what fills it in
  TestModel model_;
  OpenedModel opened_;
  std::vector<std::string> names_;
  AlignedBytes storage_{1};
};

class BodyFitTest : public FitTest {
 protected:
  explicit BodyFitTest(uint32_t rings = 28, uint32_t segments = 30) : FitTest(rings, segments) {}

  // How far the garment, drawn in a pose and kept outside, is under `skin`, the vertices of `body` in it; below 0
  // outside.
  double DeepestUnder(OwnedCloth* cloth, const std::vector<float>& matrices, const EggBody& body,
                      const std::vector<Point>& skin) const {
    std::vector<float> positions(3 * size_t{opened_.info().vertex_count});
    dcloth_output output = FloatOutput(positions.size() / 3, positions.data(), 12, nullptr);
    output.flags = DCLOTH_OUTPUT_OUTSIDE_BODY;
    const dcloth_pose pose = OwnedCloth::Pose(matrices);
    const dcloth_frame frame = {sizeof(frame), kAll, kFrame, 0, nullptr};
    EXPECT_EQ(dcloth_cloth_update(cloth->get(), &pose, &frame, &output, nullptr), DCLOTH_OK);
    double deepest = -1;
    for (size_t i = 0; i < positions.size(); i += 3) {
      const Point point = {static_cast<double>(positions[i]), static_cast<double>(positions[i + 1]),
                           static_cast<double>(positions[i + 2])};
      deepest = std::max(deepest, -SignedDistance(body, skin, point));
    }
    return deepest;
  }

  // The same in the bind pose, under the character's own skin.
  double Deepest(OwnedCloth* cloth, const Host& host) const {
    std::vector<Point> skin;
    for (size_t i = 0; i < host.body.size(); i += 3)
      skin.push_back({static_cast<double>(host.body[i]), static_cast<double>(host.body[i + 1]),
                      static_cast<double>(host.body[i + 2])});
    return DeepestUnder(cloth, host.bind, egg_, skin);
  }

  // The egg with its points moved outwards from the axis by a factor.
  Host Wearer(double girth) const {
    Host host = FigureHost();
    host.body = egg_.positions;
    for (size_t i = 0; i < host.body.size(); ++i) {
      if (i % 3 != 1) host.body[i] *= static_cast<float>(girth);
    }
    host.body_joints.assign(egg_.joints.begin(), egg_.joints.end());
    host.body_weights = egg_.weights;
    host.triangles.assign(egg_.faces.begin(), egg_.faces.end());
    return host;
  }
};

}  // namespace dcloth::testing

#endif  // DCLOTH_TESTS_UNIT_FIT_FIT_FIXTURE_H_

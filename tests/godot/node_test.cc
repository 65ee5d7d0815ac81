// The Godot node in a world of stand-ins: what it hands to the rendering server is what `dcloth run` draws, whatever
// the skeleton's place, turn and scale; it reads bones and skins as they are; what goes wrong is said once and mended
// by the next good frame. Arguments: MODEL SEQUENCE RUN, the model, what it plays and what `dcloth run` made of it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <iterator>

#include "converter/sequence.h"
#include "dcloth_garment.h"
#include "dcloth_model.h"
#include "wearer.h"

namespace dcloth::testing {
namespace {

using converter::SafeFile;
using converter::Sequence;
using godot::Basis;
using godot::Node;
using godot::Ref;
using godot::Transform3D;
using godot::Vector3;
using platforms::Wearer;

const char* model_path = nullptr;
const char* sequence_path = nullptr;
const char* run_path = nullptr;

std::vector<uint8_t> ReadBytes(const char* path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

Transform3D TransformOf(const float* m) {  // rows contiguous
  Transform3D transform;
  for (int r = 0; r < 3; ++r) transform.basis.rows[r] = {m[4 * r], m[4 * r + 1], m[4 * r + 2]};
  transform.origin = {m[3], m[7], m[11]};
  return transform;
}

// Turned about the vertical, scaled, moved.
Transform3D Placed(double degrees, float scale, const Vector3& place) {
  const auto c = static_cast<float>(std::cos(degrees * M_PI / 180)) * scale,
             s = static_cast<float>(std::sin(degrees * M_PI / 180)) * scale;
  Transform3D transform;
  transform.basis.rows[0] = {c, 0, s};
  transform.basis.rows[1] = {0, scale, 0};
  transform.basis.rows[2] = {-s, 0, c};
  transform.origin = place;
  return transform;
}

// A garment below the skeleton of the figure of training, as a scene has them.
class NodeTest : public ::testing::Test {
 protected:
  NodeTest() {
    godot::Printed().clear();
    godot::Deferred().clear();
    godot::FileAccess::Files()["res://skirt.dcloth"] = ReadBytes(model_path);
    model_ = DClothModelLoader()._load("res://skirt.dcloth", "", false, 0);
    const auto& opened = model_->model();
    for (uint32_t j = 0; j < opened->info().joint_count; ++j) {
      skeleton_.names.emplace_back(dcloth_model_joint_name(opened->get(), j));
      float bind[16];
      EXPECT_EQ(dcloth_model_joint_bind(opened->get(), j, bind), DCLOTH_OK);
      binds_.push_back(TransformOf(bind));
    }
    skeleton_.children = {&garment_};
    garment_.parent = &skeleton_;
    garment_.set_model(model_);
    garment_.Notify(Node::NOTIFICATION_READY);
  }
  ~NodeTest() override { garment_.Notify(Node::NOTIFICATION_EXIT_TREE); }

  // The skeleton's node in the world. Bones have no scale of their own.
  void Place(const Transform3D& node) {
    skeleton_.global = node;
    skeleton_.rest.clear();
    const Transform3D upright(node.basis, Vector3());
    for (const Transform3D& bind : binds_) skeleton_.rest.push_back(InSkeleton(upright, bind));
  }
  static Transform3D InSkeleton(const Transform3D& node, const Transform3D& bone) {
    Transform3D seen = node.affine_inverse() * bone;
    const float scale = std::sqrt(node.basis.rows[1].dot(node.basis.rows[1]));
    for (Vector3& row : seen.basis.rows) row = row * scale;
    return seen;
  }
  // A frame of Godot: nodes process, then deferred calls run, the skeleton's before the garment's.
  void Frame(const std::vector<Transform3D>& bones) {
    skeleton_.pose.clear();
    for (const Transform3D& bone : bones) skeleton_.pose.push_back(InSkeleton(skeleton_.global, bone));
    godot::Deferred().push_back([this] { skeleton_.Emit("skeleton_updated"); });
    garment_.Notify(Node::NOTIFICATION_INTERNAL_PROCESS);
    godot::Flush();
  }
  const godot::ArrayMesh& mesh() const { return *dynamic_cast<godot::ArrayMesh*>(*garment_.shown_mesh); }
  Vector3 Position(size_t v) const {
    float p[3];
    std::memcpy(p, mesh().bytes.ptr() + 12 * v, sizeof(p));
    return garment_.global.xform({p[0], p[1], p[2]});
  }
  // The octahedral map of the server, undone.
  Vector3 Normal(size_t v) const {
    uint16_t n[2];
    std::memcpy(n, mesh().bytes.ptr() + 12 * drawn_count() + 4 * v, sizeof(n));
    const float x = static_cast<float>(n[0]) / 65535 * 2 - 1, y = static_cast<float>(n[1]) / 65535 * 2 - 1;
    Vector3 normal(x, y, 1 - std::abs(x) - std::abs(y));
    if (normal.z < 0) {
      normal.x = (1 - std::abs(y)) * (x >= 0 ? 1.0f : -1.0f);
      normal.y = (1 - std::abs(x)) * (y >= 0 ? 1.0f : -1.0f);
    }
    return normal * (1 / std::sqrt(normal.dot(normal)));
  }
  size_t vertex_count() const { return static_cast<size_t>(model_->get_vertex_count()); }
  size_t drawn_count() const { return model_->model()->vertex_count(); }

  Ref<DClothModel> model_;
  std::vector<Transform3D> binds_;
  godot::Skeleton3D skeleton_;
  DClothGarment garment_;
};

TEST_F(NodeTest, VerticesAreThoseOfTheCommandLine) {
  const Sequence sequence = converter::ReadSequence(sequence_path);
  const std::vector<uint32_t> map = converter::MapJoints(sequence, skeleton_.names);
  const SafeFile run = SafeFile::Read(run_path);
  const std::vector<float> expected = converter::FloatsOf(run, run.Require("positions"));
  ASSERT_EQ(expected.size(), 3 * vertex_count() * sequence.frame_count);
  struct Case {
    DClothGarment::Fit fit;
    double turn;
    float scale;
    Vector3 place;
  };
  for (const Case& c :
       {Case{DClothGarment::FIT_NAMES, 0, 1, {0, 0, 0}}, Case{DClothGarment::FIT_BONES, 0, 1, {0, 0, 0}},
        Case{DClothGarment::FIT_NAMES, 90, 1, {4, 0, -2}}, Case{DClothGarment::FIT_BONES, 90, 0.01f, {4, 0, -2}}}) {
    garment_.set_fit(c.fit);
    garment_.set_outside_body(false);
    Place(Placed(c.turn, c.scale, c.place));
    double worst = 0;
    for (size_t f = 0; f < sequence.frame_count; ++f) {
      std::vector<float> matrices(16 * map.size());
      converter::GatherPose(sequence, f, map, matrices);
      std::vector<Transform3D> bones;
      for (size_t b = 0; b < map.size(); ++b) bones.push_back(TransformOf(&matrices[16 * b]));
      Frame(bones);
      ASSERT_TRUE(garment_.is_dressed()) << garment_.get_error().text();
      for (size_t v = 0; v < vertex_count(); ++v) {
        const float* p = &expected[3 * (f * vertex_count() + v)];
        const Vector3 here = Position(v);
        worst = std::max({worst, std::abs(static_cast<double>(here.x - p[0])),
                          std::abs(static_cast<double>(here.y - p[1])), std::abs(static_cast<double>(here.z - p[2]))});
      }
    }
    std::printf("fit %d, turned by %.0f, scale %.2f: %zu frames, worst %.5f mm\n", c.fit, c.turn,
                static_cast<double>(c.scale), sequence.frame_count, 1000 * worst);
    EXPECT_LT(1000 * worst, 0.01) << "mm";
    EXPECT_TRUE(godot::Printed().empty());
    EXPECT_EQ(mesh().updates, static_cast<int>(sequence.frame_count));
    EXPECT_TRUE(mesh().dynamic);
    EXPECT_EQ(garment_.get_fit_report().size() == 0, c.fit == DClothGarment::FIT_NAMES);
  }
  EXPECT_TRUE(garment_.top_level && garment_.processes && garment_.priority > 0 && garment_.skeleton_path.is_empty());

  // Fronts turn clockwise in Godot: Plane(a, b, c) looks along (a - c) x (a - b). Normals look there too.
  const godot::Array arrays = mesh().surface_get_arrays(0);
  const godot::PackedInt32Array corners = arrays[godot::Mesh::ARRAY_INDEX];
  const godot::PackedVector2Array places = arrays[godot::Mesh::ARRAY_TEX_UV];
  ASSERT_GT(drawn_count(), vertex_count()) << "a texture with seams";
  ASSERT_EQ(static_cast<size_t>(places.size()), drawn_count());
  const dcloth_model_info& info = model_->model()->info();
  for (size_t v = 0; v < drawn_count(); ++v) {
    const auto at = static_cast<int64_t>(v);
    EXPECT_EQ(places[at].x, info.texture_coordinates[2 * v]);
    EXPECT_EQ(places[at].y, info.texture_coordinates[2 * v + 1]);
    if (v < vertex_count()) continue;
    const Vector3 apart = Position(v) + Position(info.seam_vertices[v - vertex_count()]) * -1;
    EXPECT_EQ(apart.dot(apart), 0);
  }
  int64_t outward = 0;
  for (int64_t t = 0; t < corners.size(); t += 3) {
    const Vector3 a = Position(static_cast<size_t>(corners[t])), b = Position(static_cast<size_t>(corners[t + 1])),
                  c = Position(static_cast<size_t>(corners[t + 2]));
    outward += (a + c * -1).cross(a + b * -1).dot(Normal(static_cast<size_t>(corners[t]))) > 0;
  }
  EXPECT_GT(outward, corners.size() / 3 * 98 / 100);
  // The box that Godot culls by holds all of them.
  for (size_t v = 0; v < vertex_count(); ++v) {
    const Vector3 p = Position(v) + garment_.global.origin * -1, low = garment_.bounds.position,
                  high = low + garment_.bounds.size;
    ASSERT_TRUE(p.x >= low.x - 1e-5f && p.y >= low.y - 1e-5f && p.z >= low.z - 1e-5f);
    ASSERT_TRUE(p.x <= high.x + 1e-5f && p.y <= high.y + 1e-5f && p.z <= high.z + 1e-5f);
  }
}

// Bones stand as the skin bound them, not at rest; binds name bones or count them; surfaces come with and without
// indices.
TEST_F(NodeTest, ReadsSkins) {
  godot::Skeleton3D skeleton;
  skeleton.names = {"hips", "left", "right", "tail"};
  for (const float x : {0.0f, 1.0f, -1.0f, 0.0f}) skeleton.rest.push_back(Placed(0, 1, {x, 1, 0}));
  skeleton.global = Placed(90, 2, {100, 0, 0});  // the place counts for poses alone

  godot::MeshInstance3D body;
  Ref<godot::Skin> skin;
  skin.instantiate();
  skin->binds = {{-1, "right", Placed(0, 1, {3, -5, 0})}, {0, "", Placed(0, 1, {0, -7, 0})}, {9, "", {}}};
  body.bound_skin = skin;
  Ref<godot::Mesh> mesh;
  mesh.instantiate();
  for (const bool indexed : {true, false}) {
    godot::Array arrays;
    arrays.resize(godot::Mesh::ARRAY_MAX);
    godot::PackedVector3Array points;
    godot::PackedInt32Array binds, corners;
    godot::PackedFloat32Array weights;
    for (const float x : {0.0f, 1.0f, 2.0f}) {
      points.push_back({x, 1, 0});
      for (const int bind : {0, 1, 2, 0}) binds.push_back(bind);
      for (const float weight : {0.5f, 0.25f, 0.25f, 0.0f}) weights.push_back(weight);
    }
    for (const int corner : {2, 1, 0}) corners.push_back(corner);
    arrays[godot::Mesh::ARRAY_VERTEX] = points;
    arrays[godot::Mesh::ARRAY_BONES] = binds;
    arrays[godot::Mesh::ARRAY_WEIGHTS] = weights;
    if (indexed) arrays[godot::Mesh::ARRAY_INDEX] = corners;
    mesh->surfaces.push_back(arrays);
  }
  godot::Array bare;  // a surface without weights counts for nothing
  bare.resize(godot::Mesh::ARRAY_MAX);
  mesh->surfaces.push_back(bare);
  body.shown_mesh = mesh;

  const Wearer wearer = WearerOf(skeleton, {&body}, true);
  EXPECT_EQ(wearer.joint_names, skeleton.names);
  const auto place = [&](size_t b) {
    return std::vector<float>(&wearer.bind_matrices[16 * b + 12], &wearer.bind_matrices[16 * b + 15]);
  };
  const auto expect = [&](size_t b, float x, float y, float z) {
    const std::vector<float> found = place(b);
    EXPECT_NEAR(found[0], x, 1e-5) << b;
    EXPECT_NEAR(found[1], y, 1e-5) << b;
    EXPECT_NEAR(found[2], z, 1e-5) << b;
  };
  expect(0, 0, 14, 0);  // by its number: bound at y = 7, twice as large
  expect(1, 0, 2, -2);  // not bound: at rest; a quarter turn takes x to -z
  expect(2, 0, 10, 6);  // by its name: bound at (-3, 5, 0)
  ASSERT_EQ(wearer.body_vertex_count(), 6u);
  EXPECT_EQ(wearer.body_triangles, (std::vector<uint32_t>{2, 1, 0, 3, 4, 5}));
  EXPECT_EQ(wearer.body_joints[0], 2u);
  EXPECT_EQ(wearer.body_joints[1], 0u);
  EXPECT_EQ(wearer.body_weights[0], 0.5f);
  EXPECT_EQ(wearer.body_weights[2], 0);  // its bind has no bone
  EXPECT_NEAR(wearer.body_positions[3], 0, 1e-5);
  EXPECT_NEAR(wearer.body_positions[5], -2, 1e-5);
  EXPECT_EQ(WearerOf(skeleton, {&body}, false).body_vertex_count(), 0u);
}

TEST_F(NodeTest, SaysWhatIsWrongOnceAndGoesOn) {
  Place(Transform3D());
  garment_.set_fit(DClothGarment::FIT_NAMES);
  garment_.set_model(Ref<DClothModel>());
  for (int f = 0; f < 3; ++f) Frame(binds_);
  EXPECT_EQ(godot::Printed().size(), 1u);
  EXPECT_FALSE(garment_.is_dressed());
  garment_.set_model(model_);
  garment_.set_character("Nobody");
  for (int f = 0; f < 3; ++f) Frame(binds_);
  EXPECT_EQ(godot::Printed().size(), 2u);
  garment_.set_character("");
  Frame(binds_);
  ASSERT_TRUE(garment_.is_dressed());
  const Vector3 before = Position(0);

  godot::Printed().clear();
  std::vector<Transform3D> broken = binds_;
  broken[0].origin.x = std::nanf("");
  for (int f = 0; f < 3; ++f) Frame(broken);
  EXPECT_EQ(godot::Printed().size(), 1u);
  EXPECT_FALSE(garment_.get_error().is_empty());
  EXPECT_EQ(Position(0).y, before.y);
  garment_.set_wind({0, 0, 101});  // said, and the wind before stays
  EXPECT_EQ(godot::Printed().size(), 2u);

  std::vector<Transform3D> moved = binds_;
  for (Transform3D& bone : moved) bone.origin.x += 0.5f;
  garment_.visible = false;
  const int updates = mesh().updates;
  garment_.jump();
  Frame(moved);
  EXPECT_EQ(mesh().updates, updates);
  garment_.visible = true;
  garment_.reset();
  Frame(moved);
  EXPECT_TRUE(garment_.get_error().is_empty());
  EXPECT_NEAR(Position(0).x, before.x + 0.5f, 0.1f);

  // A frame in which the skeleton did not move keeps its pose.
  garment_.Notify(Node::NOTIFICATION_INTERNAL_PROCESS);
  godot::Flush();
  EXPECT_EQ(mesh().updates, updates + 2);

  godot::Engine::get_singleton()->editor = true;  // in the editor nothing moves
  Frame(binds_);
  godot::Engine::get_singleton()->editor = false;
  EXPECT_EQ(mesh().updates, updates + 2);

  garment_.Notify(Node::NOTIFICATION_INTERNAL_PROCESS);
  garment_.Notify(Node::NOTIFICATION_EXIT_TREE);  // its deferred call finds nothing
  godot::Flush();
  skeleton_.Emit("skeleton_updated");
  EXPECT_FALSE(garment_.is_dressed());
}

TEST_F(NodeTest, LoaderRefusesBrokenFiles) {
  const DClothModelLoader loader;
  EXPECT_EQ(loader._get_recognized_extensions()[0].text(), "dcloth");
  EXPECT_EQ(loader._get_resource_type("res://a.DCLOTH").text(), "DClothModel");
  EXPECT_TRUE(loader._get_resource_type("res://a.png").is_empty());
  EXPECT_TRUE(loader._handles_type("DClothModel") && !loader._handles_type("Texture2D"));
  EXPECT_EQ(static_cast<godot::Error>(loader._load("res://none.dcloth", "", false, 0)), godot::ERR_FILE_NOT_FOUND);
  std::vector<uint8_t> half = ReadBytes(model_path);
  half.resize(half.size() / 2);
  godot::FileAccess::Files()["res://half.dcloth"] = half;
  EXPECT_EQ(static_cast<godot::Error>(loader._load("res://half.dcloth", "", false, 0)), godot::ERR_FILE_CORRUPT);
  EXPECT_EQ(godot::Printed().size(), 1u);
  EXPECT_EQ(model_->get_joint_names().size(), static_cast<int64_t>(skeleton_.names.size()));
  EXPECT_FALSE(model_->get_garment_name().is_empty());
}

TEST_F(NodeTest, EveryPropertyHasItsMethods) {
  DClothGarment::Bind();
  DClothModel::Bind();
  EXPECT_EQ(godot::ClassDB::Properties().size(), 10u);
  for (const auto& [name, accessors] : godot::ClassDB::Properties()) {
    EXPECT_EQ(godot::ClassDB::Methods().count(accessors.first), 1u) << name;
    EXPECT_EQ(godot::ClassDB::Methods().count(accessors.second), 1u) << name;
  }
  EXPECT_EQ(godot::ClassDB::Constants().size(), 6u);
}

}  // namespace
}  // namespace dcloth::testing

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  if (argc != 4) return 2;
  dcloth::testing::model_path = argv[1];
  dcloth::testing::sequence_path = argv[2];
  dcloth::testing::run_path = argv[3];
  return RUN_ALL_TESTS();
}

#include "converter/body_surface.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <numeric>
#include <set>

#include "converter/assemble.h"
#include "converter/rollout.h"
#include "kernels/nearest/nearest.h"
#include "tests/unit/converter/bundle_builder.h"
#include "tests/unit/converter/error_text.h"

namespace dcloth::converter {
namespace {

using dcloth::testing::BuildBundle;
using dcloth::testing::BundleSpec;
using dcloth::testing::ErrorText;
using dcloth::testing::Mentions;

Bundle Parse(const dcloth::testing::RawFile& raw) { return BundleFrom(SafeFile::Parse(raw.Bytes(), "b")); }

// A wall of `columns` x `rows` vertices, 0.05 m apart, along x through the template. Its left half hangs on the first
// bone, its right half on the first joint, which is no bone and needed by no one else.
Bundle WithWall(int columns, int rows) {
  BundleSpec spec;
  spec.feature_joints = 1;
  Bundle bundle = Parse(BuildBundle(spec));
  const Eigen::Index b = Eigen::Index{columns} * rows, joints = bundle.body_joint_weights.cols();
  bundle.body_positions.resize(b, 3);
  bundle.body_joint_weights = Matrix::Zero(b, joints);
  std::vector<int32_t> corners;
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < columns; ++c) {
      const int i = r * columns + c;
      bundle.body_positions.row(i) << 0.05f * static_cast<float>(c - columns / 2), 0.05f * static_cast<float>(r), 0.0f;
      bundle.body_joint_weights(i, c < columns / 2 ? bundle.bones[0] : 0) = 1;
      if (c + 1 < columns && r + 1 < rows) {
        corners.insert(corners.end(), {i, i + 1, i + columns + 1, i, i + columns + 1, i + columns});
      }
    }
  }
  bundle.body_faces = Eigen::Map<const Faces>(corners.data(), static_cast<Eigen::Index>(corners.size() / 3), 3);
  bundle.template_positions.rowwise() -= bundle.template_positions.row(0).eval();
  return bundle;
}

using Corners = std::array<uint32_t, 3>;

std::multiset<Corners> FacesOf(const BodySurface& surface) {
  std::multiset<Corners> faces;
  for (size_t f = 0; f < surface.faces.size(); f += 3) {
    faces.insert({surface.vertices[surface.faces[f]], surface.vertices[surface.faces[f + 1]],
                  surface.vertices[surface.faces[f + 2]]});
  }
  return faces;
}

std::multiset<Corners> FacesWhere(const Bundle& bundle, const std::vector<bool>& collides) {
  std::multiset<Corners> faces;
  for (Eigen::Index f = 0; f < bundle.body_faces.rows(); ++f) {
    Corners face;
    for (int c = 0; c < 3; ++c) face[static_cast<size_t>(c)] = static_cast<uint32_t>(bundle.body_faces(f, c));
    double nearest = 1e9;
    for (const uint32_t corner : face) {
      for (Eigen::Index i = 0; i < bundle.template_positions.rows(); ++i) {
        const auto apart = (bundle.body_positions.row(corner) - bundle.template_positions.row(i)).cast<double>();
        nearest = std::min(nearest, apart.norm());
      }
    }
    const bool all = std::all_of(face.begin(), face.end(), [&](uint32_t corner) { return collides[corner]; });
    if (all && nearest < kBodyReach) faces.insert(face);
  }
  return faces;
}

TEST(BodySurfaceTest, HoldsTheFacesThatCollideNearTheGarment) {
  Bundle bundle = WithWall(60, 40);
  std::vector<bool> collides(2400);
  bundle.body_collides = Vector::Zero(2400);
  for (size_t i = 0; i < collides.size(); ++i) {
    collides[i] = i % 11 != 0;
    bundle.body_collides[static_cast<Eigen::Index>(i)] = collides[i] ? 1.0f : 0.0f;
  }
  const BodySurface surface = MakeBodySurface(bundle, 4);
  const std::multiset<Corners> expected = FacesWhere(bundle, collides);
  ASSERT_GT(expected.size(), 100u);
  ASSERT_LT(expected.size(), 2000u) << "far faces are left out";
  EXPECT_EQ(FacesOf(surface), expected);
}

TEST(BodySurfaceTest, WithoutAMarkTheBonesAloneCollideAndNeedNoFurtherJoint) {
  const Bundle bundle = WithWall(40, 20);
  std::vector<bool> collides(800);
  for (size_t i = 0; i < collides.size(); ++i) collides[i] = i % 40 < 20;
  const BodySurface surface = MakeBodySurface(bundle, 4);
  ASSERT_FALSE(surface.empty());
  EXPECT_EQ(FacesOf(surface), FacesWhere(bundle, collides));
  EXPECT_EQ(ChooseJoints(bundle, {}, surface.skin).joints, ChooseJoints(bundle, {}).joints);
  Bundle marked = bundle;
  marked.body_collides = Vector::Ones(800);
  const BodySurface whole = MakeBodySurface(marked, 4);
  EXPECT_GT(whole.vertices.size(), surface.vertices.size());
  EXPECT_EQ(whole.skin.vertex_count(), whole.vertices.size());
}

TEST(BodySurfaceTest, RingsListEachFaceAtItsCornersAndGroupsLieTogether) {
  const Bundle bundle = WithWall(40, 20);
  const BodySurface surface = MakeBodySurface(bundle, 4);
  const size_t b = surface.vertices.size();
  ASSERT_EQ(surface.row_starts.size(), b + 1);
  ASSERT_EQ(surface.row_starts.back(), surface.faces.size());
  for (size_t i = 0; i < b; ++i) {
    std::multiset<uint32_t> found(surface.columns.begin() + surface.row_starts[i],
                                  surface.columns.begin() + surface.row_starts[i + 1]);
    std::multiset<uint32_t> expected;
    for (size_t c = 0; c < surface.faces.size(); ++c) {
      if (surface.faces[c] == i) expected.insert(static_cast<uint32_t>(c / 3));
    }
    ASSERT_EQ(found, expected) << i;
    ASSERT_FALSE(expected.empty()) << i;
  }
  std::set<uint32_t> once(surface.vertices.begin(), surface.vertices.end());
  EXPECT_EQ(once.size(), b);
  for (size_t g = 0; g < b; g += kernels::kNearestGroup) {
    for (size_t i = g; i < std::min(b, g + kernels::kNearestGroup); ++i) {
      const auto first = bundle.body_positions.row(surface.vertices[g]);
      EXPECT_LT((bundle.body_positions.row(surface.vertices[i]) - first).norm(), 0.5f) << "16 vertices of a lattice of 0.05 m";
    }
  }
}

// One vertex more than a group: the cut leaves a whole group on its left and that vertex, the last along the longer side.
TEST(BodySurfaceTest, OneVertexMoreThanAGroupIsCutBehindTheGroup) {
  static_assert(kernels::kNearestGroup == 16);
  Bundle bundle = WithWall(6, 3);
  bundle.body_collides = Vector::Ones(18);
  bundle.body_collides[0] = 0;
  const BodySurface surface = MakeBodySurface(bundle, 4);
  std::vector<uint32_t> expected(17);
  std::iota(expected.begin(), expected.end(), 1u);
  EXPECT_EQ(surface.vertices, expected);
}

TEST(BodySurfaceTest, ABodyBeyondTheFormatIsRefusedOnlyWhereItIsMarked) {
  Bundle bundle = WithWall(130, 70);
  bundle.template_positions = bundle.body_positions;
  for (Eigen::Index i = 0; i < bundle.body_joint_weights.rows(); ++i) {
    bundle.body_joint_weights.row(i).setZero();
    bundle.body_joint_weights(i, bundle.bones[0]) = 1;
  }
  EXPECT_TRUE(MakeBodySurface(bundle, 4).empty());
  bundle.body_collides = Vector::Ones(9100);
  EXPECT_TRUE(Mentions(ErrorText([&] { MakeBodySurface(bundle, 4); }), "body.collides", "9100 colliding vertices",
                       "at most 8192 vertices", "coarser mesh"));
}

TEST(BodySurfaceTest, TheMarkIsZeroOrOne) {
  dcloth::testing::RawFile raw = BuildBundle({});
  raw.Replace("body.collides", {12}, std::vector<float>(12, 1.0f));
  EXPECT_EQ(Parse(raw).body_collides, Vector::Ones(12));
  raw.SetFloat("body.collides", 7, 0.5f);
  EXPECT_TRUE(Mentions(ErrorText([&] { Parse(raw); }), "body.collides", "0.5", "at vertex 7", "0 elsewhere"));
  raw.Replace("body.collides", {11}, std::vector<float>(11, 1.0f));
  EXPECT_TRUE(Mentions(ErrorText([&] { Parse(raw); }), "body.collides", "11", "12"));
}

// Columns of the wall belong to part 1, 2 or, around the seam, both; cloth touches one of them, both or nothing.
TEST(BodySurfaceTest, MasksBecomeClassesAndFacesThatNoneTouchesAreLeftOut) {
  Bundle bundle = WithWall(60, 20);
  bundle.body_collides = Vector::Ones(1200);
  for (int i = 0; i < 1200; ++i) {
    const int column = i % 60;
    bundle.body_parts.push_back(column < 20 ? 4u : column < 28 ? 1u : column < 32 ? 3u : 2u);
  }
  for (uint32_t i = 0; i < bundle.vertex_count(); ++i) bundle.touches.push_back(std::array{2u, 0u, 9u, 3u}[i % 4]);
  const BodySurface surface = MakeBodySurface(bundle, 4);
  ASSERT_EQ(surface.touch_classes.size(), bundle.vertex_count());
  const std::array<uint8_t, 4> classes = {1, 0, 3, 2};  // in the order of 0, 2, 3, 9
  for (size_t i = 0; i < surface.touch_classes.size(); ++i) EXPECT_EQ(surface.touch_classes[i], classes[i % 4]);
  std::vector<bool> touched(1200);
  for (size_t i = 0; i < touched.size(); ++i) touched[i] = i % 60 >= 20;
  EXPECT_EQ(FacesOf(surface), FacesWhere(bundle, touched));
  ASSERT_EQ(surface.touched_by.size(), surface.vertices.size());
  std::set<uint8_t> found;
  for (size_t i = 0; i < surface.vertices.size(); ++i) {
    const uint32_t column = surface.vertices[i] % 60;
    const int expected = (column < 32 ? 1 << 3 : 0) | (column >= 28 ? 1 << 1 : 0) | 1 << 2;
    EXPECT_EQ(surface.touched_by[i], expected) << "column " << column;
    found.insert(surface.touched_by[i]);
  }
  EXPECT_EQ(found.size(), 3u);
}

// Two columns of a part make faces, one makes an edge, and a bit there would be none that the format allows.
TEST(BodySurfaceTest, AVertexIsTouchedWhereAWholeFaceIs) {
  Bundle bundle = WithWall(40, 20);
  bundle.body_collides = Vector::Ones(800);
  for (int i = 0; i < 800; ++i) bundle.body_parts.push_back(i % 40 == 20 ? 3u : 1u);
  for (uint32_t i = 0; i < bundle.vertex_count(); ++i) bundle.touches.push_back(1 + i % 2);
  const BodySurface surface = MakeBodySurface(bundle, 4);
  ASSERT_FALSE(surface.empty());
  for (const uint8_t bits : surface.touched_by) EXPECT_EQ(bits, 1);
  std::fill(bundle.touches.begin(), bundle.touches.end(), 4u);
  EXPECT_TRUE(MakeBodySurface(bundle, 4).empty()) << "cloth that touches no part that there is";
}

TEST(BodySurfaceTest, MoreClassesThanBitsAreRefused) {
  Bundle bundle = WithWall(40, 20);
  bundle.body_parts.assign(800, 0x1FF);
  for (uint32_t i = 0; i < bundle.vertex_count(); ++i) bundle.touches.push_back(i % 8);
  EXPECT_FALSE(MakeBodySurface(bundle, 4).empty());
  bundle.touches[11] = 8;
  EXPECT_TRUE(Mentions(ErrorText([&] { MakeBodySurface(bundle, 4); }), "template.touches", "9 different masks",
                       "at most 8", "one mask"));
}

TEST(BodySurfaceTest, MasksAreReadBothOrNone) {
  dcloth::testing::RawFile raw = BuildBundle({});
  raw.SetMasks("body.parts", std::vector<int32_t>(12, 0x7FFFFFFF));
  EXPECT_TRUE(Mentions(ErrorText([&] { Parse(raw); }), "template.touches"));
  raw.SetMasks("template.touches", std::vector<int32_t>(60, 5));
  EXPECT_EQ(Parse(raw).touches, std::vector<uint32_t>(60, 5));
  EXPECT_EQ(Parse(raw).body_parts, std::vector<uint32_t>(12, 0x7FFFFFFF));
  raw.SetInt("template.touches", 59, -1);
  EXPECT_TRUE(Mentions(ErrorText([&] { Parse(raw); }), "template.touches", "-1 at vertex 59", "from 0 up"));
  raw.SetMasks("template.touches", std::vector<int32_t>(59, 5));
  EXPECT_TRUE(Mentions(ErrorText([&] { Parse(raw); }), "template.touches", "[59]", "[60]"));
  raw.Replace("template.touches", {60}, std::vector<float>(60, 1.0f));
  EXPECT_TRUE(Mentions(ErrorText([&] { Parse(raw); }), "template.touches", "F32", "I32"));
  raw.SetMasks("template.touches", std::vector<int32_t>(60, 5));
  raw.Erase("body.parts");
  EXPECT_TRUE(Mentions(ErrorText([&] { Parse(raw); }), "body.parts"));
}

// From the bundle to the engine, in every precision.
TEST(BodySurfaceTest, TheEngineOpensIt) {
  Bundle bundle = Parse(BuildBundle({}));
  for (const Precision precision : {Precision::kFp32, Precision::kFp16, Precision::kInt8}) {
    const FoldedBundle bare = FoldBundle(bundle, 4, 4);
    EXPECT_TRUE(bare.surface.empty());
    const OpenModel without(WriteModel(Assemble(bundle, bare, {precision, {}})));
    EXPECT_EQ(dcloth_model_body_vertex_count(without.model()), 0u);
    Bundle marked = bundle;
    marked.body_collides = Vector::Ones(12);
    const FoldedBundle folded = FoldBundle(marked, 4, 4);
    ASSERT_FALSE(folded.surface.empty());
    const OpenModel model(WriteModel(Assemble(marked, folded, {precision, {}})));
    EXPECT_EQ(dcloth_model_body_vertex_count(model.model()), folded.surface.vertices.size());
    EXPECT_EQ(model.info().format_minor, 2u);
    marked.touches.assign(60, 1);
    marked.body_parts.assign(12, 1);
    const OpenModel in_parts(WriteModel(Assemble(marked, FoldBundle(marked, 4, 4), {precision, {}})));
    EXPECT_EQ(dcloth_model_body_vertex_count(in_parts.model()), folded.surface.vertices.size());
    EXPECT_EQ(in_parts.info().format_minor, 4u);
  }
}

}  // namespace
}  // namespace dcloth::converter

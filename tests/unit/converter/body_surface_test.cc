#include "converter/body_surface.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <set>
#include <string>
#include <vector>

#include "converter/assemble.h"
#include "converter/rollout.h"
#include "kernels/nearest/nearest.h"
#include "tests/unit/converter/converter_testing.h"

namespace dcloth::converter {
namespace {

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
      EXPECT_LT((bundle.body_positions.row(surface.vertices[i]) - first).norm(), 0.5f)
          << "16 vertices of a lattice of 0.05 m";
    }
  }
}

// One vertex more than a group: the cut leaves a whole group on its left and one vertex, last along the longer side.
TEST(BodySurfaceTest, OneVertexMoreThanAGroupIsCutBehindTheGroup) {
  static_assert(kernels::kNearestGroup == 16);
  Bundle bundle = WithWall(6, 3);
  bundle.body_collides = Vector::Ones(18);
  bundle.body_collides[0] = 0;
  const BodySurface surface = MakeBodySurface(bundle, 4);
  ASSERT_EQ(surface.vertices.size(), 17u);
  EXPECT_EQ(surface.vertices.back() % 6, 5u) << "the last of its row";
  std::vector<uint32_t> sorted = surface.vertices, expected(17);
  std::sort(sorted.begin(), sorted.end());
  std::iota(expected.begin(), expected.end(), 1u);
  EXPECT_EQ(sorted, expected);
}

// What is just enough, in the unit of what is compared.
TEST(BodySurfaceTest, BonesAloneCarryFromAThousandthShortOn) {
  Bundle bundle = WithWall(2, 2);
  const auto collides = [&](double carried) {
    bundle.body_joint_weights.setZero();
    bundle.body_joint_weights.col(0).setConstant(static_cast<float>(1 - carried));
    // As three floats whose sum, exact at each step, is the number itself.
    double rest = carried;
    for (size_t i = 0; i < 3; ++i) {
      const auto part = static_cast<float>(rest);
      bundle.body_joint_weights.col(bundle.bones[i]).setConstant(part);
      rest -= static_cast<double>(part);
    }
    EXPECT_EQ(rest, 0);
    return !MakeBodySurface(bundle, 4).empty();
  };
  EXPECT_TRUE(collides(0.999));
  EXPECT_FALSE(collides(std::nextafter(0.999, 0)));
}

TEST(BodySurfaceTest, FacesLieCloserThanTheReach) {
  Bundle bundle = WithWall(2, 2);
  bundle.body_collides = Vector::Ones(4);
  bundle.template_positions.rowwise() = Eigen::RowVector3f(0.05f, 0.05f, 0.25f);
  EXPECT_EQ(MakeBodySurface(bundle, 4).faces.size(), 6u);
  bundle.body_positions = Matrix::Zero(4, 3);
  bundle.template_positions.rowwise() = Eigen::RowVector3f(0, 0.5f, 0);
  EXPECT_TRUE(MakeBodySurface(bundle, 4).empty());
  bundle.body_positions(2, 1) = 1e-3f;  // the last corner of the second face
  EXPECT_EQ(MakeBodySurface(bundle, 4).faces.size(), 3u);
}

// As many vertices, faces and faces around a vertex as the format holds are allowed; one more is left out where bones
// alone choose, and told where the bundle marks it.
TEST(BodySurfaceTest, TheFormatsLimitsAreAllowed) {
  constexpr int kColumns = 128, kRows = 64;
  Bundle full = WithWall(2 * kColumns, kRows);  // the right half hangs on no bone
  full.body_positions *= 0.01f;
  const auto with = [&](std::vector<Corners> more) {
    Bundle bundle = full;
    const Eigen::Index old = bundle.body_faces.rows();
    bundle.body_faces.conservativeResize(old + static_cast<Eigen::Index>(more.size()), 3);
    for (size_t f = 0; f < more.size(); ++f) {
      for (size_t c = 0; c < 3; ++c) {
        const auto row = old + static_cast<Eigen::Index>(f), column = static_cast<Eigen::Index>(c);
        bundle.body_faces(row, column) = static_cast<int32_t>(more[f][c]);
      }
    }
    return bundle;
  };
  const auto marks = [](Bundle bundle) {
    bundle.body_collides = bundle.body_joint_weights.col(bundle.bones[0]);
    return bundle;
  };
  const auto refusal = [&](const Bundle& bundle) {
    EXPECT_TRUE(MakeBodySurface(bundle, 4).empty());
    return ErrorText([&] { MakeBodySurface(marks(bundle), 4); });
  };
  const auto holds = [&](const Bundle& bundle, size_t vertices, size_t faces) {
    for (const Bundle& each : {bundle, marks(bundle)}) {
      const BodySurface surface = MakeBodySurface(each, 4);
      EXPECT_EQ(surface.vertices.size(), vertices);
      EXPECT_EQ(surface.faces.size(), 3 * faces);
    }
  };
  constexpr size_t kFaces = 2 * (kColumns - 1) * (kRows - 1);
  holds(full, 8192, kFaces);
  std::vector<Corners> again;  // faces of the wall's lower rows once more, until there are 16384
  for (uint32_t i = 0; again.size() < 16384 - kFaces; ++i) {
    if (i % (2 * kColumns) < kColumns - 1) again.push_back({i, i + 1, i + 2 * kColumns + 1});
  }
  holds(with(again), 8192, 16384);
  again.push_back({kColumns - 1, kColumns - 2, 2 * kColumns});
  EXPECT_TRUE(
      Mentions(refusal(with(again)), "found 8192 colliding vertices and 16385 faces", "at most 8192 vertices, 16384"));
  Bundle wider = with({{0, 1, kColumns}});
  wider.body_joint_weights.row(kColumns) = wider.body_joint_weights.row(0);
  EXPECT_TRUE(Mentions(refusal(wider), "found 8193 colliding vertices and " + std::to_string(kFaces + 1) + " faces"));
  for (const uint32_t vertex : {0u, 2u * kColumns * kRows - kColumns - 1}) {  // first and last one, in two faces each
    const uint32_t step = vertex == 0 ? 1 : uint32_t{0} - 1;
    std::vector<Corners> ring;
    while (ring.size() < 30) {
      const uint32_t other = vertex + step * static_cast<uint32_t>(ring.size() + 1);
      ring.push_back({vertex, other, other + step});
    }
    holds(with(ring), 8192, kFaces + 30);
    ring.push_back({vertex, vertex + 40 * step, vertex + 41 * step});
    EXPECT_TRUE(Mentions(refusal(with(ring)), "found 33 faces around vertex " + std::to_string(vertex) + ",",
                         "32 faces around a vertex"));
  }
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
                       "at most 8", "the same mask"));
}

// From the bundle to the engine, in every precision.
TEST(BodySurfaceTest, TheEngineOpensIt) {
  Bundle bundle = ParseBundle({});
  for (const Precision precision : kPrecisions) {
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
    EXPECT_EQ(model.info().format_minor, 6u) << "with the coarse mesh";
    marked.touches.assign(60, 1);
    marked.body_parts.assign(12, 1);
    const OpenModel in_parts(WriteModel(Assemble(marked, FoldBundle(marked, 4, 4), {precision, {}})));
    EXPECT_EQ(dcloth_model_body_vertex_count(in_parts.model()), folded.surface.vertices.size());
    EXPECT_EQ(in_parts.info().format_minor, 6u);
  }
}

}  // namespace
}  // namespace dcloth::converter

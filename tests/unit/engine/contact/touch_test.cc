// Cloth that touches some parts of the body only: a sleeve over an arm that lies in the trunk, against brute force.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <map>

#include "tests/unit/engine/allocation_trap.h"
#include "tests/unit/engine/cloth_fixture.h"
#include "tests/unit/engine/test_body.h"

namespace dcloth::testing {
namespace {

constexpr int kTicks = 6;
constexpr double kRounding = 2e-5;                       // as in penetration_test.cc
constexpr double kSame = 1e-8;                           // of distances to a surface and to its rim
constexpr uint8_t kSleeve = 1, kChest = 4, kCollar = 6;  // classes; nothing touches the last one

Point Minus(const Point& a, const Point& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
double Dot(const Point& a, const Point& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

double DistanceToEdge(const Point& p, const Point& a, const Point& b) {
  const Point edge = Minus(b, a), from = Minus(p, a);
  const double t = std::clamp(Dot(from, edge) / Dot(edge, edge), 0.0, 1.0);
  return std::hypot(from[0] - t * edge[0], from[1] - t * edge[1], from[2] - t * edge[2]);
}

double DistanceToRim(const EggBody& part, const std::vector<Point>& posed, const Point& p) {
  std::map<std::pair<uint16_t, uint16_t>, int> faces_at;
  for (size_t c = 0; c < part.faces.size(); ++c) {
    const uint16_t a = part.faces[c], b = part.faces[c % 3 == 2 ? c - 2 : c + 1];
    ++faces_at[std::minmax(a, b)];
  }
  double least = 1e30;
  for (const auto& [edge, count] : faces_at) {
    if (count == 1) least = std::min(least, DistanceToEdge(p, posed[edge.first], posed[edge.second]));
  }
  return least;
}

class TouchTest : public ::testing::Test {
 protected:
  TouchTest() {
    ModelSpec spec;
    spec.rings = 20;
    spec.segments = 30;
    model_ = BuildModel(spec);
    size_t trunk_vertices = 0;
    const EggBody body = AddTrunkAndArm(&model_, 14, 20, &trunk_vertices);
    trunk_ = arm_ = body;
    trunk_.faces.clear();
    arm_.faces.clear();
    for (size_t c = 0; c < body.faces.size(); ++c) {
      EggBody& part = body.faces[c - c % 3] < trunk_vertices ? trunk_ : arm_;
      part.faces.push_back(body.faces[c]);
    }
    for (size_t i = 0; i < n(); ++i) classes_.push_back(std::array{kSleeve, kChest, kCollar, kSleeve}[i % 4]);
    std::vector<uint8_t> touched_by(body.positions.size() / 3, 1 << kSleeve);
    std::fill_n(touched_by.begin(), trunk_vertices, uint8_t{1 << kChest});
    AddTouch(&model_, classes_, touched_by);
  }
  size_t n() const { return model_.numbers.n; }
  std::vector<float> Pose(int tick) const { return PoseAt(model_.numbers, tick / 30.0); }

  dcloth_status Skin(OwnedCloth* cloth, const std::vector<float>& matrices, uint32_t flags, std::vector<float>* out) {
    const dcloth_pose pose = OwnedCloth::Pose(matrices);
    out->resize(3 * n());
    dcloth_output output = MakeOutput(out->data(), nullptr, static_cast<uint32_t>(n()));
    output.flags = flags;
    return dcloth_cloth_skin(cloth->get(), &pose, 1, &output, nullptr);
  }
  static Point At(const std::vector<float>& out, size_t vertex) {
    return {static_cast<double>(out[3 * vertex]), static_cast<double>(out[3 * vertex + 1]),
            static_cast<double>(out[3 * vertex + 2])};
  }

  TestModel model_;
  EggBody trunk_, arm_;
  std::vector<uint8_t> classes_;
};

TEST_F(TouchTest, ClothIsPushedOutOfWhatItTouchesAlone) {
  const OpenedModel opened(model_);
  ASSERT_EQ(opened.status(), DCLOTH_OK) << opened.error().text;
  for (const std::string& isa : UsableIsas()) {
    ASSERT_EQ(dcloth_isa_select(isa.c_str()), DCLOTH_OK);
    OwnedCloth cloth(opened);
    size_t in_arm = 0, in_trunk = 0, at_rim = 0, left = 0;
    for (int tick = 0; tick < kTicks; ++tick) {
      ASSERT_EQ(cloth.Tick(Pose(tick), DCLOTH_STAGES_MESH), DCLOTH_OK);
      std::vector<float> before, after;
      ASSERT_EQ(Skin(&cloth, Pose(tick), 0, &before), DCLOTH_OK);
      ASSERT_EQ(Skin(&cloth, Pose(tick), DCLOTH_OUTPUT_OUTSIDE_BODY, &after), DCLOTH_OK);
      const std::vector<Point> posed = PoseBody(arm_, model_.numbers, Pose(tick));
      for (size_t i = 0; i < n(); ++i) {
        const bool same = std::memcmp(&before[3 * i], &after[3 * i], 12) == 0;
        const Point from = At(before, i), to = At(after, i);
        const EggBody& part = classes_[i] == kSleeve ? arm_ : trunk_;
        const double height = SignedDistance(part, posed, from);
        const bool ends = DistanceToRim(part, posed, from) - std::fabs(height) < kSame;
        if (classes_[i] == kCollar || ends || height > part.clearance + kRounding) {
          const double now = SignedDistance(part, posed, to);  // gives way, where the cloth beside it was pushed
          const bool ends_now = DistanceToRim(part, posed, to) - std::fabs(now) < kSame;
          const bool outside = ends || ends_now || now >= 0.99 * part.clearance - kRounding;
          // What touches nothing goes along with its neighbours from the second frame on.
          ASSERT_TRUE(same || (classes_[i] == kCollar ? tick > 0 : outside))
              << isa << " tick " << tick << " vertex " << i << " class " << int{classes_[i]} << " from " << height;
          at_rim += ends;
          left += SignedDistance(trunk_, posed, from) < 0;
          continue;
        }
        const double now = SignedDistance(part, posed, to);
        const bool ends_now = DistanceToRim(part, posed, to) - std::fabs(now) < kSame;
        ASSERT_TRUE(now >= 0.99 * part.clearance - kRounding || ends_now)
            << isa << " tick " << tick << " vertex " << i << " from " << height << " to " << now;
        (classes_[i] == kSleeve ? in_arm : in_trunk) += height < 0;
      }
    }
    EXPECT_GT(in_arm, 50u) << isa;
    EXPECT_GT(in_trunk, 100u) << isa;
    EXPECT_GT(at_rim, 100u) << isa;
    EXPECT_GT(left, 200u) << isa << ": in the trunk, which they do not touch";
  }
  dcloth_isa_select(nullptr);
}

// One class that touches everything is the same as none.
TEST_F(TouchTest, OneClassOfAllChangesNoBit) {
  TestModel plain = BuildModel(model_.numbers.spec);
  AddBody(&plain);
  TestModel same = BuildModel(model_.numbers.spec);
  AddBody(&same);
  AddTouch(&same, std::vector<uint8_t>(n(), 7), std::vector<uint8_t>(282, 0x80));
  const OpenedModel first(plain), second(same);
  ASSERT_EQ(second.status(), DCLOTH_OK) << second.error().text;
  OwnedCloth one(first), other(second);
  for (int tick = 0; tick < kTicks; ++tick) {
    ASSERT_EQ(one.Tick(Pose(tick), DCLOTH_STAGES_MESH), DCLOTH_OK);
    ASSERT_EQ(other.Tick(Pose(tick), DCLOTH_STAGES_MESH), DCLOTH_OK);
    std::vector<float> expected, found;
    ASSERT_EQ(Skin(&one, Pose(tick), DCLOTH_OUTPUT_OUTSIDE_BODY, &expected), DCLOTH_OK);
    ASSERT_EQ(Skin(&other, Pose(tick), DCLOTH_OUTPUT_OUTSIDE_BODY, &found), DCLOTH_OK);
    ASSERT_EQ(expected, found) << tick;
  }
}

TEST_F(TouchTest, CostsNoAllocation) {
  const OpenedModel opened(model_);
  OwnedCloth cloth(opened);
  ASSERT_EQ(cloth.Tick(Pose(0), DCLOTH_STAGES_MESH), DCLOTH_OK);
  std::vector<float> out;
  const std::vector<float> pose = Pose(0);
  ASSERT_EQ(Skin(&cloth, pose, 0, &out), DCLOTH_OK);
  const AllocationTrap trap;
  Skin(&cloth, pose, DCLOTH_OUTPUT_OUTSIDE_BODY, &out);
  EXPECT_EQ(trap.count(), 0u);
}

}  // namespace
}  // namespace dcloth::testing

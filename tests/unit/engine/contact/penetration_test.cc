// The garment outside the body: against brute force in double, on every instruction set.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "tests/unit/engine/allocation_trap.h"
#include "tests/unit/engine/cloth_fixture.h"
#include "tests/unit/engine/test_body.h"

namespace dcloth::testing {
namespace {

constexpr uint32_t kAll = DCLOTH_STAGES_MESH;
constexpr int kTicks = 8;
// Vertices are rounded to floats up to 10 m from the origin, and so is the body that the engine poses.
constexpr double kRounding = 2e-5;

class PenetrationTest : public ::testing::Test {
 protected:
  static ModelSpec Spec() {
    ModelSpec spec;
    spec.rings = 20;
    spec.segments = 30;
    return spec;
  }
  size_t n() const { return model_.numbers.n; }
  std::vector<float> Pose(int tick) const { return PoseAt(model_.numbers, tick / 30.0); }

  dcloth_status Skin(OwnedCloth* cloth, const std::vector<float>& matrices, uint32_t flags, std::vector<float>* out,
                     dcloth_timer* timer = nullptr) {
    const dcloth_pose pose = OwnedCloth::Pose(matrices);
    out->resize(6 * n());
    dcloth_output output = FloatOutput(n(), out->data(), 24, out->data() + 3);
    output.flags = flags;
    return dcloth_cloth_skin(cloth->get(), &pose, 1, &output, timer);
  }
  static Point At(const std::vector<float>& out, size_t vertex) {
    return {static_cast<double>(out[6 * vertex]), static_cast<double>(out[6 * vertex + 1]),
            static_cast<double>(out[6 * vertex + 2])};
  }

  TestModel model_ = BuildModel(Spec());
  EggBody body_ = AddBody(&model_);
  OpenedModel opened_{model_};
};

TEST_F(PenetrationTest, NoVertexIsLeftUnderTheSkinAndNoOtherIsDrawnInto) {
  ASSERT_EQ(opened_.status(), DCLOTH_OK) << opened_.error().text;
  EXPECT_EQ(dcloth_model_body_vertex_count(opened_.get()), 282u);
  for (const std::string& isa : UsableIsas()) {
    ASSERT_EQ(dcloth_isa_select(isa.c_str()), DCLOTH_OK);
    OwnedCloth cloth(opened_);
    size_t under = 0, deep = 0, clear = 0;
    for (int tick = 0; tick < kTicks; ++tick) {
      ASSERT_EQ(cloth.Tick(Pose(tick), kAll), DCLOTH_OK);
      std::vector<float> before, after;
      ASSERT_EQ(Skin(&cloth, Pose(tick), 0, &before), DCLOTH_OK);
      ASSERT_EQ(Skin(&cloth, Pose(tick), DCLOTH_OUTPUT_OUTSIDE_BODY, &after), DCLOTH_OK);
      const std::vector<Point> posed = PoseBody(body_, model_.numbers, Pose(tick));
      for (size_t i = 0; i < n(); ++i) {
        const Point from = At(before, i), to = At(after, i);
        const double height = SignedDistance(body_, posed, from);
        const double move = std::hypot(to[0] - from[0], to[1] - from[1], to[2] - from[2]);
        if (height > body_.clearance + kRounding) {
          ASSERT_GE(SignedDistance(body_, posed, to), 0.99 * body_.clearance - kRounding)
              << isa << " tick " << tick << " vertex " << i << " from " << height;
          clear += std::memcmp(&before[6 * i], &after[6 * i], 12) == 0;
          continue;
        }
        ASSERT_GE(SignedDistance(body_, posed, to), 0.99 * body_.clearance - kRounding)
            << isa << " tick " << tick << " vertex " << i << " from " << height;
        ASSERT_GE(move, 0.99 * body_.clearance - height - kRounding);
        under += height < 0;
        deep += height < -0.05;
      }
    }
    EXPECT_GT(under, 100u) << isa;
    EXPECT_GT(deep, 10u) << isa;
    EXPECT_GT(clear, 1000u) << isa;
  }
  dcloth_isa_select(nullptr);
}

TEST_F(PenetrationTest, NormalsAreThoseOfTheMovedGarmentAndTheStateIsUntouched) {
  OwnedCloth cloth(opened_), twin(opened_);
  std::vector<float> first, second;
  size_t turned = 0;
  for (int tick = 0; tick < kTicks; ++tick) {
    ASSERT_EQ(cloth.Tick(Pose(tick), kAll), DCLOTH_OK);
    ASSERT_EQ(twin.Tick(Pose(tick), kAll), DCLOTH_OK);
    ASSERT_EQ(Skin(&cloth, Pose(tick), DCLOTH_OUTPUT_OUTSIDE_BODY, &first), DCLOTH_OK);
    ASSERT_EQ(Skin(&twin, Pose(tick), 0, &second), DCLOTH_OK);
    for (size_t i = 0; i < n(); ++i) turned += std::memcmp(&first[6 * i + 3], &second[6 * i + 3], 12) != 0;
    ASSERT_EQ(Skin(&cloth, Pose(tick), 0, &first), DCLOTH_OK);
    ASSERT_EQ(first, second) << tick;
  }
  EXPECT_GT(turned, 100u);
}

// A left-handed host in centimetres sees the same garment.
TEST_F(PenetrationTest, MirroredSpacesPushOutwardToo) {
  OwnedCloth cloth(opened_), hosted(opened_);
  const dcloth_space unity = MakeSpace(DCLOTH_AXIS_MINUS_X, DCLOTH_AXIS_Y, DCLOTH_AXIS_Z, 0.01f);
  ASSERT_EQ(dcloth_cloth_set_space(hosted.get(), &unity, nullptr), DCLOTH_OK);
  std::vector<float> plain, moved, mirrored;
  size_t pushed = 0;
  for (int tick = 0; tick < kTicks; ++tick) {
    const std::vector<float> pose = Pose(tick);
    std::vector<float> host = pose;
    for (size_t j = 0; j < host.size(); j += 16) {
      for (size_t r = 0; r < 3; ++r) {
        for (size_t c = 0; c < 3; ++c) host[j + 4 * r + c] *= (r == 0) != (c == 0) ? -1.0f : 1.0f;
        host[j + 4 * r + 3] *= r == 0 ? -100.0f : 100.0f;
      }
    }
    ASSERT_EQ(cloth.Tick(pose, kAll), DCLOTH_OK);
    ASSERT_EQ(hosted.Tick(host, kAll), DCLOTH_OK);
    ASSERT_EQ(Skin(&cloth, pose, 0, &plain), DCLOTH_OK);
    ASSERT_EQ(Skin(&cloth, pose, DCLOTH_OUTPUT_OUTSIDE_BODY, &moved), DCLOTH_OK);
    ASSERT_EQ(Skin(&hosted, host, DCLOTH_OUTPUT_OUTSIDE_BODY, &mirrored), DCLOTH_OK);
    const std::vector<Point> posed = PoseBody(body_, model_.numbers, pose);
    for (size_t i = 0; i < n(); ++i) {
      const Point at = {-0.01 * static_cast<double>(mirrored[6 * i]), 0.01 * static_cast<double>(mirrored[6 * i + 1]),
                        0.01 * static_cast<double>(mirrored[6 * i + 2])};
      ASSERT_GE(SignedDistance(body_, posed, at), 0.99 * body_.clearance - 3 * kRounding) << tick << " vertex " << i;
      pushed += std::memcmp(&plain[6 * i], &moved[6 * i], 12) != 0;
    }
  }
  EXPECT_GT(pushed, 100u);
}

TEST_F(PenetrationTest, CostsNoAllocationAndIsTimedAlone) {
  OwnedCloth cloth(opened_);
  ASSERT_EQ(cloth.Tick(Pose(0), kAll), DCLOTH_OK);
  uint64_t now = 0;
  dcloth_timer timer = {};
  timer.struct_size = sizeof(timer);
  timer.context = &now;
  timer.now = [](void* context) { return ++*static_cast<uint64_t*>(context); };
  std::vector<float> out;
  const std::vector<float> pose = Pose(0);
  ASSERT_EQ(Skin(&cloth, pose, 0, &out, &timer), DCLOTH_OK);
  EXPECT_EQ(timer.elapsed[DCLOTH_STEP_PENETRATION], 0u);
  size_t seen;
  {
    const AllocationTrap trap;
    Skin(&cloth, pose, DCLOTH_OUTPUT_OUTSIDE_BODY, &out, &timer);
    seen = trap.count();
  }
  EXPECT_EQ(seen, 0u);
  timer.elapsed[DCLOTH_STEP_PENETRATION] = 0;
  ASSERT_EQ(Skin(&cloth, pose, DCLOTH_OUTPUT_OUTSIDE_BODY, &out, &timer), DCLOTH_OK);
  EXPECT_EQ(timer.elapsed[DCLOTH_STEP_PENETRATION], 4u) << "posed skin, limbs, giving way, push";
  EXPECT_EQ(Skin(&cloth, pose, 2, &out), DCLOTH_ERROR_ARGUMENT) << "an unknown flag";
}

TEST_F(PenetrationTest, ModelsWithoutABodyTakeTheFlag) {
  const TestModel bare = BuildModel(Spec());
  const OpenedModel opened(bare);
  EXPECT_EQ(dcloth_model_body_vertex_count(opened.get()), 0u);
  EXPECT_EQ(dcloth_model_body_vertex_count(nullptr), 0u);
  EXPECT_LT(dcloth_cloth_storage_size(opened.get()), dcloth_cloth_storage_size(opened_.get()));
  OwnedCloth cloth(opened);
  std::vector<float> without, with;
  ASSERT_EQ(cloth.Tick(Pose(0), kAll), DCLOTH_OK);
  ASSERT_EQ(Skin(&cloth, Pose(0), 0, &without), DCLOTH_OK);
  ASSERT_EQ(Skin(&cloth, Pose(0), DCLOTH_OUTPUT_OUTSIDE_BODY, &with), DCLOTH_OK);
  EXPECT_EQ(without, with);
}

// Joints scaled to nothing leave no surface, a reach of little leaves deep vertices where they are: neither is a fault.
TEST_F(PenetrationTest, CollapsedBodiesAndShortReachesPushNothing) {
  OwnedCloth cloth(opened_);
  std::vector<float> pose = Pose(0);
  for (size_t j = 0; j < pose.size(); j += 16) {
    for (size_t r = 0; r < 3; ++r) {
      for (size_t c = 0; c < 3; ++c) pose[j + 4 * r + c] = 0;
    }
  }
  std::vector<float> without, with;
  ASSERT_EQ(Skin(&cloth, pose, 0, &without), DCLOTH_OK);
  ASSERT_EQ(Skin(&cloth, pose, DCLOTH_OUTPUT_OUTSIDE_BODY, &with), DCLOTH_OK);
  for (const float value : with) EXPECT_TRUE(std::isfinite(value));

  TestModel shallow = BuildModel(Spec());
  const EggBody body = AddBody(&shallow, 14, 20, 0.002f, 0.05f);
  const OpenedModel opened(shallow);
  ASSERT_EQ(opened.status(), DCLOTH_OK) << opened.error().text;
  OwnedCloth near(opened);
  ASSERT_EQ(near.Tick(Pose(3), kAll), DCLOTH_OK);
  ASSERT_EQ(Skin(&near, Pose(3), 0, &without), DCLOTH_OK);
  ASSERT_EQ(Skin(&near, Pose(3), DCLOTH_OUTPUT_OUTSIDE_BODY, &with), DCLOTH_OK);
  const std::vector<Point> posed = PoseBody(body, shallow.numbers, Pose(3));
  size_t deep = 0, taken_along = 0;
  for (size_t i = 0; i < n(); ++i) {
    if (SignedDistance(body, posed, At(without, i)) > -0.05 - kRounding) continue;
    taken_along += SignedDistance(body, posed, At(with, i)) > 0;
    ++deep;
  }
  EXPECT_GT(deep, 0u);
  EXPECT_LT(taken_along, deep / 4) << "cloth that was pushed far takes some of what is beside it along";
}

}  // namespace
}  // namespace dcloth::testing

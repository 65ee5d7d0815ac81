// The bytes of a fit: a cloth that wears them draws what the fitted one draws, in any space and with joints in any
// order; whatever else a file holds is refused with a word on why, and harms nothing.
#include "engine/format/fit_file.h"

#include <cmath>
#include <functional>
#include <iterator>
#include <limits>
#include <random>
#include <utility>

#include "tests/unit/fit/fit_fixture.h"

namespace dcloth::testing {
namespace {

using format::FitHead;
using format::FitJoint;
using format::FitLayout;

constexpr size_t kHead = sizeof(FitHead);

void Seal(AlignedBytes* fit) {
  if (fit->size() < kHead) return;
  const uint64_t sum = format::Checksum(fit->data() + format::kFitSummedFrom, fit->size() - format::kFitSummedFrom);
  std::memcpy(fit->data() + offsetof(FitHead, checksum), &sum, sizeof(sum));
}

FitHead* HeadOf(AlignedBytes* fit) { return reinterpret_cast<FitHead*>(fit->data()); }
FitJoint* JointsOf(AlignedBytes* fit) {
  return reinterpret_cast<FitJoint*>(fit->data() + format::LayoutOf(*HeadOf(fit)).joints);
}
template <typename T>
T* At(AlignedBytes* fit, size_t FitLayout::*part) {
  return reinterpret_cast<T*>(fit->data() + format::LayoutOf(*HeadOf(fit)).*part);
}

class FitFileTest : public BodyFitTest {
 protected:
  FitFileTest() : BodyFitTest(8, 9) {}

  AlignedBytes Fitted(OwnedCloth* cloth, const Host& host) {
    dcloth_fit fit = EmptyFit();
    dcloth_error error = EmptyError();
    EXPECT_EQ(Fit(cloth, host, &fit, &error), DCLOTH_OK) << error.text;
    EXPECT_EQ(fit.file_bytes % DCLOTH_ALIGNMENT, 0u);
    return {storage_.data(), static_cast<size_t>(fit.file_bytes)};
  }
  AlignedBytes Fitted(const Host& host) {
    OwnedCloth cloth(opened_);
    return Fitted(&cloth, host);
  }

  std::vector<float> Drawn(OwnedCloth* cloth, const std::vector<float>& matrices, float seconds = kFrame) const {
    std::vector<float> positions(3 * size_t{opened_.info().vertex_count});
    dcloth_output output = FloatOutput(positions.size() / 3, positions.data(), 12, nullptr);
    output.flags = DCLOTH_OUTPUT_OUTSIDE_BODY;
    const dcloth_pose pose = OwnedCloth::Pose(matrices);
    const dcloth_frame frame = {sizeof(frame), kAll, seconds, 0, nullptr};
    EXPECT_EQ(dcloth_cloth_update(cloth->get(), &pose, &frame, &output, nullptr), DCLOTH_OK);
    return positions;
  }

  // Refused in these words, and the cloth draws on.
  void ExpectRefused(const AlignedBytes& fit, dcloth_status status, const std::string& text) {
    OwnedCloth cloth(opened_), plain(opened_);
    dcloth_error error = EmptyError();
    EXPECT_EQ(dcloth_cloth_set_fit(cloth.get(), fit.data(), fit.size(), &error), status) << error.text;
    EXPECT_EQ(dcloth_cloth_set_fit(cloth.get(), fit.data(), fit.size(), nullptr), status) << "without an error to fill";
    EXPECT_NE(std::string(error.text).find(text), std::string::npos) << error.text << "\nwithout: " << text;
    EXPECT_GT(error.mend_size, 0) << error.text;
    EXPECT_TRUE(error.offset_bytes == UINT64_MAX || error.offset_bytes < fit.size()) << error.text;
    EXPECT_EQ(Drawn(&cloth, Pose(0)), Drawn(&plain, Pose(0)));
  }
};

TEST_F(FitFileTest, ItsBytesAreTheFit) {
  for (const bool skin : {true, false}) {
    SCOPED_TRACE(skin);
    Host host = Wearer(1.1);
    if (!skin) host.body.clear();
    OwnedCloth fitted(opened_), other(opened_);
    const AlignedBytes fit = Fitted(&fitted, host);
    dcloth_error error = EmptyError();
    ASSERT_EQ(dcloth_cloth_set_fit(other.get(), fit.data(), fit.size(), &error), DCLOTH_OK) << error.text;
    OwnedCloth plain(opened_);
    bool same = true;
    for (int frame = 0; frame < 8; ++frame) {
      const std::vector<float> drawn = Drawn(&fitted, Pose(frame));
      ASSERT_EQ(Drawn(&other, Pose(frame)), drawn) << frame;
      same &= drawn == Drawn(&plain, Pose(frame));
    }
    EXPECT_FALSE(same && skin) << "a test in which the fit makes no difference";
  }
}

// Made in metres and the default axes, worn by a host of centimetres and a left-handed space.
TEST_F(FitFileTest, OneFileServesEverySpace) {
  const dcloth_space space = MakeSpace(DCLOTH_AXIS_MINUS_X, DCLOTH_AXIS_Y, DCLOTH_AXIS_Z, 0.01f);
  OwnedCloth fitted(opened_), other(opened_);
  const AlignedBytes fit = Fitted(&fitted, Wearer(1.1));
  ASSERT_EQ(dcloth_cloth_set_space(other.get(), &space, nullptr), DCLOTH_OK);
  ASSERT_EQ(dcloth_cloth_set_fit(other.get(), fit.data(), fit.size(), nullptr), DCLOTH_OK);
  for (int frame = 0; frame < 8; ++frame) {
    std::vector<float> pose = Pose(frame), there = pose;
    for (size_t i = 0; i < pose.size(); ++i) {
      const size_t row = i % 16 / 4, column = i % 4;
      const float sign = (row == 0) != (column == 0) ? -1.0f : 1.0f;
      there[i] = pose[i] * sign * (row < 3 && column == 3 ? 100.0f : 1.0f);
    }
    const std::vector<float> expected = Drawn(&fitted, pose), found = Drawn(&other, there);
    for (size_t i = 0; i < expected.size(); ++i)
      ASSERT_NEAR(found[i] * (i % 3 == 0 ? -0.01f : 0.01f), expected[i], 2e-4f) << frame << ", " << i;
  }
}

// Searches for a character whose fit the library makes and the cloth refuses: that would have overwritten the fit
// before.
TEST_F(FitFileTest, WhatTheLibraryMakesIsWorn) {
  constexpr float kWeights[] = {0, 1e-45f, 1e-38f, 1e-20f, 0.3f, 1, 1e9f}, kMoves[] = {0, 1e-30f, 0.01f, 1, 1e4f, 1e9f};
  std::mt19937 random(5);
  const auto one_of = [&random](const auto& values) { return values[random() % std::size(values)]; };
  int worn = 0, refused = 0;
  for (int i = 0; i < 150; ++i) {
    Host host = Wearer(0.8 + 0.5 * static_cast<double>(random() % 100) / 100);
    const uint32_t rate = 1u << (random() % 12);
    for (float& weight : host.body_weights) weight = random() % rate == 0 ? one_of(kWeights) : weight;
    for (float& x : host.body) x += random() % (8 * rate) == 0 ? one_of(kMoves) : 0;
    const float size = std::pow(10.0f, static_cast<float>(random() % 400) / 100 - 2);
    if (random() % 4 == 0) {
      for (float& x : host.body) x *= size;
      for (size_t k = 0; k < host.bind.size(); ++k) host.bind[k] *= k % 4 == 3 && k % 16 < 12 ? size : 1;
    }
    if (random() % 4 == 0) host.bind[16 * (random() % joints()) + 4 * (random() % 3) + 3] += one_of(kMoves);
    OwnedCloth cloth(opened_);
    dcloth_error error = EmptyError();
    const dcloth_status status = Fit(&cloth, host, nullptr, &error);
    ASSERT_TRUE(status == DCLOTH_OK || status == DCLOTH_ERROR_ARGUMENT || status == DCLOTH_ERROR_POSE ||
                status == DCLOTH_ERROR_JOINTS)
        << i << ": " << error.text;
    ++(status == DCLOTH_OK ? worn : refused);
  }
  EXPECT_GT(worn, 30);
  EXPECT_GT(refused, 10);
}

// A host that has the character's joints in another order, among others of its own.
TEST_F(FitFileTest, JointsAreBoundByTheCharactersNames) {
  Host host = Wearer(1);
  for (std::string& name : host.names) name.insert(0, "mixamorig:");
  OwnedCloth fitted(opened_), other(opened_);
  const AlignedBytes fit = Fitted(&fitted, host);
  ASSERT_EQ(dcloth_cloth_set_fit(other.get(), fit.data(), fit.size(), nullptr), DCLOTH_OK);
  std::vector<const char*> names = {"tail"};
  for (size_t j = joints(); j-- > 0;) names.push_back(host.names[j].c_str());
  dcloth_error error = EmptyError();
  ASSERT_EQ(dcloth_cloth_bind_joints(other.get(), names.data(), static_cast<uint32_t>(names.size() - 1), &error),
            DCLOTH_ERROR_JOINTS)
      << "without the last one";
  EXPECT_NE(std::string(error.text).find("1 of 22 joints missing: 'mixamorig:Hips'"), std::string::npos) << error.text;
  ASSERT_EQ(dcloth_cloth_bind_joints(other.get(), names.data(), static_cast<uint32_t>(names.size()), &error), DCLOTH_OK)
      << error.text;
  for (int frame = 0; frame < 4; ++frame) {
    const std::vector<float> pose = Pose(frame);
    std::vector<float> there(pose.begin(), pose.begin() + 16);
    for (size_t j = joints(); j-- > 0;) there.insert(there.end(), pose.begin() + 16 * j, pose.begin() + 16 * (j + 1));
    ASSERT_EQ(Drawn(&other, there), Drawn(&fitted, pose)) << frame;
  }
}

TEST_F(FitFileTest, EveryPrefixIsRefused) {
  const AlignedBytes whole = Fitted(Wearer(1));
  OwnedCloth cloth(opened_);
  for (size_t size = 0; size < whole.size(); size += size < 4 * kHead ? 1 : 37) {
    AlignedBytes prefix(whole.data(), size);
    dcloth_error error = EmptyError();
    ASSERT_EQ(dcloth_cloth_set_fit(cloth.get(), prefix.data(), size, &error), DCLOTH_ERROR_FORMAT) << size;
    if (size < kHead) continue;
    HeadOf(&prefix)->size = size;
    Seal(&prefix);
    ASSERT_EQ(dcloth_cloth_set_fit(cloth.get(), prefix.data(), size, &error), DCLOTH_ERROR_FORMAT) << size;
  }
}

TEST_F(FitFileTest, OneFaultEach) {
  const AlignedBytes good = Fitted(Wearer(1));
  const float nan = std::nanf("");
  struct Fault {
    dcloth_status status;
    const char* text;
    std::function<void(AlignedBytes*)> spoil;
  };
  const Fault faults[] = {
      {DCLOTH_ERROR_FORMAT, "different bytes at the start; allowed: DCLF", [](auto* f) { f->data()[1] = 'X'; }},
      {DCLOTH_ERROR_VERSION, "version: found 2; allowed: 1", [](auto* f) { HeadOf(f)->version = 2; }},
      {DCLOTH_ERROR_FORMAT, "bytes; allowed: 64", [](auto* f) { HeadOf(f)->size = 64; }},
      {DCLOTH_ERROR_MODEL, "figure: found a fit of the garment 'tube'; allowed: one of this model, 'tube'",
       [](auto* f) { HeadOf(f)->figure += 1; }},
      {DCLOTH_ERROR_SEMANTICS, "joint_count: found 21; allowed: 22", [](auto* f) { HeadOf(f)->joint_count = 21; }},
      {DCLOTH_ERROR_SEMANTICS, "host_joint_count: found 0", [](auto* f) { HeadOf(f)->host_joint_count = 0; }},
      {DCLOTH_ERROR_SEMANTICS, "host_joint_count: found 4097", [](auto* f) { HeadOf(f)->host_joint_count = 4097; }},
      {DCLOTH_ERROR_SEMANTICS, "vertex_count: found 1;", [](auto* f) { HeadOf(f)->vertex_count = 1; }},
      {DCLOTH_ERROR_SEMANTICS, "body_vertex_count: found", [](auto* f) { HeadOf(f)->vertex_count = 0; }},
      {DCLOTH_ERROR_SEMANTICS, "body_vertex_count: found 4294967295",
       [](auto* f) { HeadOf(f)->body_vertex_count = UINT32_MAX; }},
      {DCLOTH_ERROR_SEMANTICS, "influences: found 9", [](auto* f) { HeadOf(f)->influences = 9; }},
      {DCLOTH_ERROR_SEMANTICS, "unused: found 1", [](auto* f) { HeadOf(f)->unused = 1; }},
      {DCLOTH_ERROR_SEMANTICS, "scale: found 0", [](auto* f) { HeadOf(f)->scale = 0; }},
      {DCLOTH_ERROR_SEMANTICS, "scale: found NaN", [&](auto* f) { HeadOf(f)->scale = static_cast<double>(nan); }},
      {DCLOTH_ERROR_SEMANTICS, "clearance: found NaN", [&](auto* f) { HeadOf(f)->clearance = nan; }},
      {DCLOTH_ERROR_SEMANTICS, "reach: found", [](auto* f) { HeadOf(f)->reach = 1e-4f; }},
      {DCLOTH_ERROR_SEMANTICS, "joints[3].motion: found inf",
       [](auto* f) { JointsOf(f)[3].motion[1][2] = std::numeric_limits<double>::infinity(); }},
      {DCLOTH_ERROR_SEMANTICS, "joints[3].host: found 22; allowed: less than host_joint_count",
       [](auto* f) { JointsOf(f)[3].host = 22; }},
      {DCLOTH_ERROR_SEMANTICS, "joints[21].name: found no terminator",
       [](auto* f) { std::memset(JointsOf(f)[21].name, 'x', sizeof(FitJoint::name)); }},
      {DCLOTH_ERROR_SEMANTICS, "positions[4]: found NaN",
       [&](auto* f) { At<float>(f, &FitLayout::positions)[4] = nan; }},
      {DCLOTH_ERROR_SEMANTICS, "body.positions[5]: found NaN",
       [&](auto* f) { At<float>(f, &FitLayout::body_positions)[5] = nan; }},
      {DCLOTH_ERROR_SEMANTICS, "body.weights[1]: found weights that",
       [](auto* f) { At<float>(f, &FitLayout::body_weights)[2] = -1; }},
      {DCLOTH_ERROR_SEMANTICS, "body.joints[6]: found a joint past the last one",
       [](auto* f) { At<uint8_t>(f, &FitLayout::body_joints)[6] = 22; }},
  };
  for (const Fault& fault : faults) {
    SCOPED_TRACE(fault.text);
    AlignedBytes spoilt = good;
    fault.spoil(&spoilt);
    Seal(&spoilt);
    ExpectRefused(spoilt, fault.status, fault.text);
  }
  AlignedBytes damaged = good;
  damaged.data()[damaged.size() - 70] ^= 1;
  ExpectRefused(damaged, DCLOTH_ERROR_FORMAT, "a checksum that does not match");
  OwnedCloth cloth(opened_);
  dcloth_error error = EmptyError();
  EXPECT_EQ(dcloth_cloth_set_fit(cloth.get(), good.data() + 4, good.size() - 4, &error), DCLOTH_ERROR_ALIGNMENT);
  EXPECT_EQ(dcloth_cloth_set_fit(nullptr, good.data(), good.size(), &error), DCLOTH_ERROR_ARGUMENT);
  EXPECT_EQ(dcloth_cloth_set_fit(cloth.get(), nullptr, 0, &error), DCLOTH_ERROR_ARGUMENT);
}

// Under sanitizers: a byte of the file that is wrong, and the checksum right, leads no read or write astray.
TEST_F(FitFileTest, NoByteIsTrusted) {
  const AlignedBytes good = Fitted(Wearer(1));
  size_t worn = 0, refused = 0;
  for (size_t at = 0; at < good.size(); at += at < kHead + 2 * sizeof(FitJoint) ? 1 : 41) {
    for (const uint8_t flip : {0x01, 0x80, 0xFF}) {
      AlignedBytes fit = good;
      fit.data()[at] ^= flip;
      Seal(&fit);
      OwnedCloth cloth(opened_);
      const dcloth_status status = dcloth_cloth_set_fit(cloth.get(), fit.data(), fit.size(), nullptr);
      ++(status == DCLOTH_OK ? worn : refused);
      if (status != DCLOTH_OK) continue;
      std::vector<float> pose = Training();
      pose.resize(16 * size_t{HeadOf(&fit)->host_joint_count});
      const dcloth_pose given = OwnedCloth::Pose(pose);
      const dcloth_frame frame = {sizeof(frame), kAll, kFrame, 0, nullptr};
      std::vector<float> positions(3 * size_t{opened_.info().vertex_count});
      dcloth_output output = FloatOutput(positions.size() / 3, positions.data(), 12, nullptr);
      output.flags = DCLOTH_OUTPUT_OUTSIDE_BODY;
      (void)dcloth_cloth_update(cloth.get(), &given, &frame, &output, nullptr);  // refused or not
    }
  }
  EXPECT_GT(worn, 100u);
  EXPECT_GT(refused, 100u);
}

}  // namespace
}  // namespace dcloth::testing

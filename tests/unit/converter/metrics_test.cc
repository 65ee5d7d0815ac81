#include "converter/metrics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/unit/converter/converter_testing.h"

namespace dcloth::converter {
namespace {

const std::vector<uint16_t> kTriangle = {0, 1, 2};
const std::vector<float> kFlat = {0, 0, 0, 1, 0, 0, 0, 1, 0};

TEST(MetricsTest, NothingIsZero) {
  ErrorMeter meter(kTriangle, 3);
  EXPECT_EQ(meter.Result().frame_count, 0u);
  EXPECT_EQ(meter.Result().position_mm.max, 0);
  EXPECT_EQ(meter.Result().position_mm.mean, 0);
  EXPECT_EQ(meter.Result().position_mm.std, 0);
  EXPECT_EQ(meter.Result().normal_deg.std, 0);
  meter.AddFrame(kFlat, kFlat);
  const MeshError same = meter.Result();
  EXPECT_EQ(same.position_mm.mean, 0);
  EXPECT_EQ(same.normal_deg.mean, 0);
}

TEST(MetricsTest, DistancesByHand) {
  ErrorMeter meter(kTriangle, 3);
  // Exact in float: 3-4-5 triangles of 1/512 m. Frame means 0 and (5 + 10 + 0) / 3 / 512 m.
  std::vector<float> moved = kFlat;
  moved[0] = 3 / 512.0f, moved[1] = 4 / 512.0f;
  moved[5] = 10 / 512.0f;
  meter.AddFrame(kFlat, kFlat);
  meter.AddFrame(moved, kFlat);
  const PositionError error = meter.Result().position_mm;
  EXPECT_DOUBLE_EQ(error.mean, 2500.0 / 512);
  EXPECT_DOUBLE_EQ(error.std, 2500.0 / 512);
  // Sorted: 0 0 0 0 5 10. Nearest rank: p50 is the 3rd, p95 and p99 the 6th.
  EXPECT_EQ(error.p50, 0);
  EXPECT_EQ(error.p95, 10000.0f / 512);
  EXPECT_EQ(error.p99, 10000.0f / 512);
  EXPECT_EQ(error.max, 10000.0f / 512);
}

TEST(MetricsTest, PercentilesAreNearestRank) {
  std::vector<float> base(300, 0.0f), moved(300, 0.0f);
  for (size_t i = 0; i < 100; ++i) moved[3 * i] = static_cast<float>(100 - i) / 1024;  // 1 to 100, backwards
  const std::vector<uint16_t> triangle = {0, 1, 2};
  ErrorMeter meter(triangle, 100);
  meter.AddFrame(moved, base);
  const PositionError error = meter.Result().position_mm;
  const auto mm = [](int rank) { return static_cast<double>(static_cast<float>(1000.0 * rank / 1024)); };
  EXPECT_EQ(error.p50, mm(50));
  EXPECT_EQ(error.p95, mm(95));
  EXPECT_EQ(error.p99, mm(99));
  EXPECT_EQ(error.max, mm(100));
}

TEST(MetricsTest, PercentilesOfFewAndPointsWithoutFaces) {
  ErrorMeter meter({}, 2);
  meter.AddFrame(std::vector<float>{1, 0, 0, 0, 2, 0}, std::vector<float>(6));
  EXPECT_EQ(meter.Result().position_mm.p50, 1000);
  EXPECT_EQ(meter.Result().position_mm.p95, 2000);
  EXPECT_EQ(meter.Result().normal_deg.skipped, 2u);
  ErrorMeter one({}, 1);
  one.AddFrame(std::vector<float>{0, 0, 3}, std::vector<float>(3));
  EXPECT_EQ(one.Result().position_mm.p50, 3000);
  EXPECT_EQ(one.Result().position_mm.p99, 3000);
}

// Of frames that are a kilometre off and differ by tenths of a millimetre: squares would drown it.
TEST(MetricsTest, DeviationsAreTakenFromTheMean) {
  ErrorMeter meter({}, 1);
  for (const float off : {0.0f, 1.0f, 3.0f}) {
    meter.AddFrame(std::vector<float>{1000 + off * 0x1p-13f, 0, 0}, std::vector<float>(3));
  }
  EXPECT_NEAR(meter.Result().position_mm.std, 1000 * 0x1p-13 * std::sqrt(14.0) / 3, 1e-12);
}

TEST(MetricsTest, NormalAngleByHand) {
  for (const double degrees : {1e-5, 30.0, 90.0, 180.0}) {
    const double angle = degrees * std::numbers::pi / 180;
    std::vector<float> turned = kFlat;  // about the X axis
    turned[7] = static_cast<float>(std::cos(angle)), turned[8] = static_cast<float>(std::sin(angle));
    ErrorMeter meter(kTriangle, 3);
    meter.AddFrame(turned, kFlat);
    // Coordinates up to 1 are rounded to 2^-25 each.
    EXPECT_NEAR(meter.Result().normal_deg.mean, degrees,
                std::min(degrees, 4.0) * 0x1p-24 + 180 / std::numbers::pi * 0x1p-24);
  }
}

TEST(MetricsTest, NormalsAreAreaWeighted) {
  // Vertices 0 and 1 belong to a triangle of area 0.5 that faces +Z and to one of area 1.5 that faces -Y.
  const std::vector<uint16_t> faces = {0, 1, 2, 3, 0, 1};
  const float places[][3] = {{0, 0, 0}, {4, -2, 8}};  // wherever they are
  for (const auto& at : places) {
    std::vector<float> folded = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 3};
    std::vector<float> flat = folded;
    flat[9] = 0, flat[10] = 3, flat[11] = 0;  // now all four lie in Z = 0 and face +Z
    for (size_t i = 0; i < folded.size(); ++i) folded[i] += at[i % 3], flat[i] += at[i % 3];
    ErrorMeter meter(faces, 4);
    meter.AddFrame(folded, flat);
    const double shared = std::atan2(3.0, 1.0) * 180 / std::numbers::pi;  // at vertices 0 and 1
    EXPECT_NEAR(meter.Result().normal_deg.mean, (2 * shared + 0 + 90) / 4, 1e-12);
  }
}

TEST(MetricsTest, VanishedNormalsAreCounted) {
  std::vector<float> collapsed = kFlat;
  collapsed[7] = 0;  // a triangle without area
  ErrorMeter meter(kTriangle, 3);
  meter.AddFrame(collapsed, kFlat);
  EXPECT_EQ(meter.Result().normal_deg.skipped, 3u);
  EXPECT_EQ(meter.Result().normal_deg.mean, 0);
}

// The comparator must see what it is there for.
TEST(MetricsTest, SeededFaultsShow) {
  std::vector<float> truth(3000);
  for (size_t i = 0; i < truth.size(); ++i) truth[i] = std::sin(static_cast<float>(i));
  std::vector<uint16_t> faces;
  for (uint16_t i = 0; i + 2 < 1000; ++i)
    faces.insert(faces.end(), {i, static_cast<uint16_t>(i + 1), static_cast<uint16_t>(i + 2)});
  auto error = [&](auto change) {
    std::vector<float> predicted = truth;
    change(&predicted);
    ErrorMeter meter(faces, 1000);
    meter.AddFrame(predicted, truth);
    return meter.Result();
  };
  const MeshError one =
      error([](std::vector<float>* p) { (*p)[2999] -= 0.001f; });  // one coordinate by 1 mm, downwards
  EXPECT_NEAR(one.position_mm.max, 1, 1e-4);                       // float steps near 1: 6e-5 mm
  EXPECT_NEAR(one.position_mm.mean, 1e-3, 1e-7);
  EXPECT_EQ(one.position_mm.p99, 0);
  EXPECT_GT(one.normal_deg.mean, 0);
  const MeshError negated = error([](std::vector<float>* p) {
    for (float& x : *p) x = -x;
  });
  EXPECT_GT(negated.position_mm.mean, 1000);
  const MeshError shifted = error([](std::vector<float>* p) { std::rotate(p->begin(), p->begin() + 3, p->end()); });
  EXPECT_GT(shifted.position_mm.mean, 100);  // vertices off by one
}

TEST(MetricsTest, BadInputIsRefused) {
  ErrorMeter meter(kTriangle, 3);
  std::vector<float> nan = kFlat;
  nan[4] = NAN;
  EXPECT_TRUE(Mentions(ErrorText([&] { meter.AddFrame(nan, kFlat); }), "NaN or infinity in the prediction"));
  EXPECT_TRUE(Mentions(ErrorText([&] { meter.AddFrame(kFlat, nan); }), "NaN or infinity in the truth"));
  EXPECT_TRUE(Mentions(ErrorText([&] { meter.AddFrame(kFlat, std::span(kFlat).first(6)); }),
                       "2 vertices in the truth, expected 3"));
  EXPECT_EQ(meter.Result().frame_count, 0u);
  EXPECT_TRUE(Mentions(ErrorText([&] { ErrorMeter(kTriangle, 2); }), "do not fit 2 vertices"));
  EXPECT_TRUE(Mentions(ErrorText([&] { ErrorMeter({}, 0); }), "do not fit 0 vertices"));
  EXPECT_TRUE(Mentions(ErrorText([&] { ErrorMeter(std::span(kTriangle).first(2), 3); }), "do not fit 3 vertices"));
}

}  // namespace
}  // namespace dcloth::converter

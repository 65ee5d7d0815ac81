// The last passes over the garment, on every instruction set, against plain formulas.
#include <algorithm>
#include <cstring>
#include <limits>

#include "kernels/half.h"
#include "tests/unit/kernels/kernel_test.h"

namespace dcloth::kernels {
namespace {

class OutputTest : public KernelTest {};
DCLOTH_TEST_EVERY_TABLE(OutputTest);

TEST_P(OutputTest, MovesAndBounds) {
  for (const size_t vertices : InterestingSizes()) {
    for (const size_t stride : {3, 4, 7}) {
      for (const bool bounded : {true, false}) {
        Random random(static_cast<uint32_t>(vertices * 8 + stride));
        const GuardedBuffer<float> origin(random.Floats(3, -1e3f, 1e3f));
        GuardedBuffer<float> positions((vertices - 1) * stride + 3), bounds(6);
        for (size_t i = 0; i < positions.size(); ++i) positions[i] = random.Uniform(-2, 2);
        if (vertices > 5) positions[5 * stride + 1] = std::numeric_limits<float>::quiet_NaN();
        const std::vector<float> before(positions.data(), positions.data() + positions.size());
        table().move({positions.data(), 4 * stride, origin.data(), bounded ? bounds.data() : nullptr, vertices});
        ASSERT_TRUE(positions.SlackUntouched());
        float low[3] = {3.4e38f, 3.4e38f, 3.4e38f}, high[3] = {-3.4e38f, -3.4e38f, -3.4e38f};
        for (size_t i = 0; i < positions.size(); ++i) {
          const size_t c = i % stride;
          const float expected = c < 3 ? before[i] + origin[c] : before[i];
          ASSERT_TRUE(positions[i] == expected || (std::isnan(expected) && std::isnan(positions[i]))) << i;
          if (c < 3 && !std::isnan(expected)) {
            low[c] = std::min(low[c], expected);
            high[c] = std::max(high[c], expected);
          }
        }
        for (size_t c = 0; c < 3 && bounded; ++c) {
          ASSERT_EQ(bounds[c], low[c]) << vertices;
          ASSERT_EQ(bounds[3 + c], high[c]) << vertices;
        }
      }
    }
  }
}

// Both neighbours of every half, each midpoint between two and its neighbours, NaN, infinity, subnormal floats.
TEST_P(OutputTest, HalvesAreThoseOfHalfFromFloat) {
  std::vector<float> values = {std::numeric_limits<float>::quiet_NaN(),
                               std::numeric_limits<float>::infinity(),
                               65519.996f,
                               65520.0f,
                               3e38f,
                               1e-40f,
                               0x1p-25f,
                               0x1.000002p-25f,
                               0.0f};
  for (uint32_t half = 0; half < 0x7C00; ++half) {
    const float low = FloatFromHalf(static_cast<uint16_t>(half));
    const float middle = half == 0x7BFF ? 65520.0f : (low + FloatFromHalf(static_cast<uint16_t>(half + 1))) / 2;
    for (const float value : {low, std::nextafter(middle, 0.0f), middle, std::nextafter(middle, 1e9f)})
      values.push_back(value);
  }
  const size_t count = values.size();
  for (size_t i = 0; i < count; ++i) values.push_back(-values[i]);
  while (values.size() % 12 != 0) values.push_back(1.5f);
  for (const size_t elements : {3, 4}) {
    for (const size_t stride : {elements, elements + 3}) {
      const size_t vertices = values.size() / elements;
      std::vector<uint16_t> to(vertices * stride, 0xABCD);
      table().store_half({values.data(), to.data(), 2 * stride, elements, vertices});
      for (size_t i = 0; i < to.size(); ++i) {
        const size_t e = i % stride;
        const float value = values[i / stride * elements + (e < elements ? e : 0)];
        const uint16_t expected = e < elements ? HalfFromFloat(value) : uint16_t{0xABCD};
        ASSERT_EQ(to[i], expected) << value << " " << table().name;
      }
    }
  }
}

TEST_P(OutputTest, HalvesOfEverySize) {
  for (const size_t vertices : InterestingSizes()) {
    Random random(static_cast<uint32_t>(vertices));
    const GuardedBuffer<float> from(random.Floats(3 * vertices, -70000.0f, 70000.0f));
    GuardedBuffer<uint16_t> to(3 * vertices);
    table().store_half({from.data(), to.data(), 6, 3, vertices});
    ASSERT_TRUE(to.SlackUntouched());
    for (size_t i = 0; i < to.size(); ++i) ASSERT_EQ(to[i], HalfFromFloat(from[i]));
  }
}

// A grid in the xz plane whose u grows along (cos a, 0, sin a): that is its tangent, and w tells mirrored coordinates.
TEST_P(OutputTest, TangentsPointWhereUGrows) {
  constexpr size_t kSide = 9, kVertices = kSide * kSide;
  for (const double angle : {0.0, 0.7, 2.5}) {
    for (const float mirror : {1.0f, -1.0f}) {
      for (const size_t stride : {4, 6}) {
        std::vector<float> positions, normals, texture;
        std::vector<uint16_t> triangles;
        for (size_t i = 0; i < kVertices; ++i) {
          const double x = static_cast<double>(i % kSide), z = static_cast<double>(i / kSide);
          for (const double value : {x, 0.0, z}) positions.push_back(static_cast<float>(value));
          for (const float value : {0.0f, 1.0f, 0.0f}) normals.push_back(value);
          texture.push_back(static_cast<float>(x * std::cos(angle) + z * std::sin(angle)));
          texture.push_back(mirror * static_cast<float>(x * std::sin(angle) - z * std::cos(angle)));
        }
        for (size_t z = 0; z + 1 < kSide; ++z) {
          for (size_t x = 0; x + 1 < kSide; ++x) {
            const auto at = static_cast<uint16_t>(z * kSide + x);
            for (const size_t corner : {0, 1, 9, 1, 10, 9}) triangles.push_back(static_cast<uint16_t>(at + corner));
          }
        }
        GuardedBuffer<float> tangents((kVertices - 1) * stride + 4);
        for (size_t i = 0; i < tangents.size(); ++i) tangents[i] = 0.25f;
        TangentsJob job = {positions.data(), 12,         normals.data(),   12,        texture.data(),       8,
                           tangents.data(),  4 * stride, triangles.data(), kVertices, triangles.size() / 3, 1.0f};
        table().tangents(job);
        ASSERT_TRUE(tangents.SlackUntouched());
        std::vector<float> plain(tangents.size(), 0.25f);
        job.tangents = plain.data();
        scalar::Tangents(job);
        ASSERT_EQ(std::memcmp(plain.data(), tangents.data(), plain.size() * sizeof(float)), 0) << table().name;
        for (size_t i = 0; i < kVertices; ++i) {
          const float* t = tangents.data() + stride * i;
          EXPECT_NEAR(t[0], std::cos(angle), 1e-5);
          EXPECT_NEAR(t[1], 0, 1e-6);
          EXPECT_NEAR(t[2], std::sin(angle), 1e-5);
          EXPECT_EQ(t[3], -mirror);
          for (size_t gap = 4; gap < stride && i + 1 < kVertices; ++gap) ASSERT_EQ(t[gap], 0.25f);
        }
      }
    }
  }
}

// Without a direction of u any unit vector in the surface will do.
TEST_P(OutputTest, TangentsWithoutTexture) {
  const std::vector<float> positions = {0, 0, 0, 1, 0, 0, 0, 1, 0}, normals = {0, 0, 1, 1, 0, 0, 0, 1, 0},
                           texture(6, 0.5f);
  const std::vector<uint16_t> triangles = {0, 1, 2};
  std::vector<float> tangents(12);
  table().tangents({positions.data(), 12, normals.data(), 12, texture.data(), 8, tangents.data(), 16, triangles.data(),
                    3, 1, -1.0f});
  for (size_t i = 0; i < 3; ++i) {
    double along = 0, square = 0;
    for (size_t c = 0; c < 3; ++c) {
      along += double{tangents[4 * i + c]} * normals[3 * i + c];
      square += double{tangents[4 * i + c]} * tangents[4 * i + c];
    }
    EXPECT_EQ(along, 0);
    EXPECT_NEAR(square, 1, 1e-6);
    EXPECT_EQ(tangents[4 * i + 3], -1.0f);
  }
}

}  // namespace
}  // namespace dcloth::kernels

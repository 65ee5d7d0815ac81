#include <array>

#include "tests/unit/kernels/kernel_test.h"

namespace dcloth::kernels {
namespace {

using Vec3 = std::array<double, 3>;

// One interleaved buffer or two apart; in both the last vertex ends at the guard page.
struct Layout {
  size_t position_stride;  // floats
  size_t normal_stride;
};

class NormalsTest : public KernelTest {
 protected:
  void Check(size_t vertices, const std::vector<uint16_t>& triangle_values, Layout layout) {
    SCOPED_TRACE(testing::Message() << table().name << " vertices " << vertices << " strides " << layout.position_stride
                                    << " " << layout.normal_stride);
    Random random(static_cast<uint32_t>(vertices));
    GuardedBuffer<float> positions((vertices - 1) * layout.position_stride + 3);
    for (size_t i = 0; i < positions.size(); ++i) {
      if (i % layout.position_stride < 3) positions[i] = random.Uniform(-1.0f, 1.0f);  // gaps stay NaN
    }
    const GuardedBuffer<uint16_t> triangles(triangle_values);
    GuardedBuffer<float> normals((vertices - 1) * layout.normal_stride + 3);
    const size_t triangle_count = triangle_values.size() / 3;
    table().normals({positions.data(), 4 * layout.position_stride, triangles.data(), normals.data(),
                     4 * layout.normal_stride, vertices, triangle_count});
    ASSERT_TRUE(normals.SlackUntouched() && positions.SlackUntouched());

    // Sums in double, and for each component a bound of the float sum's error: a difference, a product and a
    // subtraction round 4 times in a row, then one addition per triangle of the vertex.
    std::vector<Vec3> sums(vertices, Vec3{}), sizes(vertices, Vec3{});
    std::vector<size_t> valence(vertices, 0);
    for (size_t t = 0; t < triangle_count; ++t) {
      double u[3], v[3];
      for (size_t c = 0; c < 3; ++c) {
        const double a = positions[triangles[3 * t] * layout.position_stride + c];
        u[c] = positions[triangles[3 * t + 1] * layout.position_stride + c] - a;
        v[c] = positions[triangles[3 * t + 2] * layout.position_stride + c] - a;
      }
      for (size_t k = 0; k < 3; ++k) {
        const size_t vertex = triangles[3 * t + k];
        ++valence[vertex];
        for (size_t c = 0; c < 3; ++c) {
          const size_t d = (c + 1) % 3, e = (c + 2) % 3;
          sums[vertex][c] += u[d] * v[e] - u[e] * v[d];
          sizes[vertex][c] += std::fabs(u[d] * v[e]) + std::fabs(u[e] * v[d]);
        }
      }
    }
    size_t checked = 0;
    for (size_t i = 0; i < vertices; ++i) {
      const float* n = normals.data() + i * layout.normal_stride;
      for (size_t gap = i * layout.normal_stride + 3; gap < (i + 1) * layout.normal_stride && gap < normals.size();
           ++gap) {
        ASSERT_TRUE(std::isnan(normals[gap])) << "wrote outside the 12 bytes of vertex " << i;
      }
      double length = 0, error = 0;
      for (size_t c = 0; c < 3; ++c) {
        length += sums[i][c] * sums[i][c];
        error += std::pow(Gamma(4 + static_cast<double>(valence[i])) * sizes[i][c], 2);
      }
      length = std::sqrt(length), error = std::sqrt(error);
      if (valence[i] == 0) {
        ASSERT_EQ((std::array{n[0], n[1], n[2]}), (std::array{0.0f, 1.0f, 0.0f})) << i;
        continue;
      }
      if (error > length / 8) continue;  // cancelled: the direction is not determined
      ++checked;
      // Normalising a vector changed by e moves it by at most 2 e / |v|; square root, division and products round 7
      // times.
      for (size_t c = 0; c < 3; ++c) ASSERT_NEAR(n[c], sums[i][c] / length, 2 * error / length + Gamma(7)) << i;
      ASSERT_NEAR(n[0] * n[0] + n[1] * n[1] + n[2] * n[2], 1.0, Gamma(20)) << i;
    }
    ASSERT_GE(checked, std::min<size_t>(triangle_count, 1));
  }

  // Triangles over all vertices but the last, which stays alone.
  static std::vector<uint16_t> RandomTriangles(size_t vertices, size_t count) {
    Random random(static_cast<uint32_t>(count));
    std::vector<uint16_t> corners;
    for (size_t t = 0; t < count; ++t) {
      const uint32_t first = random.Below(static_cast<uint32_t>(vertices - 1));
      for (uint32_t k = 0; k < 3; ++k) corners.push_back(static_cast<uint16_t>((first + k) % (vertices - 1)));
    }
    return corners;
  }
};
DCLOTH_TEST_EVERY_TABLE(NormalsTest);

TEST_P(NormalsTest, EveryVertexCountAndStride) {
  for (size_t vertices : InterestingSizes()) {
    const auto triangles = vertices >= 4 ? RandomTriangles(vertices, 2 * vertices) : std::vector<uint16_t>{};
    Check(vertices, triangles, {3, 3});
    Check(vertices, triangles, {3 + vertices % 4, 3 + vertices % 3});
  }
}

TEST_P(NormalsTest, InterleavedBufferAndKnownSquare) {
  // A unit square in the ground plane, counter-clockwise seen from above, then a vertex used by a triangle without
  // area.
  constexpr size_t kStride = 6;
  std::vector<float> buffer(5 * kStride, -7.0f);
  const float corners[5][3] = {{0, 0, 0}, {0, 0, 1}, {1, 0, 1}, {1, 0, 0}, {5, 5, 5}};
  for (size_t i = 0; i < 5; ++i) std::copy_n(corners[i], 3, &buffer[i * kStride]);
  const std::vector<uint16_t> triangles = {0, 1, 2, 0, 2, 3, 4, 4, 4};
  table().normals({buffer.data(), 4 * kStride, triangles.data(), buffer.data() + 3, 4 * kStride, 5, 3});
  for (size_t i = 0; i < 5; ++i) {
    EXPECT_EQ(buffer[i * kStride], corners[i][0]);
    EXPECT_NEAR(buffer[i * kStride + 3], 0.0, Gamma(4));
    EXPECT_NEAR(buffer[i * kStride + 4], 1.0, Gamma(4));
    EXPECT_NEAR(buffer[i * kStride + 5], 0.0, Gamma(4));
  }
}

// Squared lengths beyond the floats, infinite and NaN sums: still unit vectors.
TEST_P(NormalsTest, SumsThatLeaveTheFloatsGiveTheDefault) {
  const float huge[] = {1e10f, 1e20f, 3e38f, std::numeric_limits<float>::infinity(),
                        std::numeric_limits<float>::quiet_NaN()};
  for (const float size : huge) {
    const std::vector<float> positions = {0, 0, 0, 0, 0, size, size, 0, 0, size, size, -size};
    const std::vector<uint16_t> triangles = {0, 1, 2, 1, 3, 2};
    std::vector<float> normals(positions.size());
    table().normals({positions.data(), 12, triangles.data(), normals.data(), 12, 4, 2});
    for (size_t i = 0; i < normals.size(); i += 3) {
      EXPECT_EQ((std::array{normals[i], normals[i + 1], normals[i + 2]}), (std::array{0.0f, 1.0f, 0.0f}))
          << table().name << ", " << size << ", vertex " << i / 3;
    }
  }
}

// Squared lengths of exactly kNormalsTiny and kNormalsHuge have a direction; what is one float smaller or larger has
// none.
TEST_P(NormalsTest, TheBoundsOfASumAreMetExactly) {
  struct Sum {
    float x, z, expected_x;
  };
  const Sum sums[] = {{1e-15f, 0, 1},                     // 1e-30f
                      {0x1.203af8p-50f, 0x1.6ap-62f, 0},  // the float below
                      {0x1.fffffep+63f, 0x1p+52f, 1},     // the largest float
                      {0x1.fffffep+63f, 0x1.8p+52f, 0}};  // infinity
  for (const size_t stride : {3, 5}) {
    for (const Sum& sum : sums) {
      // Two triangles of this sum, one in a group of four vertices and one beyond.
      std::vector<float> positions(7 * stride), normals(7 * stride);
      for (size_t i = 0; i < 7; ++i) {
        float* p = &positions[i * stride];
        if (i % 4 == 1) p[1] = 1;
        if (i % 4 == 2) p[0] = -sum.z, p[2] = sum.x;
      }
      const std::vector<uint16_t> triangles = {0, 1, 2, 4, 5, 6};
      table().normals({positions.data(), 4 * stride, triangles.data(), normals.data(), 4 * stride, 7, 2});
      for (const size_t i : {0, 1, 2, 4, 5, 6}) {
        EXPECT_NEAR(normals[i * stride], sum.expected_x, Gamma(7)) << table().name << ", " << sum.x << ", vertex " << i;
        EXPECT_EQ(normals[i * stride + 1], 1 - sum.expected_x);
      }
    }
  }
}

}  // namespace
}  // namespace dcloth::kernels

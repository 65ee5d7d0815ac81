// What reaches the host: formats, tangents, bounds, and nothing beside them.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <span>

#include "kernels/half.h"
#include "tests/unit/engine/cloth_fixture.h"
#include "tests/unit/kernels/guarded_buffer.h"

namespace dcloth::testing {
namespace {

using kernels::GuardedBuffer;
using kernels::Place;

constexpr uint32_t kAll = DCLOTH_STAGES_MESH;
constexpr uint32_t kHalf = DCLOTH_FORMAT_FLOAT16;

// A drawn mesh and what was computed on it: rows of 3, 3, 4 and 2 floats.
struct Drawn {
  std::span<const uint16_t> faces;
  std::span<const float> positions, normals, tangents, texture;
};

// Against the sums in double over the positions drawn. A float sum of k terms is off by at most gamma(k + 4)
// of their magnitudes (Higham, lemma 3.1; four roundings a term, up to 20 triangles a vertex); where the sum
// nearly cancels or stands on the surface, that is a large part of what is left, and the vertex says nothing.
void ExpectTangentsFollowTheTexture(const Drawn& mesh) {
  const size_t vertices = mesh.positions.size() / 3;
  struct Sum {
    double u[3] = {}, v[3] = {}, magnitude = 0, det = 0, det_magnitude = 0;
  };
  std::vector<Sum> sums(vertices);
  for (size_t t = 0; t < mesh.faces.size(); t += 3) {
    const uint16_t* corner = &mesh.faces[t];
    double e[2][3], d[2][2];
    for (size_t k = 0; k < 2; ++k) {
      for (size_t c = 0; c < 3; ++c) {
        e[k][c] = static_cast<double>(mesh.positions[3 * corner[k + 1] + c]) -
                  static_cast<double>(mesh.positions[3 * corner[0] + c]);
      }
      for (size_t c = 0; c < 2; ++c) {
        d[k][c] = static_cast<double>(mesh.texture[2 * corner[k + 1] + c]) -
                  static_cast<double>(mesh.texture[2 * corner[0] + c]);
      }
    }
    const double det = d[0][0] * d[1][1] - d[1][0] * d[0][1], sign = det < 0 ? -1 : 1;
    for (size_t k = 0; k < 3; ++k) {
      Sum& sum = sums[corner[k]];
      for (size_t c = 0; c < 3; ++c) {
        sum.u[c] += sign * (e[0][c] * d[1][1] - e[1][c] * d[0][1]);
        sum.v[c] += sign * (e[1][c] * d[0][0] - e[0][c] * d[1][0]);
        // World positions are rounded at up to 8 m, texture coordinates at up to 2; both differences cancel.
        sum.magnitude +=
            (8 + std::abs(e[0][c])) * (std::abs(d[1][1]) + 2e-1) + (8 + std::abs(e[1][c])) * (std::abs(d[0][1]) + 2e-1);
      }
      sum.det += det;
      sum.det_magnitude += std::abs(d[0][0] * d[1][1]) + std::abs(d[1][0] * d[0][1]);
    }
  }
  size_t checked = 0;
  for (size_t i = 0; i < vertices; ++i) {
    const float* normal = &mesh.normals[3 * i];
    const float* tangent = &mesh.tangents[4 * i];
    double along = 0, square = 0, flat[3], length = 0, dot = 0;
    for (size_t c = 0; c < 3; ++c) {
      along += static_cast<double>(normal[c]) * static_cast<double>(tangent[c]);
      square += static_cast<double>(tangent[c]) * static_cast<double>(tangent[c]);
      dot += sums[i].u[c] * static_cast<double>(normal[c]);
    }
    EXPECT_NEAR(square, 1, 1e-6) << i;
    EXPECT_TRUE(tangent[3] == 1 || tangent[3] == -1) << i;
    for (size_t c = 0; c < 3; ++c) {
      flat[c] = sums[i].u[c] - dot * static_cast<double>(normal[c]);
      length += flat[c] * flat[c];
    }
    length = std::sqrt(length);
    const double tolerance = 24 * 0x1p-24 * sums[i].magnitude / length + 1e-6;
    EXPECT_NEAR(along, 0, tolerance) << i;
    if (tolerance > 0.01 || std::abs(sums[i].det) < 1e-5 * sums[i].det_magnitude) continue;
    for (size_t c = 0; c < 3; ++c) EXPECT_NEAR(static_cast<double>(tangent[c]), flat[c] / length, 2 * tolerance) << i;
    EXPECT_EQ(tangent[3] > 0, sums[i].det > 0) << i;
    ++checked;
  }
  EXPECT_GT(checked, vertices * 3 / 4);
}

class OutputTest : public ::testing::Test {
 protected:
  OutputTest() {
    for (int tick = 0; tick < 4; ++tick) {
      EXPECT_EQ(cloth_.Tick(Pose(tick), kAll), DCLOTH_OK);
    }
    const size_t segments = model_.numbers.spec.segments;
    for (size_t i = 0; i < n(); ++i) {  // leaning, so that neither axis runs along the mesh
      const auto ring = static_cast<float>(i / segments), segment = static_cast<float>(i % segments);
      texture_.insert(texture_.end(), {0.11f * segment + 0.03f * ring, 0.17f * ring - 0.02f * segment});
    }
  }

  std::vector<float> Pose(int tick) const { return PoseAt(model_.numbers, tick / 30.0); }
  size_t n() const { return model_.numbers.n; }

  dcloth_status Skin(const dcloth_output& output) {
    const std::vector<float> matrices = Pose(4);
    const dcloth_pose pose = OwnedCloth::Pose(matrices);
    return dcloth_cloth_skin(cloth_.get(), &pose, 0.5f, &output, nullptr);
  }

  // By a cloth of another model, whatever the count says.
  void ExpectRefused(const OpenedModel& opened, dcloth_output output, std::initializer_list<uint32_t> counts) const {
    OwnedCloth cloth(opened);
    const std::vector<float> matrices = Pose(4);
    const dcloth_pose pose = OwnedCloth::Pose(matrices);
    for (const uint32_t count : counts) {
      output.vertex_count = count;
      EXPECT_EQ(dcloth_cloth_skin(cloth.get(), &pose, 0.5f, &output, nullptr), DCLOTH_ERROR_ARGUMENT) << count;
    }
  }

  // Everything, as floats.
  struct Frame {
    std::vector<float> positions, normals, tangents, bounds;
  };
  Frame Floats() {
    Frame frame = {std::vector<float>(3 * n()), std::vector<float>(3 * n()), std::vector<float>(4 * n()),
                   std::vector<float>(6)};
    dcloth_output output = FloatOutput(n(), frame.positions.data(), 12, frame.normals.data());
    output.tangents = frame.tangents.data();
    output.tangent_stride_bytes = 16;
    output.texture_coordinates = texture_.data();
    output.texture_stride_bytes = 8;
    output.bounds = frame.bounds.data();
    EXPECT_EQ(dcloth_output_scratch_size(&output), 0u);
    EXPECT_EQ(Skin(output), DCLOTH_OK);
    return frame;
  }

  TestModel model_ =
      BuildModel({.segments = 11, .coarse = true, .texture = true});  // 66 vertices: no whole groups of four
  OpenedModel opened_{model_};
  OwnedCloth cloth_{opened_};
  std::vector<float> texture_;
};

// Whatever way the last pass takes: four vertices at a time, or one by one into bounds or a buffer of both.
TEST_F(OutputTest, PositionsDependOnNothingBesideThem) {
  const Frame frame = Floats();
  GuardedBuffer<float> tight(3 * n());
  std::vector<float> normals(3 * n()), both(6 * n());
  dcloth_output output;
  for (float* const beside : {normals.data(), static_cast<float*>(nullptr)}) {
    std::fill_n(tight.data(), tight.size(), 0.0f);
    output = FloatOutput(n(), tight.data(), 12, beside);
    ASSERT_EQ(Skin(output), DCLOTH_OK);
    EXPECT_EQ(0, std::memcmp(tight.data(), frame.positions.data(), 12 * n()));
  }
  EXPECT_EQ(normals, frame.normals);
  output = FloatOutput(n(), both.data(), 24, both.data() + 3);
  output.normal_stride_bytes = 24;
  ASSERT_EQ(Skin(output), DCLOTH_OK);
  for (size_t i = 0; i < n(); ++i) {
    EXPECT_EQ(0, std::memcmp(&both[6 * i], &frame.positions[3 * i], 12)) << i;
    EXPECT_EQ(0, std::memcmp(&both[6 * i + 3], &frame.normals[3 * i], 12)) << i;
  }
}

TEST_F(OutputTest, BoundsAreThoseOfThePositions) {
  const Frame frame = Floats();
  for (size_t c = 0; c < 3; ++c) {
    float low = INFINITY, high = -INFINITY;
    for (size_t i = c; i < frame.positions.size(); i += 3) {
      low = std::min(low, frame.positions[i]);
      high = std::max(high, frame.positions[i]);
    }
    EXPECT_EQ(frame.bounds[c], low);
    EXPECT_EQ(frame.bounds[3 + c], high);
    EXPECT_LT(low, high);
  }
}

TEST_F(OutputTest, TangentsFollowTheTexture) {
  const Frame frame = Floats();
  ExpectTangentsFollowTheTexture({model_.numbers.faces, frame.positions, frame.normals, frame.tangents, texture_});
}

// Texture coordinates in one point say nothing: a unit vector in the surface then, along +x or +y as far as the normal
// lets it. Sixteen roundings of 2^-24 at most: the normal's length 4, the sum along it 5, what is taken off 2, the
// length of the rest 5.
TEST_F(OutputTest, TangentsWithoutATextureLieInTheSurface) {
  std::fill(texture_.begin(), texture_.end(), 0.25f);
  const Frame frame = Floats();
  size_t along_x = 0;
  for (size_t i = 0; i < n(); ++i) {
    const float *normal = &frame.normals[3 * i], *tangent = &frame.tangents[4 * i];
    double along = 0, square = 0;
    for (size_t c = 0; c < 3; ++c) {
      along += static_cast<double>(normal[c]) * static_cast<double>(tangent[c]);
      square += static_cast<double>(tangent[c]) * static_cast<double>(tangent[c]);
    }
    EXPECT_NEAR(along, 0, 0x1p-20) << i;
    EXPECT_NEAR(square, 1, 0x1p-20) << i;
    EXPECT_EQ(tangent[3], 1.0f) << i;
    const bool steep = normal[0] * normal[0] > 0.5f;
    EXPECT_GT(tangent[steep ? 1 : 0], 0.7f) << i;  // sqrt(1/2) at least is left of the axis
    along_x += steep ? 1 : 0;
  }
  EXPECT_GT(along_x, 0u);
  EXPECT_LT(along_x, n());
}

// Every mix of formats in one interleaved buffer: the halves are the floats rounded, the floats are the
// floats, and between attributes, behind the last vertex and behind the scratch nothing changes.
TEST_F(OutputTest, FormatsAndPlacesMix) {
  const Frame expected = Floats();
  for (const uint32_t mix : {1u, 2u, 3u, 4u, 5u, 6u, 7u}) {
    constexpr size_t kStride = 56, kNormals = 16, kTangents = 32;  // gaps of 4 or more everywhere
    GuardedBuffer<uint8_t> vertices(kStride * (n() - 1) + kTangents + (mix & 4 ? 8 : 16), Place::kAligned64);
    std::memset(vertices.data(), 0xA5, vertices.size());
    dcloth_output output = FloatOutput(n(), nullptr, kStride, nullptr);
    output.positions = vertices.data();
    output.normals = vertices.data() + kNormals;
    output.tangents = vertices.data() + kTangents;
    output.tangent_stride_bytes = kStride;
    output.texture_coordinates = texture_.data();
    output.texture_stride_bytes = 8;
    output.position_format = mix & 1 ? kHalf : 0;
    output.normal_format = mix & 2 ? kHalf : 0;
    output.tangent_format = mix & 4 ? kHalf : 0;
    const uint64_t needed = dcloth_output_scratch_size(&output);
    EXPECT_EQ(needed, n() * 40);
    EXPECT_EQ(Skin(output), DCLOTH_ERROR_ARGUMENT) << "no scratch";
    GuardedBuffer<uint8_t> scratch(needed, Place::kAligned64);
    output.scratch = scratch.data();
    output.scratch_size = needed - 1;
    EXPECT_EQ(Skin(output), DCLOTH_ERROR_ARGUMENT);
    output.scratch_size = needed;
    ASSERT_EQ(Skin(output), DCLOTH_OK);
    EXPECT_TRUE(vertices.SlackUntouched() && scratch.SlackUntouched());

    std::vector<uint8_t> wanted(vertices.size(), 0xA5);
    const auto put = [&](const std::vector<float>& values, size_t elements, size_t place, bool half) {
      for (size_t i = 0; i < values.size(); ++i) {
        uint8_t* to = wanted.data() + kStride * (i / elements) + place + i % elements * (half ? 2 : 4);
        const uint16_t rounded = kernels::HalfFromFloat(values[i]);
        std::memcpy(to, half ? static_cast<const void*>(&rounded) : &values[i], half ? 2 : 4);
      }
    };
    put(expected.positions, 3, 0, mix & 1);
    put(expected.normals, 3, kNormals, mix & 2);
    put(expected.tangents, 4, kTangents, mix & 4);
    EXPECT_EQ(std::memcmp(wanted.data(), vertices.data(), wanted.size()), 0) << mix;
  }
}

TEST_F(OutputTest, BrokenOutputsAreRefused) {
  std::vector<float> room(20 * n());
  const auto refused = [&](auto change) {
    dcloth_output output = FloatOutput(n(), room.data(), 40, room.data() + 3);
    output.tangents = room.data() + 6;
    output.tangent_stride_bytes = 40;
    output.texture_coordinates = texture_.data();
    output.texture_stride_bytes = 8;
    output.scratch = room.data() + 10 * n();
    output.scratch_size = 40 * n();
    EXPECT_EQ(Skin(output), DCLOTH_OK) << "only the change may be refused";
    change(&output);
    EXPECT_EQ(Skin(output), DCLOTH_ERROR_ARGUMENT);
  };
  refused([](dcloth_output* o) { o->position_format = 2; });
  refused([](dcloth_output* o) { o->normal_format = 7; });
  refused([](dcloth_output* o) { o->tangent_format = ~0u; });
  refused([](dcloth_output* o) { o->tangent_stride_bytes = 12; });
  refused([](dcloth_output* o) { o->texture_stride_bytes = 4; });
  refused([](dcloth_output* o) { o->texture_coordinates = nullptr; });
  refused([](dcloth_output* o) { o->normals = nullptr; });
  refused([](dcloth_output* o) { o->bounds = reinterpret_cast<float*>(reinterpret_cast<uintptr_t>(o->scratch) + 2); });
  refused([](dcloth_output* o) { o->struct_size -= 8; });
  refused([](dcloth_output* o) {
    o->normal_format = kHalf;
    o->normal_stride_bytes = 41;
  });
}

// The coarse mesh has the garment's positions, and normals of its own triangles; in half floats and with bounds too.
TEST_F(OutputTest, CoarseMeshIsPartOfTheGarment) {
  const Frame frame = Floats();
  const dcloth_model_info info = opened_.info();
  ASSERT_EQ(info.coarse_vertex_count, 33u);
  const size_t coarse = info.coarse_vertex_count;
  GuardedBuffer<float> positions(3 * coarse), normals(3 * coarse);
  dcloth_output output = FloatOutput(coarse, positions.data(), 12, normals.data());
  std::array<float, 6> bounds = {};
  output.bounds = bounds.data();
  output.flags = DCLOTH_OUTPUT_COARSE;
  ASSERT_EQ(Skin(output), DCLOTH_OK);
  std::array<float, 6> expected = {1e9f, 1e9f, 1e9f, -1e9f, -1e9f, -1e9f};
  for (size_t i = 0; i < coarse; ++i) {
    const float* of_garment = &frame.positions[size_t{3} * info.coarse_vertices[i]];
    EXPECT_EQ(0, std::memcmp(positions.data() + 3 * i, of_garment, 12)) << i;
    for (size_t c = 0; c < 3; ++c) {
      expected[c] = std::min(expected[c], of_garment[c]);
      expected[3 + c] = std::max(expected[3 + c], of_garment[c]);
    }
  }
  EXPECT_EQ(bounds, expected);
  std::vector<double> sums(3 * coarse);
  for (size_t t = 0; t < info.coarse_triangle_count; ++t) {
    const uint16_t* corner = info.coarse_triangles + 3 * t;
    const float *a = positions.data() + 3 * corner[0], *b = positions.data() + 3 * corner[1],
                *c = positions.data() + 3 * corner[2];
    for (size_t k = 0; k < 3; ++k) {
      const size_t y = (k + 1) % 3, z = (k + 2) % 3;
      const double part = static_cast<double>(b[y] - a[y]) * static_cast<double>(c[z] - a[z]) -
                          static_cast<double>(b[z] - a[z]) * static_cast<double>(c[y] - a[y]);
      for (size_t v = 0; v < 3; ++v) sums[size_t{3} * corner[v] + k] += part;
    }
  }
  for (size_t i = 0; i < coarse; ++i) {
    const double length =
        std::sqrt(sums[3 * i] * sums[3 * i] + sums[3 * i + 1] * sums[3 * i + 1] + sums[3 * i + 2] * sums[3 * i + 2]);
    if (length < 1e-3) continue;  // strips on both sides of a vertex may cancel
    for (size_t k = 0; k < 3; ++k)
      EXPECT_NEAR(static_cast<double>(normals[3 * i + k]), sums[3 * i + k] / length, 1e-3) << i;
  }
  std::vector<uint16_t> halves(3 * coarse);
  std::vector<float> scratch(3 * coarse);
  output = FloatOutput(coarse, nullptr, 6, nullptr);
  output.positions = halves.data();
  output.position_format = kHalf;
  output.flags = DCLOTH_OUTPUT_COARSE;
  output.scratch = scratch.data();
  output.scratch_size = dcloth_output_scratch_size(&output);
  ASSERT_EQ(output.scratch_size, 12 * coarse);
  ASSERT_EQ(Skin(output), DCLOTH_OK);
  for (size_t i = 0; i < halves.size(); ++i) ASSERT_EQ(halves[i], kernels::HalfFromFloat(positions[i])) << i;
}

// The garment to the bit, its seam once more, and what a host would get that repeats the seam itself.
TEST_F(OutputTest, TexturedMeshRepeatsTheSeam) {
  const dcloth_model_info info = opened_.info();
  const size_t drawn = info.textured_vertex_count;
  ASSERT_EQ(drawn, n() + model_.numbers.spec.rings);
  const Frame frame = Floats();
  const auto skin = [&](const float* texture, uint32_t half) {
    constexpr size_t kStride = 40;
    GuardedBuffer<uint8_t> vertices(kStride * drawn, Place::kAligned64);
    std::memset(vertices.data(), 0, vertices.size());
    std::vector<float> scratch(10 * drawn);
    std::array<float, 6> bounds = {};
    dcloth_output output = FloatOutput(drawn, nullptr, kStride, nullptr);
    output.positions = vertices.data();
    output.normals = vertices.data() + 12;
    output.tangents = vertices.data() + 24;
    output.tangent_stride_bytes = kStride;
    output.texture_coordinates = texture;
    output.texture_stride_bytes = texture == nullptr ? 0 : 8;
    output.position_format = output.normal_format = output.tangent_format = half;
    output.scratch = scratch.data();
    output.scratch_size = 40 * drawn;
    output.bounds = bounds.data();
    output.flags = DCLOTH_OUTPUT_TEXTURED;
    EXPECT_EQ(Skin(output), DCLOTH_OK);
    EXPECT_TRUE(vertices.SlackUntouched());
    EXPECT_EQ(0, std::memcmp(bounds.data(), frame.bounds.data(), sizeof(bounds)));
    return std::vector<uint8_t>(vertices.data(), vertices.data() + vertices.size());
  };
  const std::vector<uint8_t> vertices = skin(nullptr, 0);
  EXPECT_EQ(vertices, skin(info.texture_coordinates, 0)) << "the model's own coordinates";
  for (size_t i = 0; i < drawn; ++i) {
    const size_t from = i < n() ? i : info.seam_vertices[i - n()];
    const uint8_t* vertex = &vertices[40 * i];
    EXPECT_EQ(0, std::memcmp(vertex, &frame.positions[3 * from], 12)) << i;
    EXPECT_EQ(0, std::memcmp(vertex + 12, &frame.normals[3 * from], 12)) << i;
  }
  std::vector<float> positions, normals, tangents;
  for (size_t i = 0; i < drawn; ++i) {
    const auto* vertex = reinterpret_cast<const float*>(&vertices[40 * i]);
    positions.insert(positions.end(), vertex, vertex + 3);
    normals.insert(normals.end(), vertex + 3, vertex + 6);
    tangents.insert(tangents.end(), vertex + 6, vertex + 10);
  }
  const std::span<const uint16_t> faces(info.textured_triangles, size_t{3} * info.triangle_count);
  ExpectTangentsFollowTheTexture({faces, positions, normals, tangents, {info.texture_coordinates, 2 * drawn}});
  const std::vector<uint8_t> halves = skin(nullptr, kHalf);
  for (size_t i = 0; i < drawn; ++i) {
    for (const size_t place : {0, 12, 24}) {
      for (size_t c = 0; c < (place == 24 ? 4u : 3u); ++c) {
        float whole;
        uint16_t half;
        std::memcpy(&whole, &vertices[40 * i + place + 4 * c], 4);
        std::memcpy(&half, &halves[40 * i + place + 2 * c], 2);
        ASSERT_EQ(half, kernels::HalfFromFloat(whole)) << i;
      }
    }
  }
}

TEST_F(OutputTest, RefusesATextureThatIsNone) {
  const uint32_t drawn = opened_.info().textured_vertex_count;
  std::vector<float> positions(3 * drawn);
  dcloth_output output = FloatOutput(n(), positions.data(), 12, nullptr);
  output.flags = DCLOTH_OUTPUT_TEXTURED;
  EXPECT_EQ(Skin(output), DCLOTH_ERROR_ARGUMENT) << "the garment's count";
  output.vertex_count = drawn;
  EXPECT_EQ(Skin(output), DCLOTH_OK);
  output.flags |= DCLOTH_OUTPUT_COARSE;
  EXPECT_EQ(Skin(output), DCLOTH_ERROR_ARGUMENT) << "the coarse mesh";
  output.flags = 0;
  EXPECT_EQ(Skin(output), DCLOTH_ERROR_ARGUMENT) << "without the flag";
  const TestModel plain = BuildModel({.segments = 11});
  const OpenedModel opened(plain);
  EXPECT_EQ(opened.info().textured_vertex_count, 0u);
  EXPECT_EQ(opened.info().texture_coordinates, nullptr);
  output.flags = DCLOTH_OUTPUT_TEXTURED;
  ExpectRefused(opened, output, {0u, drawn, 66u});
}

TEST_F(OutputTest, RefusesACoarseMeshThatIsNone) {
  std::vector<float> positions(3 * n());
  dcloth_output output = FloatOutput(n(), positions.data(), 12, nullptr);
  output.flags = DCLOTH_OUTPUT_COARSE;
  EXPECT_EQ(Skin(output), DCLOTH_ERROR_ARGUMENT) << "the garment's count";
  output.vertex_count = 33;
  EXPECT_EQ(Skin(output), DCLOTH_OK);
  output.flags |= DCLOTH_OUTPUT_OUTSIDE_BODY;
  EXPECT_EQ(Skin(output), DCLOTH_ERROR_ARGUMENT) << "kept outside of the body";
  const TestModel plain = BuildModel({.segments = 11});
  const OpenedModel opened(plain);
  EXPECT_EQ(opened.info().coarse_vertex_count, 0u);
  EXPECT_EQ(opened.info().coarse_vertices, nullptr);
  output.flags = DCLOTH_OUTPUT_COARSE;
  ExpectRefused(opened, output, {0u, 33u, 66u});
}

}  // namespace
}  // namespace dcloth::testing

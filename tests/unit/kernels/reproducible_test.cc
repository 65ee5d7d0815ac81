// The arithmetic of the "reproducible" table, to the bit: that of the scalar references, and for the layer norm sums in
// four strands. Whichever CPU runs this, the bits are those of plain floats in a written order.
#include <algorithm>
#include <cstring>

#include "kernels/activation/activation_scalar.h"
#include "kernels/gsgru/gsgru_strands.h"
#include "kernels/scalar_math.h"
#include "tests/unit/kernels/kernel_test.h"

namespace dcloth::kernels {
namespace {

class ReproducibleTest : public testing::Test {
 protected:
  void SetUp() override {
    table_ = FindKernels("reproducible");
    if (table_ == nullptr) {
      ASSERT_EQ(KernelTableCount(), 1u) << "a CPU with vectors has the table";
      GTEST_SKIP() << "an x86 CPU before SSE4.2";
    }
  }
  const KernelTable* table_ = nullptr;
  Random random_{17};
};

void ExpectSameBits(const std::vector<float>& a, const std::vector<float>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (size_t i = 0; i < a.size(); ++i) ASSERT_EQ(std::memcmp(&a[i], &b[i], 4), 0) << i << ": " << a[i] << ", " << b[i];
}

// Floats on 64 bytes.
struct Aligned : GuardedBuffer<float> {
  explicit Aligned(size_t count) : GuardedBuffer(count, Place::kAligned64) {}
  explicit Aligned(const std::vector<float>& values) : GuardedBuffer(values, Place::kAligned64) {}
};

TEST_F(ReproducibleTest, Gates) {
  const size_t k = 257;
  const std::vector<float> gx = random_.Floats(3 * k, -4, 4), gh = random_.Floats(3 * k, -4, 4);
  std::vector<float> h = random_.Floats(k, -1, 1), plain = h;
  table_->gru_gates({gx.data(), gh.data(), h.data(), k});
  scalar::GruGates({gx.data(), gh.data(), plain.data(), k});
  ExpectSameBits(h, plain);
}

TEST_F(ReproducibleTest, MatrixVector) {
  for (const size_t rows : {1, 2, 7, 168, 1021}) {
    const size_t panels = 3;
    const std::vector<float> x = random_.Floats(rows, -1, 1), bias = random_.Floats(32 * panels, -1, 1);
    Aligned weights(random_.Floats(rows * panels * 32, -1, 1));
    std::vector<float> y(32 * panels), plain(y.size());
    MatvecF32Job job = {x.data(), weights.data(), bias.data(), y.data(), rows, rows, panels, true};
    table_->matvec_f32(job);
    job.y = plain.data();
    scalar::MatvecF32(job);
    ExpectSameBits(y, plain);
    Aligned halves(rows * panels * 16);
    auto* const bits = reinterpret_cast<uint16_t*>(halves.data());
    for (size_t i = 0; i < rows * panels * 32; ++i) bits[i] = static_cast<uint16_t>(random_.Below(0x7C00));
    MatvecF16Job half = {x.data(), bits, bias.data(), y.data(), rows, rows, panels, false};
    table_->matvec_f16(half);
    half.y = plain.data();
    scalar::MatvecF16(half);
    ExpectSameBits(y, plain);
  }
}

TEST_F(ReproducibleTest, SkinningAndNormals) {
  const size_t n = 301;
  const std::vector<float> matrices = random_.Floats(12 * 7, -1, 1), positions = random_.Floats(3 * n, -1, 1);
  const std::vector<float> delta0 = random_.Floats(3 * n, -1, 1), delta1 = random_.Floats(3 * n, -1, 1);
  for (const size_t influences : {1, 4, 8}) {
    const std::vector<float> weights = random_.Floats(n * influences, 0, 1);
    std::vector<uint8_t> bones(weights.size());
    for (uint8_t& bone : bones) bone = static_cast<uint8_t>(random_.Below(7));
    std::vector<float> out(3 * n), plain(out.size());
    SkinningJob job = {matrices.data(),
                       positions.data(),
                       delta0.data(),
                       delta1.data(),
                       bones.data(),
                       weights.data(),
                       out.data(),
                       12,
                       n,
                       influences,
                       0.3f};
    table_->skinning(job);
    job.out = plain.data();
    scalar::Skinning(job);
    ExpectSameBits(out, plain);
  }
  std::vector<uint16_t> triangles(3 * 500);
  for (uint16_t& corner : triangles) corner = static_cast<uint16_t>(random_.Below(n));
  std::vector<float> normals(3 * n), plain(normals.size());
  NormalsJob job = {positions.data(), 12, triangles.data(), normals.data(), 12, n, 500};
  table_->normals(job);
  job.normals = plain.data();
  scalar::Normals(job);
  ExpectSameBits(normals, plain);
}

// Four strands, each every fourth element; then the first and third, the second and fourth, and their sum.
template <class Term>
float SumInStrands(size_t count, Term term) {
  float strand[4] = {};
  for (size_t f = 0; f < count; ++f) strand[f % 4] += term(f);
  return (strand[0] + strand[2]) + (strand[1] + strand[3]);
}

// The layer of gsgru_scalar.cc with those sums.
float PlainVertex(const GsgruJob& job, size_t vertex, float* h) {
  const size_t width = job.features, stride = GsgruInputStride(job.input_width);
  float mean[64], gates[192], reset[64], o[64];
  const uint32_t begin = job.row_starts[vertex], end = job.row_starts[vertex + 1];
  for (size_t f = 0; f < job.input_width; ++f) {
    float sum = 0;
    for (uint32_t e = begin; e < end; ++e) sum += job.x[job.columns[e] * stride + f];
    mean[f] = sum * (1.0f / static_cast<float>(end - begin));
  }
  for (size_t c = 0; c < 3 * width; ++c) {
    gates[c] = job.gate_bias[c];
    for (size_t k = 0; k < job.input_width; ++k) gates[c] += mean[k] * job.input_gates[k * 3 * width + c];
    for (size_t k = 0; k < width && c < 2 * width; ++k) gates[c] += h[k] * job.hidden_gates[k * 2 * width + c];
  }
  for (size_t f = 0; f < width; ++f) reset[f] = scalar::SigmoidOf(gates[width + f]) * h[f];
  for (size_t f = 0; f < width; ++f) {
    float& candidate = gates[2 * width + f];
    for (size_t k = 0; k < width; ++k) candidate += reset[k] * job.hidden_candidate[k * width + f];
  }
  for (size_t f = 0; f < width; ++f)
    h[f] += scalar::SigmoidOf(gates[f]) * (scalar::TanhOf(gates[2 * width + f]) - h[f]);
  for (size_t f = 0; f < width; ++f) {
    o[f] = job.output_bias[f];
    for (size_t k = 0; k < width; ++k) o[f] += h[k] * job.output[k * width + f];
  }
  const float inverse_width = 1.0f / static_cast<float>(width);
  const float centre = SumInStrands(width, [&](size_t f) { return o[f]; }) * inverse_width;
  const float variance =
      SumInStrands(width, [&](size_t f) { return (o[f] - centre) * (o[f] - centre); }) * inverse_width;
  const float inverse = 1.0f / scalar::SquareRoot(variance + kGsgruEpsilon);
  return SumInStrands(width,
                      [&](size_t f) {
                        const float y = (o[f] - centre) * inverse * job.norm_gain[f] + job.norm_offset[f];
                        return (y > 0 ? y : job.prelu_slope * y) * job.embed[f];
                      }) +
         job.embed_bias;
}

TEST_F(ReproducibleTest, GraphLayer) {
  for (const size_t width : {8, 16, 24, 64}) {
    const size_t n = 53;
    const auto weights = [&](size_t rows, size_t columns) {
      const float size = 1.0f / std::sqrt(static_cast<float>(rows));
      return Aligned(random_.Floats(rows * columns, -size, size));
    };
    std::vector<uint32_t> row_starts = {0};
    std::vector<uint16_t> columns;
    for (size_t i = 0; i < n; ++i) {
      columns.push_back(static_cast<uint16_t>(i));
      for (uint32_t k = random_.Below(8); k > 0; --k) columns.push_back(static_cast<uint16_t>(random_.Below(n)));
      row_starts.push_back(static_cast<uint32_t>(columns.size()));
    }
    Aligned x(random_.Floats(n * width, -1, 1)), input = weights(width, 3 * width), bias = weights(1, 3 * width);
    Aligned hidden = weights(width, 2 * width), candidate = weights(width, width), output = weights(width, width);
    Aligned output_bias = weights(1, width), gain = weights(1, width), offset = weights(1, width);
    Aligned embed = weights(width, 1), scratch(GsgruScratchFloats(width));
    std::vector<float> before = random_.Floats(GsgruStateFloats(n, width), -1, 1), s(n), plain_s(n);
    Aligned state(before), strands_state(before), next_x(n * width), strands_next_x(n * width);
    GsgruJob job = {x.data(),
                    row_starts.data(),
                    columns.data(),
                    input.data(),
                    bias.data(),
                    hidden.data(),
                    candidate.data(),
                    output.data(),
                    output_bias.data(),
                    gain.data(),
                    offset.data(),
                    embed.data(),
                    state.data(),
                    nullptr,
                    s.data(),
                    scratch.data(),
                    n,
                    width,
                    width,
                    0.25f,
                    0.125f};
    table_->gsgru(job);
    for (size_t i = 0; i < n; ++i) plain_s[i] = PlainVertex(job, i, &before[i * width]);
    ExpectSameBits(s, plain_s);
    const auto floats = [&](Aligned& values) { return std::vector<float>(values.data(), values.data() + n * width); };
    before.resize(n * width);
    ExpectSameBits(floats(state), before);

    // The table's layer where there are no vectors; then both once more, without the embedding.
    GsgruJob strands_job = job;
    strands_job.state = strands_state.data();
    strands_job.s = plain_s.data();
    strands::Gsgru(strands_job);
    ExpectSameBits(plain_s, s);
    job.embed = strands_job.embed = nullptr;
    job.next_x = next_x.data();
    strands_job.next_x = strands_next_x.data();
    table_->gsgru(job);
    strands::Gsgru(strands_job);
    ExpectSameBits(floats(next_x), floats(strands_next_x));
    ExpectSameBits(floats(state), floats(strands_state));
  }
}

TEST_F(ReproducibleTest, IntegerLayer) {
  for (const size_t width : {8, 16, 32, 40}) {
    const size_t n = 77, input_width = width == 8 ? 3 : width, columns = GsgruI8Columns(input_width, width);
    std::vector<uint32_t> row_starts = {0};
    std::vector<uint16_t> neighbours;
    for (size_t i = 0; i < n; ++i) {
      neighbours.push_back(static_cast<uint16_t>(i));
      for (uint32_t k = random_.Below(8); k > 0; --k) neighbours.push_back(static_cast<uint16_t>(random_.Below(n)));
      row_starts.push_back(static_cast<uint32_t>(neighbours.size()));
    }
    Aligned x(random_.Floats(n * GsgruInputStride(input_width), -1, 1)), points(random_.Floats(9 * width, -1, 1));
    Aligned bias(random_.Floats(3 * width, -1, 1)), row(random_.Floats(width, -1, 1)),
        steps(random_.Floats(width, 25000, 32000));
    Aligned scales(random_.Floats(columns, 4e-8f, 8e-8f)), scratch(GsgruI8ScratchFloats(width));
    Aligned integers(width * columns / 4);
    auto* const weights = reinterpret_cast<int8_t*>(integers.data());
    for (size_t i = 0; i < width * columns; ++i)
      weights[i] = static_cast<int8_t>(static_cast<int>(random_.Below(255)) - 127);
    const std::vector<float> before = random_.Floats(GsgruStateFloats(n, width), -1, 1);
    for (const bool embed : {false, true}) {
      Aligned state(before), strands_state(before), next_x(n * width), strands_next_x(n * width);
      std::vector<float> s(n), strands_s(n);
      GsgruI8Job job = {{x.data(),
                         row_starts.data(),
                         neighbours.data(),
                         points.data(),
                         bias.data(),
                         nullptr,
                         nullptr,
                         nullptr,
                         row.data(),
                         row.data(),
                         row.data(),
                         embed ? row.data() : nullptr,
                         state.data(),
                         next_x.data(),
                         s.data(),
                         scratch.data(),
                         n,
                         input_width,
                         width,
                         0.25f,
                         0.125f},
                        weights,
                        scales.data(),
                        steps.data()};
      table_->gsgru_i8(job);
      job.layer.state = strands_state.data();
      job.layer.next_x = strands_next_x.data();
      job.layer.s = strands_s.data();
      strands::GsgruI8(job);
      const auto floats = [&](Aligned& values) { return std::vector<float>(values.data(), values.data() + n * width); };
      ExpectSameBits(floats(state), floats(strands_state));
      ExpectSameBits(floats(next_x), floats(strands_next_x));
      ExpectSameBits(s, strands_s);
    }
  }
}

}  // namespace
}  // namespace dcloth::kernels

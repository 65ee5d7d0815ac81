// The graph-recurrent layer with integer products, block by block of 16 vertices, row-major with lanes over features,
// as gsgru_vector.cc; activations share divisions (coarse_tanh.h): one for r, one for z and the candidate together.
#include "kernels/simd.h"

#include "kernels/gsgru/gsgru_i8.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/gsgru/gsgru_i8_vector.cc"
#include "hwy/foreach_target.h"
#include "hwy/highway.h"
#include "kernels/activation/coarse_tanh.h"
#include "kernels/gsgru/gsgru_i8_dot-inl.h"
#include "kernels/gsgru/gsgru_mean-inl.h"
#include "kernels/gsgru/gsgru_norm-inl.h"
#include "kernels/multiply_add-inl.h"

// GCC would make copies for constant strides.
#undef DCLOTH_ONE_COPY
#if HWY_COMPILER_GCC_ACTUAL
#define DCLOTH_ONE_COPY __attribute__((noinline, noclone))
#else
#define DCLOTH_ONE_COPY HWY_NOINLINE
#endif

#if DCLOTH_VECTOR_TARGET && HWY_ARCH_ARM && !defined(DCLOTH_SPLIT_MULTIPLY_ADD)
// 16-bit integers are no faster than floats here: the weights as floats, and the layer is that of gsgru_vector.cc.
HWY_BEFORE_NAMESPACE();
namespace dcloth::kernels::HWY_NAMESPACE {

void Gsgru(const GsgruJob& job);

void GsgruI8(const GsgruI8Job& job) {
  const size_t width = job.layer.features, stride = GsgruI8Columns(job.layer.input_width, width);
  float* to = job.layer.scratch + GsgruScratchFloats(width);
  const auto floats = [&](size_t first, size_t columns, const float* inverse_steps) {
    float* const matrix = to;
    for (size_t k = 0; k < width; ++k) {
      const float inverse_step = inverse_steps != nullptr ? inverse_steps[k] : kGsgruHiddenLevels;
      for (size_t c = first; c < first + columns; ++c) {
        *to++ = static_cast<float>(job.weights[k * stride + c]) * (job.column_scales[c] * inverse_step);
      }
    }
    return matrix;
  };
  GsgruJob layer = job.layer;
  const size_t hidden = stride - 4 * width;
  if (hidden != 0) layer.input_gates = floats(0, hidden, job.input_inverse_steps);
  layer.hidden_gates = floats(hidden, 2 * width, nullptr);
  layer.hidden_candidate = floats(hidden + 2 * width, width, nullptr);
  layer.output = floats(hidden + 3 * width, width, nullptr);
  Gsgru(layer);
}

}  // namespace dcloth::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#elif DCLOTH_VECTOR_TARGET
HWY_BEFORE_NAMESPACE();
namespace dcloth::kernels::HWY_NAMESPACE {
namespace {

struct Matrix {
  int16_t* weights;
  const float* scales;  // [columns]
  size_t columns;       // a multiple of F
};

// Parts of the scratch; tiles are [kGsgruBlock, F].
struct Parts {
  float* mean;   // later o
  float* gates;  // three tiles: z, r and the candidate before their activations
  int16_t* mean_inputs;
  int16_t* h_inputs;  // of h, later of h'
  int16_t* reset_inputs;
  Matrix input, hidden, candidate, output;
};

HWY_INLINE Parts Split(const GsgruI8Job& job) {
  const size_t width = job.layer.features, tile = kGsgruBlock * width, square = width * width;
  float* floats = job.layer.scratch;
  float* const integers = floats + GsgruScratchFloats(width);
  auto* const inputs = reinterpret_cast<int16_t*>(integers);
  auto* const weights = reinterpret_cast<int16_t*>(integers + 3 * tile / 2);
  const float* scales = job.column_scales + (job.layer.input_width == 3 ? 0 : 3 * width);
  return {floats,
          floats + tile,
          inputs,
          inputs + tile,
          inputs + 2 * tile,
          {weights, job.column_scales, 3 * width},
          {weights + 3 * square, scales, 2 * width},
          {weights + 5 * square, scales + 2 * width, width},
          {weights + 6 * square, scales + 3 * width, width}};
}

HWY_NOINLINE void Prepare(const GsgruI8Job& job, const Matrix& matrix) {
  const size_t width = job.layer.features, first = static_cast<size_t>(matrix.scales - job.column_scales);
  dot::PackWeights(job.weights + first, GsgruI8Columns(job.layer.input_width, width), width, matrix.columns,
                   matrix.weights);
}

// to = from + sums * scales for a tile of a block: vectors of a matrix's columns from `column` on, which are features
// from `f` on of the tile `to`. from_stride is 0 where the same row, a bias, is for all.
struct Sink {
  const float* from;
  size_t from_stride;
  float* to;
};

template <size_t kVertices, size_t kVectors, class D>
HWY_INLINE void ProductTile(D d, const int16_t* x, size_t width, const Matrix& matrix, const Sink& sink, size_t v,
                            size_t column, size_t f) {
  const hn::RebindToSigned<D> di;
  const size_t lanes = hn::Lanes(d);
  hn::Vec<decltype(di)> sums[kVertices][kVectors];
  for (auto& row : sums) {
    for (auto& sum : row) sum = hn::Zero(di);
  }
  dot::AddProduct(di, x + v * width, width, matrix.weights + column * dot::kRows, matrix.columns, sums);
  for (size_t i = 0; i < kVectors; ++i) {
    const auto scale = hn::Load(d, matrix.scales + column + i * lanes);
    const size_t at = f + i * lanes;
    for (size_t u = 0; u < kVertices; ++u) {
      const auto from = hn::Load(d, sink.from + (v + u) * sink.from_stride + at);
      hn::Store(MultiplyAdd(hn::ConvertTo(d, sums[u][i]), scale, from), d, sink.to + (v + u) * width + at);
    }
  }
}

// A block's inputs [16, F] times a matrix, F of its columns to a tile. As many sums as the registers hold: 16 of 32, 8
// of 16; two vectors of columns where F has them, so that an input serves both.
template <size_t kFeatures, class D>
DCLOTH_ONE_COPY void Product(D d, const int16_t* x, size_t features, const Matrix& matrix, Sink sink) {
  const size_t width = kFeatures != 0 ? kFeatures : features;
  constexpr size_t kSums = HWY_TARGET == HWY_AVX3 ? 16 : 8;
  const size_t lanes = hn::Lanes(d), paired = width / (2 * lanes) * (2 * lanes);
  for (size_t column = 0; column < matrix.columns; column += width) {
    for (size_t f = 0; f < paired; f += 2 * lanes) {
      for (size_t v = 0; v < kGsgruBlock; v += kSums / 2) {
        ProductTile<kSums / 2, 2>(d, x, width, matrix, sink, v, column + f, f);
      }
    }
    if (paired < width) {
      for (size_t v = 0; v < kGsgruBlock; v += kSums) {
        ProductTile<kSums, 1>(d, x, width, matrix, sink, v, column + paired, paired);
      }
    }
    sink.from += sink.from_stride == 0 ? width : kGsgruBlock * width;
    sink.to += kGsgruBlock * width;
  }
}

// The float products of the first layer's three inputs.
template <class D>
HWY_INLINE void PointProduct(D d, const GsgruJob& job, const float* mean, float* gates) {
  const size_t width = job.features, columns = 3 * width;
  for (size_t c = 0; c < columns; c += hn::Lanes(d)) {
    float* to = gates + c / width * kGsgruBlock * width + c % width;
    const auto bias = hn::Load(d, job.gate_bias + c);
    hn::Vec<D> w[3];
    for (size_t k = 0; k < 3; ++k) w[k] = hn::Load(d, job.input_gates + k * columns + c);
    for (size_t v = 0; v < kGsgruBlock; ++v) {
      auto sum = bias;
      for (size_t k = 0; k < 3; ++k) sum = MultiplyAdd(hn::Set(d, mean[v * GsgruInputStride(3) + k]), w[k], sum);
      hn::Store(sum, d, to + v * width);
    }
  }
}

template <class D>
struct Fraction {
  hn::Vec<D> p, q;
};

template <class D, class V = hn::Vec<D> >
HWY_INLINE Fraction<D> CoarseTanh(D d, V x) {
  const auto term = [d](float c) { return hn::Set(d, c); };
  x = hn::Min(term(kCoarseTanhClamp), hn::Max(term(-kCoarseTanhClamp), x));
  const V x2 = hn::Mul(x, x);
  V p = MultiplyAdd(x2, term(kCoarseTanhNumerator[2]), term(kCoarseTanhNumerator[1]));
  p = MultiplyAdd(x2, p, term(kCoarseTanhNumerator[0]));
  V q = MultiplyAdd(x2, term(kCoarseTanhDenominator[2]), term(kCoarseTanhDenominator[1]));
  q = MultiplyAdd(x2, q, term(kCoarseTanhDenominator[0]));
  q = MultiplyAdd(x2, q, term(1.0f));
  return {hn::Mul(x, p), q};
}

// (1 + tanh(x / 2)) / 2
template <class D>
HWY_INLINE Fraction<D> CoarseSigmoid(D d, hn::Vec<D> x) {
  const auto half = hn::Set(d, 0.5f);
  const Fraction<D> t = CoarseTanh(d, hn::Mul(half, x));
  return {hn::Mul(half, hn::Add(t.p, t.q)), t.q};
}

// The inputs r h of a tile.
template <class D>
HWY_INLINE void Reset(D d, const float* HWY_RESTRICT r, const float* HWY_RESTRICT h, size_t tile, int16_t* to) {
  for (size_t i = 0; i < tile; i += hn::Lanes(d)) {
    const Fraction<D> gate = CoarseSigmoid(d, hn::Load(d, r + i));
    const auto reset = hn::Div(hn::Mul(gate.p, hn::Load(d, h + i)), gate.q);
    dot::StoreInputs(d, hn::Mul(reset, hn::Set(d, kGsgruHiddenLevels)), to + i);
  }
}

// h' in place and as inputs: z (g - h) = zp (gp - h gq) / (zq gq).
template <class D>
HWY_INLINE void Update(D d, const float* HWY_RESTRICT update, const float* HWY_RESTRICT candidate, size_t tile,
                       float* HWY_RESTRICT h, int16_t* to) {
  for (size_t i = 0; i < tile; i += hn::Lanes(d)) {
    const Fraction<D> z = CoarseSigmoid(d, hn::Load(d, update + i)), g = CoarseTanh(d, hn::Load(d, candidate + i));
    const auto old = hn::Load(d, h + i);
    const auto rise = hn::Mul(z.p, hn::Sub(g.p, hn::Mul(old, g.q)));
    const auto next = hn::Add(old, hn::Div(rise, hn::Mul(z.q, g.q)));
    hn::Store(next, d, h + i);
    dot::StoreInputs(d, hn::Mul(next, hn::Set(d, kGsgruHiddenLevels)), to + i);
  }
}

// Rows of inputs from rows of floats, each feature times its own factor.
template <class D>
HWY_INLINE void RoundMean(D d, const float* HWY_RESTRICT rows, const float* factors, size_t width, int16_t* to) {
  for (size_t f = 0; f < width; f += hn::Lanes(d)) {
    const auto factor = hn::Load(d, factors + f);
    for (size_t i = f; i < kGsgruBlock * width; i += width) {
      dot::StoreInputs(d, hn::Mul(hn::Load(d, rows + i), factor), to + i);
    }
  }
}

template <class D>
HWY_INLINE void RoundState(D d, const float* HWY_RESTRICT h, size_t tile, int16_t* to) {
  for (size_t i = 0; i < tile; i += hn::Lanes(d)) {
    dot::StoreInputs(d, hn::Mul(hn::Load(d, h + i), hn::Set(d, kGsgruHiddenLevels)), to + i);
  }
}

// A width known to the compiler unrolls the products; 0 takes the job's.
template <size_t kFeatures, class D>
HWY_NOINLINE void RunLayer(D d, const GsgruI8Job& job) {
  const GsgruJob& layer = job.layer;
  const size_t width = kFeatures != 0 ? kFeatures : layer.features, tile = kGsgruBlock * width;
  const Parts parts = Split(job);
  float* const r = parts.gates + tile;
  float* const candidate = parts.gates + 2 * tile;
  if (layer.input_width != 3) Prepare(job, parts.input);
  for (const Matrix* matrix : {&parts.hidden, &parts.candidate, &parts.output}) Prepare(job, *matrix);
  for (size_t first = 0; first < layer.vertices; first += kGsgruBlock) {
    const size_t count = HWY_MIN(kGsgruBlock, layer.vertices - first), next = first + count;
    PrefetchBlock(layer, next, HWY_MIN(kGsgruBlock, layer.vertices - next));
    float* h = layer.state + first * width;
    AggregateBlock(d, layer, first, count, parts.mean);
    if (layer.input_width == 3) {
      PointProduct(d, layer, parts.mean, parts.gates);
    } else {
      RoundMean(d, parts.mean, job.input_inverse_steps, width, parts.mean_inputs);
      Product<kFeatures>(d, parts.mean_inputs, width, parts.input, {layer.gate_bias, 0, parts.gates});
    }
    RoundState(d, h, tile, parts.h_inputs);
    Product<kFeatures>(d, parts.h_inputs, width, parts.hidden, {parts.gates, width, parts.gates});
    Reset(d, r, h, tile, parts.reset_inputs);
    Product<kFeatures>(d, parts.reset_inputs, width, parts.candidate, {candidate, width, candidate});
    Update(d, parts.gates, candidate, tile, h, parts.h_inputs);
    Product<kFeatures>(d, parts.h_inputs, width, parts.output, {layer.output_bias, 0, parts.mean});
    NormBlock(d, layer, parts.mean, first, count);
  }
}

}  // namespace

void GsgruI8(const GsgruI8Job& job) {
  const hn::ScalableTag<float> d;
  // Old CPUs are not worth the code, and browsers download it.
  switch (HWY_TARGET == HWY_SSE4 || HWY_TARGET == HWY_WASM ? 0 : job.layer.features) {
    case 16:
      return RunLayer<16>(d, job);
    case 32:
      return RunLayer<32>(d, job);
    default:
      return RunLayer<0>(hn::CappedTag<float, 8>(), job);  // every width is a multiple of 8
  }
}

}  // namespace dcloth::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif  // DCLOTH_VECTOR_TARGET

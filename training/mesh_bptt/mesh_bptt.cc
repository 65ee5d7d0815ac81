// Order of a window: forward tick by tick, layer by layer; backward the other way. A layer's gradient by its input
// stays at the mean m; the layer below gathers it through the transposed mean: written once, never scattered.
#include "training/mesh_bptt/mesh_bptt.h"

#include "training/mesh_bptt/layer.h"

namespace mesh_bptt {
namespace {

static_assert(kLanes == MESH_BPTT_LANES, "the header says how many lanes");

// Every array over the mesh is read and written a whole vector at a time.
template <class... Pointers>
bool Aligned(const Pointers*... pointers) {
  return ((reinterpret_cast<uintptr_t>(pointers) % 64 == 0) && ...);
}

bool Possible(const mesh_bptt_shape& s) {
  const bool width = s.width == 4 || s.width == 8 || s.width == 16 || s.width == 32;
  return width && s.vertices > 0 && s.ticks > 0 && s.layers > 0;
}

int64_t LayerSize(int64_t inputs, int64_t width) { return 3 * inputs * width + 4 * width * width + 6 * width + 1; }

template <class Real, int F>
class Window {
  using V = typename Lanes<Real>::type;

 public:
  Window(const mesh_bptt_shape& shape, const Real* weights, Real* scratch)
      : s_(shape), n_(shape.vertices), weights_(weights), scratch_(reinterpret_cast<V*>(scratch)) {}

  void Forward(const Real* mean, const Real* input, Real* states, Real* tape, Real* out) {
    const V* points = reinterpret_cast<const V*>(input);
    V *state = reinterpret_cast<V*>(states), *records = reinterpret_cast<V*>(tape), *s = reinterpret_cast<V*>(out);
    V *below = scratch_, *above = scratch_ + n_ * F;
    if (records)
      for (int64_t i = 0; i < s_.layers * n_ * F; ++i) records[i] = state[i];
    for (int32_t t = 0; t < s_.ticks; ++t) {
      for (int32_t l = 0; l < s_.layers; ++l) {
        V* h = state + l * n_ * F;
        if (l == 0)
          ForwardLayer<3>(mean, 0, points + t * n_ * 3, h, records ? Tape(records, 0, t) : nullptr, above, s + t * n_);
        else
          ForwardLayer<F>(mean, l, below, h, records ? Tape(records, l, t) : nullptr, above, s + t * n_);
        V* swap = below;
        below = above, above = swap;
      }
    }
  }

  void Backward(const Real* back, const Real* tape, const Real* out_gradient, double* gradient) {
    const V *records = reinterpret_cast<const V*>(tape), *by_s = reinterpret_cast<const V*>(out_gradient);
    V *by_state = scratch_, *above = by_state + s_.layers * n_ * F, *here = above + n_ * F;
    total_ = here + n_ * F;
    for (int64_t i = 0; i < s_.layers * n_ * F; ++i) by_state[i] = V{};
    for (int64_t i = 0; i < Weights(s_.layers) + F + 1; ++i) gradient[i] = 0;
    for (int32_t t = s_.ticks - 1; t >= 0; --t) {
      for (int32_t l = s_.layers - 1; l >= 0; --l) {
        V* by_h = by_state + l * n_ * F;
        if (l == 0)
          BackwardLayer<3>(back, 0, t, records, by_s + t * n_, above, by_h, here, gradient);
        else
          BackwardLayer<F>(back, l, t, records, by_s + t * n_, above, by_h, here, gradient);
        V* swap = above;
        above = here, here = swap;
      }
    }
  }

 private:
  static int64_t Weights(int64_t layers) {
    return layers ? Place<3, F>::size + (layers - 1) * Place<F, F>::size : 0;
  }

  // Records of layer l at tick t; t = -1: nothing. First of all lie the states before the first tick.
  template <class Pointer>
  Pointer Tape(Pointer records, int64_t l, int64_t t) const {
    const int64_t first = Record<3, F>::size, other = Record<F, F>::size, tick = n_ * (first + (s_.layers - 1) * other);
    return records + s_.layers * n_ * F + t * tick + (l ? n_ * (first + (l - 1) * other) : 0);
  }

  // Mean over N(i) of rows x [n, C].
  template <int C>
  void Gather(const Real* e, int64_t i, const V* x, V* m) const {
    V sum[C] = {};
    for (int32_t k = s_.start[i]; k < s_.start[i + 1]; ++k) {
      const V* row = x + static_cast<int64_t>(s_.column[k]) * C;
      for (int c = 0; c < C; ++c) sum[c] += row[c] * e[k];
    }
    for (int c = 0; c < C; ++c) m[c] = sum[c];
  }

  template <int I>
  void ForwardLayer(const Real* mean, int32_t l, const V* x, V* state, V* tape, V* next, V* s) const {
    using R = Record<I, F>;
    const Real *w = weights_ + Weights(l), *e = weights_ + Weights(s_.layers);
    for (int64_t i = 0; i < n_; ++i) {
      V record[R::size], normalised[F];
      Gather<I>(mean, i, x, record);
      Recur<I, F>(w, state + i * F, record);
      for (int f = 0; f < F; ++f) state[i * F + f] = record[R::h + f];
      if (tape)
        for (int k = 0; k < R::size; ++k) tape[i * R::size + k] = record[k];
      Normalise<I, F>(w, record + R::h, normalised);
      V* row = next + i * F;
      Activate<I, F>(w, normalised, row);
      if (l + 1 == s_.layers) {
        V sum = V{} + e[F];
        for (int f = 0; f < F; ++f) sum += row[f] * e[f];
        s[i] = sum;
      }
    }
  }

  template <int I>
  void BackwardLayer(const Real* back, int32_t l, int32_t t, const V* records, const V* by_s, const V* above,
                     V* by_state, V* by_input, double* gradient) {
    using R = Record<I, F>;
    const Real *w = weights_ + Weights(l), *e = weights_ + Weights(s_.layers);
    const V* now = Tape(records, l, t);
    const V* before = t ? Tape(records, l, t - 1) + R::h : records + l * n_ * F;
    const int64_t stride = t ? R::size : F;
    const bool last = l + 1 == s_.layers;
    for (int k = 0; k < Place<I, F>::size + F + 1; ++k) total_[k] = V{};
    V* by_e = total_ + Place<I, F>::size;
    Block<I, F, Real> block(total_);
    for (int64_t i = 0; i < n_; ++i) {
      V by_x[F];
      if (last) {
        V normalised[F], x[F];
        Normalise<I, F>(w, now + i * R::size + R::h, normalised);
        Activate<I, F>(w, normalised, x);
        for (int f = 0; f < F; ++f) {
          by_x[f] = by_s[i] * e[f];
          by_e[f] += by_s[i] * x[f];
        }
        by_e[F] += by_s[i];
      } else {
        Gather<F>(back, i, above, by_x);
      }
      block.Add(w, now + i * R::size, before + i * stride, by_x, by_state + i * F, by_input + i * F);
    }
    block.Flush();
    Sum(total_, Place<I, F>::size, gradient + Weights(l));
    if (last) Sum(by_e, F + 1, gradient + Weights(s_.layers));
  }

  static void Sum(const V* from, int count, double* to) {
    for (int k = 0; k < count; ++k)
      for (int lane = 0; lane < kLanes; ++lane) to[k] += static_cast<double>(from[k][lane]);
  }

  const mesh_bptt_shape& s_;
  int64_t n_;
  const Real* weights_;
  V *scratch_, *total_ = nullptr;
};

// Calls does(Width<F>()) with the shape's F.
template <int F>
struct Width {
  static constexpr int value = F;
};

template <class Does>
void WithWidth(int32_t width, const Does& does) {
  if (width == 4) does(Width<4>());
  if (width == 8) does(Width<8>());
  if (width == 16) does(Width<16>());
  if (width == 32) does(Width<32>());
}

template <class Real>
int32_t Forward(const mesh_bptt_shape& shape, const Real* mean, const Real* weights, const Real* input, Real* states,
                Real* tape, Real* scratch, Real* out) {
  if (!Possible(shape) || !Aligned(input, states, tape, scratch, out)) return 0;
  WithWidth(shape.width, [&](auto width) {
    Window<Real, decltype(width)::value>(shape, weights, scratch).Forward(mean, input, states, tape, out);
  });
  return 1;
}

template <class Real>
int32_t Backward(const mesh_bptt_shape& shape, const Real* back, const Real* weights, const Real* tape,
                 const Real* out_gradient, Real* scratch, double* gradient) {
  if (!Possible(shape) || !Aligned(tape, out_gradient, scratch)) return 0;
  WithWidth(shape.width, [&](auto width) {
    Window<Real, decltype(width)::value>(shape, weights, scratch).Backward(back, tape, out_gradient, gradient);
  });
  return 1;
}

}  // namespace
}  // namespace mesh_bptt

#define EXPORTED extern "C" __attribute__((visibility("default")))

EXPORTED int64_t mesh_bptt_weights_size(const mesh_bptt_shape* s) {
  if (!mesh_bptt::Possible(*s)) return 0;
  return mesh_bptt::LayerSize(3, s->width) + (s->layers - 1) * mesh_bptt::LayerSize(s->width, s->width) + s->width + 1;
}

EXPORTED int64_t mesh_bptt_states_size(const mesh_bptt_shape* s) {
  return mesh_bptt::Possible(*s) ? int64_t{MESH_BPTT_LANES} * s->layers * s->vertices * s->width : 0;
}

EXPORTED int64_t mesh_bptt_tape_size(const mesh_bptt_shape* s) {
  if (!mesh_bptt::Possible(*s)) return 0;
  const int64_t tick = (3 + 4 * s->width) + (s->layers - 1) * int64_t{5} * s->width;
  return mesh_bptt_states_size(s) + int64_t{MESH_BPTT_LANES} * s->ticks * s->vertices * tick;
}

EXPORTED int64_t mesh_bptt_scratch_size(const mesh_bptt_shape* s) {
  if (!mesh_bptt::Possible(*s)) return 0;
  const int64_t rows = int64_t{2} * s->vertices * s->width;  // a layer's input and output, or their gradients
  return mesh_bptt_states_size(s) +
         MESH_BPTT_LANES * (rows + mesh_bptt::LayerSize(s->layers > 1 ? s->width : 3, s->width) + s->width + 1);
}

EXPORTED int32_t mesh_bptt_forward_f32(const mesh_bptt_shape* shape, const float* mean, const float* weights,
                                       const float* input, float* states, float* tape, float* scratch, float* out) {
  return mesh_bptt::Forward(*shape, mean, weights, input, states, tape, scratch, out);
}

EXPORTED int32_t mesh_bptt_forward_f64(const mesh_bptt_shape* shape, const double* mean, const double* weights,
                                       const double* input, double* states, double* tape, double* scratch,
                                       double* out) {
  return mesh_bptt::Forward(*shape, mean, weights, input, states, tape, scratch, out);
}

EXPORTED int32_t mesh_bptt_backward_f32(const mesh_bptt_shape* shape, const float* back, const float* weights,
                                        const float* tape, const float* out_gradient, float* scratch,
                                        double* weights_gradient) {
  return mesh_bptt::Backward(*shape, back, weights, tape, out_gradient, scratch, weights_gradient);
}

EXPORTED int32_t mesh_bptt_backward_f64(const mesh_bptt_shape* shape, const double* back, const double* weights,
                                        const double* tape, const double* out_gradient, double* scratch,
                                        double* weights_gradient) {
  return mesh_bptt::Backward(*shape, back, weights, tape, out_gradient, scratch, weights_gradient);
}

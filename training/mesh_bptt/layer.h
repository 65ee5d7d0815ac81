// One graph-recurrent layer at one vertex, forward, and its gradient over a block of vertices.
#ifndef DCLOTH_TRAINING_MESH_BPTT_LAYER_H_
#define DCLOTH_TRAINING_MESH_BPTT_LAYER_H_

#include "training/mesh_bptt/lanes.h"

namespace mesh_bptt {

constexpr double kNormEpsilon = 1e-5;

// Places in a layer's flat weights; the same places hold their gradient. I inputs, width F.
template <int I, int F>
struct Place {
  static constexpr int v_z = 0, v_r = I * F, v_g = 2 * I * F, c_z = 3 * I * F, c_r = c_z + F, c_g = c_r + F,
                       u_z = c_g + F, u_r = u_z + F * F, u_g = u_r + F * F, w_o = u_g + F * F, b_o = w_o + F * F,
                       scale = b_o + F, shift = scale + F, slope = shift + F, size = slope + 1;
};

// What a tick leaves on the tape at one vertex: m [I], z, r, g, h' [F].
template <int I, int F>
struct Record {
  static constexpr int z = I, r = I + F, g = I + 2 * F, h = I + 3 * F, size = I + 4 * F;
};

// record holds m; fills the rest from the state before, h [F]; h may be the record's own place.
template <int I, int F, class Real, class V>
inline void Recur(const Real* w, const V* h, V* record) {
  using P = Place<I, F>;
  const V* m = record;
  V z[F], r[F], g[F];
  for (int f = 0; f < F; ++f) {
    z[f] = V{} + w[P::c_z + f];
    r[f] = V{} + w[P::c_r + f];
    g[f] = V{} + w[P::c_g + f];
  }
  Multiply<I, F>(m, w + P::v_z, z);
  Multiply<I, F>(m, w + P::v_r, r);
  Multiply<I, F>(m, w + P::v_g, g);
  Multiply<F, F>(h, w + P::u_z, z);
  Multiply<F, F>(h, w + P::u_r, r);
  V reset[F];
  for (int f = 0; f < F; ++f) {
    Sigmoid(&z[f]);
    Sigmoid(&r[f]);
    reset[f] = r[f] * h[f];
  }
  Multiply<F, F>(reset, w + P::u_g, g);
  using R = Record<I, F>;
  for (int f = 0; f < F; ++f) {
    Tanh(&g[f]);
    record[R::z + f] = z[f];
    record[R::r + f] = r[f];
    record[R::g + f] = g[f];
    record[R::h + f] = h[f] + z[f] * (g[f] - h[f]);
  }
}

// h' [F] -> normalised [F], before LayerNorm's scale and shift; returns 1 / deviation.
template <int I, int F, class Real, class V>
inline V Normalise(const Real* w, const V* h, V* normalised) {
  using P = Place<I, F>;
  for (int f = 0; f < F; ++f) normalised[f] = V{} + w[P::b_o + f];
  Multiply<F, F>(h, w + P::w_o, normalised);
  V mean = {}, square = {};
  for (int f = 0; f < F; ++f) mean += normalised[f];
  mean = mean * static_cast<Real>(1.0 / F);
  for (int f = 0; f < F; ++f) {
    normalised[f] -= mean;
    square += normalised[f] * normalised[f];
  }
  const V inverse = static_cast<Real>(1) /
                    SquareRoot(square * static_cast<Real>(1.0 / F) + static_cast<Real>(kNormEpsilon));
  for (int f = 0; f < F; ++f) normalised[f] *= inverse;
  return inverse;
}

// normalised -> the layer's output x' [F].
template <int I, int F, class Real, class V>
inline void Activate(const Real* w, const V* normalised, V* x) {
  using P = Place<I, F>;
  for (int f = 0; f < F; ++f) {
    const V y = normalised[f] * w[P::scale + f] + w[P::shift + f];
    x[f] = y > V{} ? y : y * w[P::slope];
  }
}

// Gradients of one pass over the mesh, gathered a block of vertices at a time.
template <int I, int F, class Real>
class Block {
  using V = typename Lanes<Real>::type;

 public:
  static constexpr int kVertices = 16;

  explicit Block(V* total) : total_(total) {}

  // One vertex: its record, the state before it, the gradient by x' [F]; state_gradient [F] by h' in, by h out;
  // input_gradient [I] by m, out (not written where I = 3: nothing below the first layer learns).
  void Add(const Real* w, const V* record, const V* before, const V* gradient, V* state_gradient, V* input_gradient) {
    using P = Place<I, F>;
    using R = Record<I, F>;
    const V *z = record + R::z, *r = record + R::r, *g = record + R::g, *h = record + R::h;
    V normalised[F], by_normalised[F], d[F], *by_o = o_ + count_ * F;
    const V inverse = Normalise<I, F>(w, h, normalised);
    V mean = {}, along = {};
    for (int f = 0; f < F; ++f) {
      const V y = normalised[f] * w[P::scale + f] + w[P::shift + f];
      const V by_y = y > V{} ? gradient[f] : gradient[f] * w[P::slope];
      total_[P::slope] += y > V{} ? V{} : gradient[f] * y;
      total_[P::scale + f] += by_y * normalised[f];
      total_[P::shift + f] += by_y;
      by_normalised[f] = by_y * w[P::scale + f];
      mean += by_normalised[f];
      along += by_normalised[f] * normalised[f];
    }
    mean = mean * static_cast<Real>(1.0 / F), along = along * static_cast<Real>(1.0 / F);
    for (int f = 0; f < F; ++f) by_o[f] = inverse * (by_normalised[f] - mean - normalised[f] * along);

    V *by_z = z_ + count_ * F, *by_r = r_ + count_ * F, *by_g = g_ + count_ * F, *reset = reset_ + count_ * F;
    for (int f = 0; f < F; ++f) d[f] = state_gradient[f];
    MultiplyTransposed<F, F>(by_o, w + P::w_o, d);
    V by_reset[F] = {};
    for (int f = 0; f < F; ++f) {
      by_g[f] = d[f] * z[f] * (static_cast<Real>(1) - g[f] * g[f]);
      by_z[f] = d[f] * (g[f] - before[f]) * z[f] * (static_cast<Real>(1) - z[f]);
      d[f] = d[f] * (static_cast<Real>(1) - z[f]);
      reset[f] = r[f] * before[f];
    }
    MultiplyTransposed<F, F>(by_g, w + P::u_g, by_reset);
    for (int f = 0; f < F; ++f) {
      by_r[f] = by_reset[f] * before[f] * r[f] * (static_cast<Real>(1) - r[f]);
      d[f] += by_reset[f] * r[f];
    }
    MultiplyTransposed<F, F>(by_z, w + P::u_z, d);
    MultiplyTransposed<F, F>(by_r, w + P::u_r, d);
    for (int f = 0; f < F; ++f) state_gradient[f] = d[f];
    if constexpr (I != 3) {
      V by_m[I] = {};
      MultiplyTransposed<I, F>(by_z, w + P::v_z, by_m);
      MultiplyTransposed<I, F>(by_r, w + P::v_r, by_m);
      MultiplyTransposed<I, F>(by_g, w + P::v_g, by_m);
      for (int i = 0; i < I; ++i) input_gradient[i] = by_m[i];
    }
    for (int i = 0; i < I; ++i) m_[count_ * I + i] = record[i];
    for (int f = 0; f < F; ++f) before_[count_ * F + f] = before[f], h_[count_ * F + f] = h[f];
    if (++count_ == kVertices) Flush();
  }

  void Flush() {
    using P = Place<I, F>;
    Outer<I, F>(count_, m_, z_, total_ + P::v_z);
    Outer<I, F>(count_, m_, r_, total_ + P::v_r);
    Outer<I, F>(count_, m_, g_, total_ + P::v_g);
    Outer<F, F>(count_, before_, z_, total_ + P::u_z);
    Outer<F, F>(count_, before_, r_, total_ + P::u_r);
    Outer<F, F>(count_, reset_, g_, total_ + P::u_g);
    Outer<F, F>(count_, h_, o_, total_ + P::w_o);
    AddRows<F>(count_, z_, total_ + P::c_z);
    AddRows<F>(count_, r_, total_ + P::c_r);
    AddRows<F>(count_, g_, total_ + P::c_g);
    AddRows<F>(count_, o_, total_ + P::b_o);
    count_ = 0;
  }

 private:
  V* total_;
  int count_ = 0;
  V m_[kVertices * I], before_[kVertices * F], reset_[kVertices * F], h_[kVertices * F];
  V z_[kVertices * F], r_[kVertices * F], g_[kVertices * F], o_[kVertices * F];  // gradients before the activations
};

}  // namespace mesh_bptt

#endif  // DCLOTH_TRAINING_MESH_BPTT_LAYER_H_

// Eight clips in one vector: the type, activations, and the three products that a layer and its gradient are made of.
#ifndef DCLOTH_TRAINING_MESH_BPTT_LANES_H_
#define DCLOTH_TRAINING_MESH_BPTT_LANES_H_

#include <cmath>

#include "kernels/activation/tanh_rational.h"

namespace mesh_bptt {

constexpr int kLanes = 8;

template <class Real>
struct Lanes;
template <>
struct Lanes<float> {
  typedef float type __attribute__((vector_size(32)));
};
template <>
struct Lanes<double> {
  typedef double type __attribute__((vector_size(64)));
};
using Float = Lanes<float>::type;
using Double = Lanes<double>::type;

inline void Tanh(Float* x) {
  using dcloth::kernels::kTanhDenominator;
  using dcloth::kernels::kTanhNumerator;
  const float clamp = dcloth::kernels::kTanhClampWithoutFma;
  Float v = *x;
  v = v > clamp ? Float{} + clamp : v;
  v = v < -clamp ? Float{} - clamp : v;
  const Float square = v * v;
  Float p = Float{} + kTanhNumerator[6], q = Float{} + kTanhDenominator[3];
  for (int i = 5; i >= 0; --i) p = p * square + kTanhNumerator[i];
  for (int i = 2; i >= 0; --i) q = q * square + kTanhDenominator[i];
  *x = v * p / q;
}

inline void Tanh(Double* x) {
  for (int lane = 0; lane < kLanes; ++lane) (*x)[lane] = std::tanh((*x)[lane]);
}

template <class V>
inline void Sigmoid(V* x) {
  *x = *x * 0.5f;
  Tanh(x);
  *x = *x * 0.5f + 0.5f;
}

inline Float SquareRoot(Float x) {
  for (int lane = 0; lane < kLanes; ++lane) x[lane] = std::sqrt(x[lane]);
  return x;
}

inline Double SquareRoot(Double x) {
  for (int lane = 0; lane < kLanes; ++lane) x[lane] = std::sqrt(x[lane]);
  return x;
}

// y [J] += x [I] W [I, J].
template <int I, int J, class Real, class V>
inline void Multiply(const V* x, const Real* w, V* y) {
  constexpr int kTile = J < 8 ? J : 8;
  for (int j = 0; j < J; j += kTile) {
    V sum[kTile];
    for (int k = 0; k < kTile; ++k) sum[k] = y[j + k];
    for (int i = 0; i < I; ++i)
      for (int k = 0; k < kTile; ++k) sum[k] += x[i] * w[i * J + j + k];
    for (int k = 0; k < kTile; ++k) y[j + k] = sum[k];
  }
}

// x [I] += d [J] W^T, W [I, J].
template <int I, int J, class Real, class V>
inline void MultiplyTransposed(const V* d, const Real* w, V* x) {
  constexpr int kTile = I < 8 ? I : 8;
  for (int i = 0; i < I; i += kTile) {
    V sum[kTile];
    for (int k = 0; k < kTile; ++k) sum[k] = x[i + k];
    for (int j = 0; j < J; ++j)
      for (int k = 0; k < kTile; ++k) sum[k] += d[j] * w[(i + k) * J + j];
    for (int k = 0; k < kTile; ++k) x[i + k] = sum[k];
  }
}

// total [I, J] += x^T d over the `count` rows of x [count, I] and d [count, J]: a weight's gradient.
template <int I, int J, class V>
inline void Outer(int count, const V* x, const V* d, V* total) {
  constexpr int kRows = I == 3 ? 3 : 2, kColumns = 4;  // 12 or 8 sums: what stays in 16 registers
  for (int i = 0; i < I; i += kRows) {
    for (int j = 0; j < J; j += kColumns) {
      V sum[kRows][kColumns] = {};
      for (int n = 0; n < count; ++n)
        for (int a = 0; a < kRows; ++a)
          for (int b = 0; b < kColumns; ++b) sum[a][b] += x[n * I + i + a] * d[n * J + j + b];
      for (int a = 0; a < kRows; ++a)
        for (int b = 0; b < kColumns; ++b) total[(i + a) * J + j + b] += sum[a][b];
    }
  }
}

// total [J] += the rows of d [count, J].
template <int J, class V>
inline void AddRows(int count, const V* d, V* total) {
  for (int n = 0; n < count; ++n)
    for (int j = 0; j < J; ++j) total[j] += d[n * J + j];
}

}  // namespace mesh_bptt

#endif  // DCLOTH_TRAINING_MESH_BPTT_LANES_H_

// Eight floats side by side, and the points in memory that they are gathered from.
#pragma once
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <vector>

#include "vec.h"

namespace cloth_solver {

constexpr int kLanes = 8;
typedef float Floats __attribute__((vector_size(32)));
typedef int32_t Ints __attribute__((vector_size(32)));

// A point is one load. `w` stays zero, so that it may take part in sums.
struct alignas(16) Point {
  float x, y, z, w;
};
// Where a point lies beyond the first one, in bytes: constraints are solved too often to multiply by its size.
using Offset = uint32_t;
inline Offset OffsetOf(int32_t i) { return static_cast<Offset>(i) * static_cast<Offset>(sizeof(Point)); }
inline Point* PointAt(Point* points, Offset offset) {
  return reinterpret_cast<Point*>(reinterpret_cast<char*>(points) + offset);
}
inline Vec ToVec(const Point& p) { return {p.x, p.y, p.z}; }
inline Point ToPoint(const Vec& v) { return {v.x, v.y, v.z, 0}; }

inline Floats LoadFloats(const float* from) {
  Floats out;
  std::memcpy(&out, from, sizeof(out));
  return out;
}

inline Floats SquareRoot(Floats v) {
  for (int k = 0; k < kLanes; ++k) v[k] = std::sqrt(v[k]);
  return v;
}

// Bit k: lane k of a comparison holds.
inline uint32_t Bits(const Ints& mask) {
#ifdef __AVX__
  return static_cast<uint32_t>(__builtin_ia32_movmskps256(reinterpret_cast<Floats>(mask)));
#else
  uint32_t bits = 0;
  for (int k = 0; k < kLanes; ++k) bits |= static_cast<uint32_t>(mask[k] != 0) << k;
  return bits;
#endif
}

// Calls `found` with the number of each bit that is set, rising.
template <typename Found>
void ForEachBit(uint32_t bits, Found found) {
  for (; bits != 0; bits &= bits - 1) found(__builtin_ctz(bits));
}

// Points `low` and `high` in the two halves of a vector.
inline Floats LoadPair(const Point& low, const Point& high) {
  typedef float Half __attribute__((vector_size(16)));
  Half a, b;
  std::memcpy(&a, &low, sizeof(a));
  std::memcpy(&b, &high, sizeof(b));
  return __builtin_shufflevector(a, b, 0, 1, 2, 3, 4, 5, 6, 7);
}

inline void StorePair(const Floats& pair, Point* low, Point* high) {
  const auto a = __builtin_shufflevector(pair, pair, 0, 1, 2, 3), b = __builtin_shufflevector(pair, pair, 4, 5, 6, 7);
  std::memcpy(low, &a, sizeof(a));
  std::memcpy(high, &b, sizeof(b));
}

// Lane K in all of the lower half, lane K + 4 in all of the upper half: factors of a pair of points.
template <int K>
Floats Spread(const Floats& v) {
  return __builtin_shufflevector(v, v, K, K, K, K, K + 4, K + 4, K + 4, K + 4);
}

// Lane k: the sum of pair k's lower point's coordinates, lane k + 4: its upper one's.
inline Floats SumOfEach(const Floats& p0, const Floats& p1, const Floats& p2, const Floats& p3) {
  const Floats a = __builtin_shufflevector(p0, p1, 0, 8, 1, 9, 4, 12, 5, 13) +
                   __builtin_shufflevector(p0, p1, 2, 10, 3, 11, 6, 14, 7, 15);
  const Floats b = __builtin_shufflevector(p2, p3, 0, 8, 1, 9, 4, 12, 5, 13) +
                   __builtin_shufflevector(p2, p3, 2, 10, 3, 11, 6, 14, 7, 15);
  return __builtin_shufflevector(a, b, 0, 1, 8, 9, 4, 5, 12, 13) +
         __builtin_shufflevector(a, b, 2, 3, 10, 11, 6, 7, 14, 15);
}

// Eight vectors, a coordinate each in one row of lanes.
struct Vecs {
  Floats x, y, z;
};
inline Vecs operator+(const Vecs& a, const Vecs& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vecs operator-(const Vecs& a, const Vecs& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Vecs operator-(const Vecs& a, const Vec& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Vecs operator*(const Floats& s, const Vecs& a) { return {s * a.x, s * a.y, s * a.z}; }
inline Vecs operator*(float s, const Vecs& a) { return {s * a.x, s * a.y, s * a.z}; }
inline Vecs operator*(const Vecs& a, float s) { return s * a; }
inline Floats Dot(const Vecs& a, const Vecs& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vecs Cross(const Vecs& a, const Vecs& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline Vecs Select(const Ints& mask, const Vecs& a, const Vecs& b) {
  return {mask ? a.x : b.x, mask ? a.y : b.y, mask ? a.z : b.z};
}

// `of(k)` is the point of lane k.
template <typename Of>
__attribute__((always_inline)) inline Vecs Gather(Of of) {
  const Floats p0 = LoadPair(of(0), of(4)), p1 = LoadPair(of(1), of(5)), p2 = LoadPair(of(2), of(6)),
               p3 = LoadPair(of(3), of(7));
  const Floats xy01 = __builtin_shufflevector(p0, p1, 0, 8, 1, 9, 4, 12, 5, 13),
               xy23 = __builtin_shufflevector(p2, p3, 0, 8, 1, 9, 4, 12, 5, 13),
               z01 = __builtin_shufflevector(p0, p1, 2, 10, 3, 11, 6, 14, 7, 15),
               z23 = __builtin_shufflevector(p2, p3, 2, 10, 3, 11, 6, 14, 7, 15);
  return {__builtin_shufflevector(xy01, xy23, 0, 1, 8, 9, 4, 5, 12, 13),
          __builtin_shufflevector(xy01, xy23, 2, 3, 10, 11, 6, 7, 14, 15),
          __builtin_shufflevector(z01, z23, 0, 1, 8, 9, 4, 5, 12, 13)};
}
inline Vecs Gather(const std::vector<Point>& from, const std::array<int32_t, kLanes>& at) {
  const Point* const points = from.data();
  return Gather([&](int k) -> const Point& { return points[at[k]]; });
}
inline Vecs Load(const Point* from) {
  return Gather([from](int k) -> const Point& { return from[k]; });
}

inline void Store(const Vecs& v, Point* to) {
  const Floats zero = {};
  const Floats xy_low = __builtin_shufflevector(v.x, v.y, 0, 8, 1, 9, 4, 12, 5, 13),
               xy_high = __builtin_shufflevector(v.x, v.y, 2, 10, 3, 11, 6, 14, 7, 15),
               z_low = __builtin_shufflevector(v.z, zero, 0, 8, 1, 9, 4, 12, 5, 13),
               z_high = __builtin_shufflevector(v.z, zero, 2, 10, 3, 11, 6, 14, 7, 15);
  StorePair(__builtin_shufflevector(xy_low, z_low, 0, 1, 8, 9, 4, 5, 12, 13), to, to + 4);
  StorePair(__builtin_shufflevector(xy_low, z_low, 2, 3, 10, 11, 6, 7, 14, 15), to + 1, to + 5);
  StorePair(__builtin_shufflevector(xy_high, z_high, 0, 1, 8, 9, 4, 5, 12, 13), to + 2, to + 6);
  StorePair(__builtin_shufflevector(xy_high, z_high, 2, 3, 10, 11, 6, 7, 14, 15), to + 3, to + 7);
}

}  // namespace cloth_solver

// Three floats and what the solver does with them.
#pragma once
#include <cmath>

namespace cloth_solver {

struct Vec {
  float x = 0, y = 0, z = 0;
  Vec& operator+=(const Vec& b) { x += b.x, y += b.y, z += b.z; return *this; }
  Vec& operator-=(const Vec& b) { x -= b.x, y -= b.y, z -= b.z; return *this; }
};
inline Vec operator+(Vec a, const Vec& b) { return a += b; }
inline Vec operator-(Vec a, const Vec& b) { return a -= b; }
inline Vec operator*(float s, const Vec& a) { return {s * a.x, s * a.y, s * a.z}; }
inline float Dot(const Vec& a, const Vec& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vec Cross(const Vec& a, const Vec& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline float Length(const Vec& a) { return std::sqrt(Dot(a, a)); }
inline Vec Unit(const Vec& a) {
  const float length = Length(a);
  return length > 1e-12f ? (1 / length) * a : Vec{};
}
inline Vec Mix(const Vec& a, const Vec& b, float t) { return a + t * (b - a); }

}  // namespace cloth_solver

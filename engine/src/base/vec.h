// Points and directions: in float, and in double for searches that floats would round to another face.
#ifndef DCLOTH_ENGINE_SRC_BASE_VEC_H_
#define DCLOTH_ENGINE_SRC_BASE_VEC_H_

namespace dcloth::engine {

template <typename T>
struct Vec3 {
  T x, y, z;

  friend Vec3 operator-(Vec3 a, Vec3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
  friend Vec3 operator+(Vec3 a, Vec3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
  friend Vec3 operator*(T s, Vec3 a) { return {s * a.x, s * a.y, s * a.z}; }
  friend T Dot(Vec3 a, Vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
  friend Vec3 Cross(Vec3 a, Vec3 b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
};
using Vec = Vec3<double>;
using Vecf = Vec3<float>;

inline Vec VecAt(const float* p) {
  return {static_cast<double>(p[0]), static_cast<double>(p[1]), static_cast<double>(p[2])};
}
inline Vecf VecfAt(const float* p) { return {p[0], p[1], p[2]}; }
inline void Store(Vecf v, float* p) { p[0] = v.x, p[1] = v.y, p[2] = v.z; }

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_BASE_VEC_H_

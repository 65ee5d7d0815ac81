// Points and directions in double: of searches that floats would round to another face.
#ifndef DCLOTH_ENGINE_SRC_BODY_VEC_H_
#define DCLOTH_ENGINE_SRC_BODY_VEC_H_

namespace dcloth::engine {

struct Vec {
  double x, y, z;
};
inline Vec operator-(Vec a, Vec b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Vec operator+(Vec a, Vec b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vec operator*(double s, Vec a) { return {s * a.x, s * a.y, s * a.z}; }
inline double Dot(Vec a, Vec b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vec Cross(Vec a, Vec b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
inline Vec VecAt(const float* p) {
  return {static_cast<double>(p[0]), static_cast<double>(p[1]), static_cast<double>(p[2])};
}

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_BODY_VEC_H_

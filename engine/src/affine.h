// Affine matrices in double, three rows of four: a frame has a few dozen of them, and precision here is what keeps a
// character sharp far from the origin.
#ifndef DCLOTH_ENGINE_SRC_AFFINE_H_
#define DCLOTH_ENGINE_SRC_AFFINE_H_

namespace dcloth::engine {

struct Affine {
  double m[3][4];
};

inline Affine operator*(const Affine& a, const Affine& b) {
  Affine product;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 4; ++c) {
      product.m[r][c] =
          a.m[r][0] * b.m[0][c] + a.m[r][1] * b.m[1][c] + a.m[r][2] * b.m[2][c] + (c == 3 ? a.m[r][3] : 0.0);
    }
  }
  return product;
}

inline void StoreFloats(const Affine& a, float* rows) {
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 4; ++c) rows[4 * r + c] = static_cast<float>(a.m[r][c]);
  }
}

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_AFFINE_H_

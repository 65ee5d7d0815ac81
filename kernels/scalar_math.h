// Square root for the scalar references, without libm (a compiler may call sqrtf for errno's sake).
#ifndef DCLOTH_KERNELS_SCALAR_MATH_H_
#define DCLOTH_KERNELS_SCALAR_MATH_H_

#include <cstdint>
#include <cstring>

namespace dcloth::kernels::scalar {

// For finite x >= 0. The exponent is halved for a start within 3.5 %; four Newton steps in double square the error each
// time, to below 1e-15, so the result is the nearest float.
inline float SquareRoot(float x) {
  if (!(x > 0.0f)) return 0.0f;
  const double value = x;
  uint64_t bits;
  std::memcpy(&bits, &value, sizeof(bits));
  bits = (bits >> 1) + (uint64_t{0x1FF7A3BEA91D9B1B});
  double root;
  std::memcpy(&root, &bits, sizeof(root));
  for (int step = 0; step < 4; ++step) root = 0.5 * (root + value / root);
  return static_cast<float>(root);
}

}  // namespace dcloth::kernels::scalar

#endif  // DCLOTH_KERNELS_SCALAR_MATH_H_

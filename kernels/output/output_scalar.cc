#include "kernels/half.h"
#include "kernels/kernels.h"
#include "kernels/output/tangents.h"
#include "kernels/scalar_math.h"

namespace dcloth::kernels::scalar {

void Move(const MoveJob& job) {
  float low[3] = {kEmptyBound, kEmptyBound, kEmptyBound}, high[3] = {-kEmptyBound, -kEmptyBound, -kEmptyBound};
  for (size_t i = 0; i < job.vertices; ++i) {
    float* position = StridedAt(job.positions, job.stride_bytes, i);
    for (size_t c = 0; c < 3; ++c) {
      const float moved = position[c] + job.origin[c];
      position[c] = moved;
      low[c] = moved < low[c] ? moved : low[c];
      high[c] = moved > high[c] ? moved : high[c];
    }
  }
  for (size_t c = 0; c < 3 && job.bounds != nullptr; ++c) {
    job.bounds[c] = low[c];
    job.bounds[3 + c] = high[c];
  }
}

void StoreHalf(const StoreHalfJob& job) {
  for (size_t i = 0; i < job.vertices; ++i) {
    uint16_t* to = StridedAt(job.to, job.stride_bytes, i);
    for (size_t e = 0; e < job.elements; ++e) to[e] = HalfFromFloat(job.from[job.elements * i + e]);
  }
}

void Tangents(const TangentsJob& job) {
  ComputeTangents(job, [](float square) { return SquareRoot(square); });
}

}  // namespace dcloth::kernels::scalar

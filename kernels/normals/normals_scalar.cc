#include "kernels/kernels.h"
#include "kernels/normals/normals_accumulate.h"
#include "kernels/scalar_math.h"

namespace dcloth::kernels::scalar {

void Normals(const NormalsJob& job) {
  AccumulateNormals(job);
  for (size_t i = 0; i < job.vertices; ++i) {
    float* n = NormalAt(job, i);
    const float squared = n[0] * n[0] + n[1] * n[1] + n[2] * n[2];
    if (squared >= kNormalsTiny && squared <= kNormalsHuge) {
      const float inverse = 1.0f / SquareRoot(squared);
      n[0] *= inverse;
      n[1] *= inverse;
      n[2] *= inverse;
    } else {
      n[0] = n[2] = 0.0f;
      n[1] = 1.0f;
    }
  }
}

}  // namespace dcloth::kernels::scalar

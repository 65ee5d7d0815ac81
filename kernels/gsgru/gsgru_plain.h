// What the two scalar references of the layer share: everything but the products of its wide matrices.
#ifndef DCLOTH_KERNELS_GSGRU_GSGRU_PLAIN_H_
#define DCLOTH_KERNELS_GSGRU_GSGRU_PLAIN_H_

#include "kernels/gsgru/gsgru_i8.h"

namespace dcloth::kernels::scalar {

// mean[0..input_width) over the vertex's neighbours.
void GsgruMean(const GsgruJob& job, size_t vertex, float* mean);

// y[0..columns) += x W, W flat [rows, columns].
void GsgruAddProduct(const float* x, size_t rows, const float* weights, size_t columns, float* y);

// LayerNorm and PReLU of o in place, then next x or s of the vertex.
void GsgruFinish(const GsgruJob& job, size_t vertex, float* o);

// o of one vertex from its h'.
void GsgruI8Output(const GsgruI8Job& job, const float* h, float* o);

}  // namespace dcloth::kernels::scalar

#endif  // DCLOTH_KERNELS_GSGRU_GSGRU_PLAIN_H_

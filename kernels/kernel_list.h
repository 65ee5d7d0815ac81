// Every kernel, once: the table, the scalar reference, each instruction set, the tests and the benches include this
// list, so a kernel cannot be added to one of them alone. X(Function, table_member); Function's job is `Function##Job`.
#ifndef DCLOTH_KERNELS_KERNEL_LIST_H_
#define DCLOTH_KERNELS_KERNEL_LIST_H_

#include "kernels/gru/gru.h"
#include "kernels/gsgru/gsgru.h"
#include "kernels/gsgru/gsgru_i8.h"
#include "kernels/matvec/matvec.h"
#include "kernels/nearest/nearest.h"
#include "kernels/normals/normals.h"
#include "kernels/output/output.h"
#include "kernels/skinning/skinning.h"

#define DCLOTH_KERNEL_LIST(X)  \
  X(MatvecF32, matvec_f32)     \
  X(MatvecF16, matvec_f16)     \
  X(MatvecI8, matvec_i8)       \
  X(MatmulI8, matmul_i8)       \
  X(QuantizeI16, quantize_i16) \
  X(GruGates, gru_gates)       \
  X(Gsgru, gsgru)              \
  X(GsgruI8, gsgru_i8)         \
  X(Skinning, skinning)        \
  X(Normals, normals)          \
  X(Nearest, nearest)          \
  X(Tangents, tangents)        \
  X(Move, move)                \
  X(StoreHalf, store_half)

// Declares every kernel inside the current namespace.
#define DCLOTH_DECLARE_KERNEL(Function, member) void Function(const Function##Job& job);

#endif  // DCLOTH_KERNELS_KERNEL_LIST_H_

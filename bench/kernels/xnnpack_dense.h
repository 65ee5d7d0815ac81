// XNNPACK's f32 fully-connected operator as a peer of the dense kernels, on the calling thread.
//
// What it asks of its host is counted too, because an engine has to promise it on: XNNPACK is set up once for the
// process, and every operator keeps a packed copy of its weights in memory that it allocates.
#ifndef DCLOTH_BENCH_KERNELS_XNNPACK_DENSE_H_
#define DCLOTH_BENCH_KERNELS_XNNPACK_DENSE_H_

#include <cstddef>
#include <memory>

namespace dcloth::kernels {

// What all operators together have asked for since the program began.
struct XnnpackMemory {
  size_t allocations;
  size_t bytes;
  size_t allocations_in_runs;  // of `allocations`
};

class XnnpackDense {
 public:
  // y = x W with W row-major [rows, columns], x [batch, rows], y [batch, columns]. x and y stay the caller's. Throws
  // std::runtime_error where XNNPACK refuses.
  XnnpackDense(const float* matrix, size_t rows, size_t columns, size_t batch, const float* x, float* y);
  ~XnnpackDense();
  XnnpackDense(XnnpackDense&&) noexcept;

  void Run() const;

  static XnnpackMemory Memory();

 private:
  struct Operator;
  std::unique_ptr<Operator> operator_;
};

}  // namespace dcloth::kernels

#endif  // DCLOTH_BENCH_KERNELS_XNNPACK_DENSE_H_

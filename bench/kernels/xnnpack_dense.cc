#include "bench/kernels/xnnpack_dense.h"

#include <xnnpack.h>

#include <cstdlib>
#include <limits>
#include <stdexcept>
#include <string>

namespace dcloth::kernels {
namespace {

XnnpackMemory memory;

void* Count(void* block, size_t bytes) {
  ++memory.allocations;
  memory.bytes += bytes;
  return block;
}

void* Allocate(void*, size_t bytes) { return Count(std::malloc(bytes), bytes); }
void* Reallocate(void*, void* block, size_t bytes) { return Count(std::realloc(block, bytes), bytes); }
void Free(void*, void* block) { std::free(block); }
void* AllocateAligned(void*, size_t alignment, size_t bytes) {
  return Count(std::aligned_alloc(alignment, (bytes + alignment - 1) / alignment * alignment), bytes);
}

void Check(xnn_status status, const char* what) {
  if (status == xnn_status_success) return;
  throw std::runtime_error(std::string("XNNPACK: ") + what + " failed with status " + std::to_string(status));
}

void InitializeOnce() {
  static const xnn_allocator allocator = {nullptr, Allocate, Reallocate, Free, AllocateAligned, Free};
  static const xnn_status status = xnn_initialize(&allocator);
  Check(status, "xnn_initialize");
}

}  // namespace

struct XnnpackDense::Operator {
  xnn_operator_t handle = nullptr;
  ~Operator() { xnn_delete_operator(handle); }
};

XnnpackDense::XnnpackDense(const float* matrix, size_t rows, size_t columns, size_t batch, const float* x, float* y)
    : operator_(std::make_unique<Operator>()) {
  InitializeOnce();
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  Check(xnn_create_fully_connected_nc_f32(rows, columns, rows, columns, matrix, nullptr, -kInfinity, kInfinity,
                                          XNN_FLAG_TRANSPOSE_WEIGHTS, &operator_->handle),
        "xnn_create_fully_connected_nc_f32");
  Check(xnn_setup_fully_connected_nc_f32(operator_->handle, batch, x, y, /*threadpool=*/nullptr),
        "xnn_setup_fully_connected_nc_f32");
}

XnnpackDense::~XnnpackDense() = default;
XnnpackDense::XnnpackDense(XnnpackDense&&) noexcept = default;

void XnnpackDense::Run() const {
  const size_t before = memory.allocations;
  Check(xnn_run_operator(operator_->handle, /*threadpool=*/nullptr), "xnn_run_operator");
  memory.allocations_in_runs += memory.allocations - before;
}

XnnpackMemory XnnpackDense::Memory() { return memory; }

}  // namespace dcloth::kernels

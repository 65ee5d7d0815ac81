#include "engine/src/isa.h"

#include <atomic>

namespace dcloth::engine {
namespace {

// Null until asked for, so that nothing runs before main. Every thread that finds null stores the same pointer.
std::atomic<const kernels::KernelTable*> active_kernels{nullptr};

}  // namespace

const kernels::KernelTable& ActiveKernels() {
  const kernels::KernelTable* table = active_kernels.load(std::memory_order_relaxed);
  if (table == nullptr) {
    table = kernels::BestKernels();
    active_kernels.store(table, std::memory_order_relaxed);
  }
  return *table;
}

bool SelectKernels(const char* name) {
  const kernels::KernelTable* table = name == nullptr ? kernels::BestKernels() : kernels::FindKernels(name);
  if (table == nullptr) return false;
  active_kernels.store(table, std::memory_order_relaxed);
  return true;
}

}  // namespace dcloth::engine

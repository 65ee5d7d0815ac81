#include "engine/src/base/arithmetic.h"

#include <atomic>

namespace dcloth::engine {
namespace {

// Null until asked for, so that nothing runs before main.
std::atomic<const kernels::KernelTable*> active_kernels{nullptr};

}  // namespace

const kernels::KernelTable& ActiveKernels() {
  const kernels::KernelTable* table = active_kernels.load(std::memory_order_relaxed);
  if (table == nullptr) {
    // What another thread has put there meanwhile stays: it may be the host's choice.
    const kernels::KernelTable* const best = kernels::BestKernels();
    if (active_kernels.compare_exchange_strong(table, best, std::memory_order_relaxed)) table = best;
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

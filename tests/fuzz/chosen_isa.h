// The instruction set that an input runs on: each of those that this CPU has gets its share, scalar too.
#ifndef DCLOTH_TESTS_FUZZ_CHOSEN_ISA_H_
#define DCLOTH_TESTS_FUZZ_CHOSEN_ISA_H_

#include <cstdint>

#include "dcloth/dcloth.h"
#include "kernels/kernels.h"

namespace dcloth::testing {

// While it lives; 0 is the CPU's best.
class ChosenIsa {
 public:
  explicit ChosenIsa(uint64_t choice) {
    (void)dcloth_isa_select(kernels::KernelTableAt(choice % kernels::KernelTableCount())->name);
  }
  ~ChosenIsa() { (void)dcloth_isa_select(nullptr); }
  ChosenIsa(const ChosenIsa&) = delete;
  ChosenIsa& operator=(const ChosenIsa&) = delete;
};

}  // namespace dcloth::testing

#endif  // DCLOTH_TESTS_FUZZ_CHOSEN_ISA_H_

// Counts every allocation of the process while it lives: malloc and its kin are replaced in allocation_trap.cc.
#ifndef DCLOTH_TESTS_UNIT_ENGINE_ALLOCATION_TRAP_H_
#define DCLOTH_TESTS_UNIT_ENGINE_ALLOCATION_TRAP_H_

#include <cstddef>

namespace dcloth::testing {

class AllocationTrap {
 public:
  AllocationTrap();
  ~AllocationTrap();
  AllocationTrap(const AllocationTrap&) = delete;
  AllocationTrap& operator=(const AllocationTrap&) = delete;

  size_t count() const;
};

}  // namespace dcloth::testing

#endif  // DCLOTH_TESTS_UNIT_ENGINE_ALLOCATION_TRAP_H_

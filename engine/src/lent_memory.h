// Memory that the host lends: what it must be before anything is placed in it.
#ifndef DCLOTH_ENGINE_SRC_LENT_MEMORY_H_
#define DCLOTH_ENGINE_SRC_LENT_MEMORY_H_

#include <cstddef>
#include <cstdint>

#include "dcloth/dcloth.h"
#include "engine/format/diagnostic.h"

namespace dcloth::engine {

inline bool CheckStorage(const void* storage, size_t size, size_t needed, format::Diagnostic* diagnostic) {
  if (storage == nullptr) {
    return diagnostic->Fail(DCLOTH_ERROR_ARGUMENT, format::kNoOffset, nullptr, "null storage", "memory of the host",
                            "");
  }
  if (reinterpret_cast<uintptr_t>(storage) % DCLOTH_ALIGNMENT != 0) {
    return diagnostic->Fail(DCLOTH_ERROR_ALIGNMENT, format::kNoOffset, nullptr, "storage off a 64-byte boundary",
                            "addresses divisible by 64", "allocate with an alignment of DCLOTH_ALIGNMENT");
  }
  if (size >= needed) return true;
  char allowed[48];
  format::Text(allowed, sizeof(allowed)).Add("at least ").Add(uint64_t{needed});
  return diagnostic->FailCount(DCLOTH_ERROR_MEMORY, format::kNoOffset, nullptr, size, " bytes of storage", allowed,
                               "lend what the storage_size function asks for");
}

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_LENT_MEMORY_H_

// Memory that the host lends: what it must be, and how it is handed out.
#ifndef DCLOTH_ENGINE_SRC_BASE_LENT_MEMORY_H_
#define DCLOTH_ENGINE_SRC_BASE_LENT_MEMORY_H_

#include <cstddef>
#include <cstdint>

#include "dcloth/dcloth.h"
#include "engine/format/diagnostic.h"

#if defined(DCLOTH_ARENA_RED_ZONES)
#include <sanitizer/asan_interface.h>
#endif

namespace dcloth::engine {

// With DCLOTH_ARENA_RED_ZONES (scripts/build_sanitized.sh) each piece of lent memory ends in bytes that
// AddressSanitizer stops at: else it sees one block, in which pieces may run into each other.
#if defined(DCLOTH_ARENA_RED_ZONES)
constexpr size_t kRedZoneBytes = 64;
inline void Forbid(const void* bytes, size_t size) { __asan_poison_memory_region(bytes, size); }
inline void Allow(const void* bytes, size_t size) { __asan_unpoison_memory_region(bytes, size); }
#else
constexpr size_t kRedZoneBytes = 0;
inline void Forbid(const void*, size_t) {}
inline void Allow(const void*, size_t) {}
#endif

inline bool CheckStorage(const void* storage, size_t size, size_t needed, format::Diagnostic* diagnostic) {
  if (storage == nullptr) {
    return diagnostic->Fail(DCLOTH_ERROR_ARGUMENT, format::kNoOffset, nullptr, "a null pointer", "a pointer to storage",
                            "lend as many bytes as the storage_size function returns");
  }
  if (reinterpret_cast<uintptr_t>(storage) % DCLOTH_ALIGNMENT != 0) {
    return diagnostic->Fail(DCLOTH_ERROR_ALIGNMENT, format::kNoOffset, nullptr,
                            "storage that is not aligned to 64 bytes", "an address divisible by 64",
                            "allocate with an alignment of DCLOTH_ALIGNMENT");
  }
  if (size >= needed) {
    Allow(storage, size);
    return true;
  }
  char allowed[48];
  format::Text(allowed, sizeof(allowed)).Add("at least ").Add(uint64_t{needed});
  return diagnostic->FailCount(DCLOTH_ERROR_MEMORY, format::kNoOffset, nullptr, size, " bytes of storage", allowed,
                               "lend as many bytes as the storage_size function returns");
}

// Hands out consecutive 64-byte-aligned pieces of one block. Over a null block it only adds sizes up, so the function
// that places an instance is also the one that computes its size: the two cannot disagree.
class Arena {
 public:
  explicit Arena(void* block) : block_(static_cast<uint8_t*>(block)) {}

  // Null while only counting. Counts come from a verified model, whose limits keep the sum below 2^31.
  template <typename T>
  T* Take(size_t count) {
    static_assert(alignof(T) <= kAlignment);
    uint8_t* piece = block_ == nullptr ? nullptr : block_ + size_;
    const size_t bytes = count * sizeof(T), taken = (bytes + kAlignment - 1) / kAlignment * kAlignment + kRedZoneBytes;
    size_ += taken;
    if (piece != nullptr) Forbid(piece + bytes, taken - bytes);
    return reinterpret_cast<T*>(piece);
  }

  size_t size() const { return size_; }

 private:
  static constexpr size_t kAlignment = 64;

  uint8_t* block_;
  size_t size_ = 0;
};

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_BASE_LENT_MEMORY_H_

// Hands out consecutive 64-byte-aligned pieces of one block. Over a null block it only adds sizes up, so the function
// that places an instance is also the one that computes its size: the two cannot disagree.
#ifndef DCLOTH_ENGINE_SRC_ARENA_H_
#define DCLOTH_ENGINE_SRC_ARENA_H_

#include <cstddef>
#include <cstdint>

namespace dcloth::engine {

class Arena {
 public:
  explicit Arena(void* block) : block_(static_cast<uint8_t*>(block)) {}

  // Null while only counting. Counts come from a verified model, whose limits keep the sum below 2^31.
  template <typename T>
  T* Take(size_t count) {
    static_assert(alignof(T) <= kAlignment);
    uint8_t* piece = block_ == nullptr ? nullptr : block_ + size_;
    size_ += (count * sizeof(T) + kAlignment - 1) / kAlignment * kAlignment;
    return reinterpret_cast<T*>(piece);
  }

  size_t size() const { return size_; }

 private:
  static constexpr size_t kAlignment = 64;

  uint8_t* block_;
  size_t size_ = 0;
};

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_ARENA_H_

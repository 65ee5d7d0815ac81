// A heap block of exactly the asked size on a 64-byte boundary, so that AddressSanitizer sees the first byte past it.
#ifndef DCLOTH_TESTS_UNIT_ENGINE_ALIGNED_BYTES_H_
#define DCLOTH_TESTS_UNIT_ENGINE_ALIGNED_BYTES_H_

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <new>
#include <utility>

#if defined(_WIN32)
#include <malloc.h>
#endif

namespace dcloth {

class AlignedBytes {
 public:
  static constexpr uint8_t kPoison = 0xFF;  // of floats NaN: what reads before it writes shows

  explicit AlignedBytes(size_t size = 0) : size_(size) {
    data_ = static_cast<uint8_t*>(Allocate(size));
    if (size != 0) std::memset(data_, kPoison, size);
  }
  AlignedBytes(const void* bytes, size_t size) : AlignedBytes(size) {
    if (size != 0) std::memcpy(data_, bytes, size);
  }
  AlignedBytes(const AlignedBytes& other) : AlignedBytes(other.data_, other.size_) {}
  AlignedBytes(AlignedBytes&& other) noexcept
      : data_(std::exchange(other.data_, nullptr)), size_(std::exchange(other.size_, 0)) {}
  AlignedBytes& operator=(AlignedBytes other) noexcept {
    std::swap(data_, other.data_);
    std::swap(size_, other.size_);
    return *this;
  }
  ~AlignedBytes() { Free(data_); }

  uint8_t* data() { return data_; }
  const uint8_t* data() const { return data_; }
  size_t size() const { return size_; }

 private:
#if defined(_WIN32)
  static void* Allocate(size_t size) {
    void* const data = _aligned_malloc(size == 0 ? 1 : size, 64);
    if (data == nullptr) throw std::bad_alloc();
    return data;
  }
  static void Free(void* data) { _aligned_free(data); }
#else
  static void* Allocate(size_t size) {
    void* data = nullptr;
    if (posix_memalign(&data, 64, size) != 0) throw std::bad_alloc();
    return data;
  }
  static void Free(void* data) { std::free(data); }
#endif

  uint8_t* data_;
  size_t size_;
};

}  // namespace dcloth

#endif  // DCLOTH_TESTS_UNIT_ENGINE_ALIGNED_BYTES_H_

// Memory between two inaccessible pages, to catch reads and writes outside an array that sanitizers cannot see in
// vector code of another translation unit.
#ifndef DCLOTH_TESTS_UNIT_KERNELS_GUARDED_BUFFER_H_
#define DCLOTH_TESTS_UNIT_KERNELS_GUARDED_BUFFER_H_

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <type_traits>
#include <vector>

#include "tests/unit/kernels/pages.h"

namespace dcloth::kernels {

enum class Place {
  kEnd,        // the last element touches the guard page; aligned to the element only
  kAligned64,  // starts on 64 bytes, as close to the guard page as that allows
  kStart,      // the first element touches the guard page before it
};

// Floats start as NaN and other bytes as 0xCD, so that a missing write and an unwanted read both show.
template <typename T>
class GuardedBuffer {
 public:
  explicit GuardedBuffer(size_t count, Place place = Place::kEnd) : count_(count) {
    const size_t page = PageBytes();
    const size_t body = (count * sizeof(T) + 63 + page) / page * page;
    mapped_ = body + 2 * page;
    base_ = static_cast<uint8_t*>(AllocatePages(mapped_));
    body_ = base_ + page;
    end_ = body_ + body;
    std::memset(body_, kCanary, body);
    uint8_t* start = end_ - count * sizeof(T);
    if (place == Place::kAligned64) start -= reinterpret_cast<uintptr_t>(start) % 64;
    if (place == Place::kStart) start = body_;
    data_ = reinterpret_cast<T*>(start);
    Poison();
    ProtectPages(base_, page, Access::kNone);
    ProtectPages(end_, page, Access::kNone);
  }
  GuardedBuffer(const std::vector<T>& values, Place place = Place::kEnd) : GuardedBuffer(values.size(), place) {
    std::copy(values.begin(), values.end(), data_);
  }
  GuardedBuffer(const GuardedBuffer&) = delete;
  GuardedBuffer& operator=(const GuardedBuffer&) = delete;
  ~GuardedBuffer() { FreePages(base_, mapped_); }

  T* data() { return data_; }
  const T* data() const { return data_; }
  size_t size() const { return count_; }
  T& operator[](size_t i) { return data_[i]; }
  const T& operator[](size_t i) const { return data_[i]; }

  void Poison() {
    if constexpr (std::is_floating_point_v<T>) {
      std::fill_n(data_, count_, std::numeric_limits<T>::quiet_NaN());
    } else {
      std::memset(data_, kCanary, count_ * sizeof(T));
    }
  }

  // From now on writing faults like leaving the array does.
  void MakeReadOnly() { ProtectPages(body_, static_cast<size_t>(end_ - body_), Access::kRead); }

  // Whether the bytes between the array and the guard pages are as they were.
  bool SlackUntouched() const {
    const auto* first = reinterpret_cast<const uint8_t*>(data_);
    const auto is_canary = [](uint8_t byte) { return byte == kCanary; };
    return std::all_of(const_cast<const uint8_t*>(body_), first, is_canary) &&
           std::all_of(first + count_ * sizeof(T), const_cast<const uint8_t*>(end_), is_canary);
  }

 private:
  static constexpr uint8_t kCanary = 0xCD;
  size_t count_;
  size_t mapped_;
  uint8_t* base_;
  uint8_t* body_;
  uint8_t* end_;
  T* data_;
};

}  // namespace dcloth::kernels

#endif  // DCLOTH_TESTS_UNIT_KERNELS_GUARDED_BUFFER_H_

// What the engine computes with: the kernels that the process runs, and the floating-point environment they run in.
//
// The host's environment is set aside while the engine computes: rounding mode, subnormals
// flushed or not, exceptions that trap, flags that stick. Inside, everything is as IEEE 754 starts out, so a
// model opens and a garment moves to the same bits whatever the host has set, and a NaN in a file cannot stop
// a host that traps on NaN. Afterwards every bit is the host's again, flags included.
//
// Ticks and frames moreover take subnormals for zero, but for the "reproducible" kernels: a processor that needs
// 100 cycles for one would let a file of 22 MB keep a thread for 30 seconds a tick, and a unit that the trainer
// let die slow down all others. They are below 1.2e-38 of whatever is summed.
//
// One read and two writes of a control register: 0.14 us a call on a busy Zen 3, 7e-5 of an int8 tick of the
// skirt. Rejected: to work in the host's environment under an error bound. Rounding upwards breaks the proof
// that no int8 product overflows (kernels/matvec/quantize.h), and a trap that the host has armed would end
// its process.
#ifndef DCLOTH_ENGINE_SRC_BASE_ARITHMETIC_H_
#define DCLOTH_ENGINE_SRC_BASE_ARITHMETIC_H_

#include <cstdint>

#include "kernels/kernels.h"

#if defined(_MSC_VER) && !defined(__clang__) && (defined(_M_X64) || defined(_M_IX86))
#include <xmmintrin.h>
#elif defined(_MSC_VER) && !defined(__clang__) && defined(_M_ARM64)
#include <intrin.h>
#endif

namespace dcloth::engine {

enum class Subnormals { kCount, kAreZero };

class FloatEnvironment {
 public:
  explicit FloatEnvironment(Subnormals subnormals = Subnormals::kCount) : host_(Read()) {
    Write(subnormals == Subnormals::kCount ? kDefault : kFlushing);
  }
  ~FloatEnvironment() { Write(host_); }
  FloatEnvironment(const FloatEnvironment&) = delete;
  FloatEnvironment& operator=(const FloatEnvironment&) = delete;

 private:
  // The memory clobbers keep loads and stores, and with them the arithmetic in between, on their side.
#if defined(__SSE__)
  // MXCSR, Intel SDM volume 1, 10.2.3: all exceptions masked, to nearest, no flag set; bits 6 and 15 flush what goes in
  // and what comes out.
  using Word = uint32_t;
  static constexpr Word kDefault = 0x1F80, kFlushing = 0x9FC0;
  static Word Read() {
    Word word;
    __asm__ volatile("stmxcsr %0" : "=m"(word) : : "memory");
    return word;
  }
  static void Write(Word word) { __asm__ volatile("ldmxcsr %0" : : "m"(word) : "memory"); }
#elif defined(_MSC_VER) && !defined(__clang__) && (defined(_M_X64) || defined(_M_IX86))
  using Word = uint32_t;
  static constexpr Word kDefault = 0x1F80, kFlushing = 0x9FC0;
  static Word Read() { return _mm_getcsr(); }
  static void Write(Word word) { _mm_setcsr(word); }
#elif defined(_MSC_VER) && !defined(__clang__) && defined(_M_ARM64)
  // As below, by numbers of registers as MSVC's intrinsics take them. Compiled by nobody here yet.
  struct Word {
    __int64 control, status;
  };
  static constexpr int kControl = 0x5A20, kStatus = 0x5A21;  // S3_3_C4_C4_0 and 1
  static constexpr Word kDefault = {0, 0}, kFlushing = {__int64{1} << 24, 0};
  static Word Read() {
    _ReadWriteBarrier();
    return {_ReadStatusReg(kControl), _ReadStatusReg(kStatus)};
  }
  static void Write(Word word) {
    _ReadWriteBarrier();
    _WriteStatusReg(kControl, word.control);
    _WriteStatusReg(kStatus, word.status);
    _ReadWriteBarrier();
  }
#elif defined(__aarch64__)
  // FPCR and FPSR, Arm ARM C5.2: zero is to nearest, no flushing, no traps, no flag set; bit 24 flushes both ways.
  struct Word {
    uint64_t control, status;
  };
  static constexpr Word kDefault = {0, 0}, kFlushing = {uint64_t{1} << 24, 0};
  static Word Read() {
    Word word;
    __asm__ volatile("mrs %0, fpcr\n\tmrs %1, fpsr" : "=r"(word.control), "=r"(word.status) : : "memory");
    return word;
  }
  static void Write(Word word) {
    __asm__ volatile("msr fpcr, %0\n\tmsr fpsr, %1" : : "r"(word.control), "r"(word.status) : "memory");
  }
#else
  // WebAssembly has one environment, this one. On anything else the host's stays.
  using Word = uint32_t;
  static constexpr Word kDefault = 0, kFlushing = 0;
  static Word Read() { return kDefault; }
  static void Write(Word) {}
#endif

  const Word host_;
};

// The kernels that the process runs: the CPU's best unless the host has chosen others.
const kernels::KernelTable& ActiveKernels();

// What those kernels are to compute in.
inline Subnormals ActiveSubnormals() {
  return ActiveKernels().counts_subnormals ? Subnormals::kCount : Subnormals::kAreZero;
}

// Null chooses the best. False, and nothing changes, where the CPU or the build lacks `name`.
bool SelectKernels(const char* name);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_BASE_ARITHMETIC_H_

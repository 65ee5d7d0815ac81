#include "tests/unit/engine/allocation_trap.h"

#include <atomic>
#include <cstdlib>
#include <new>

namespace {

std::atomic<bool> armed{false};
std::atomic<size_t> allocations{0};

void Count() {
  if (armed.load(std::memory_order_relaxed)) allocations.fetch_add(1, std::memory_order_relaxed);
}

}  // namespace

#if defined(__has_feature)  // clang's word for it
#if __has_feature(address_sanitizer)
#define DCLOTH_ADDRESS_SANITIZER
#endif
#elif defined(__SANITIZE_ADDRESS__)
#define DCLOTH_ADDRESS_SANITIZER
#endif

#if defined(DCLOTH_ADDRESS_SANITIZER)

// AddressSanitizer owns malloc and tells a hook instead, if its shared library can see it.
extern "C" __attribute__((visibility("default"))) void __sanitizer_malloc_hook(const volatile void*, size_t) {
  Count();
}

#elif defined(_WIN32)

// The linker sends every call of the executable and its static libraries, operator new among them, here first
// (--wrap in CMakeLists.txt). Blocks of _aligned_malloc, which the C library exports by pointer, pass unseen.
extern "C" {
void* __real_malloc(size_t size);
void* __real_calloc(size_t count, size_t size);
void* __real_realloc(void* block, size_t size);

void* __wrap_malloc(size_t size) {
  Count();
  return __real_malloc(size);
}
void* __wrap_calloc(size_t count, size_t size) {
  Count();
  return __real_calloc(count, size);
}
void* __wrap_realloc(void* block, size_t size) {
  Count();
  return __real_realloc(block, size);
}
}

#else

// glibc's own names, so that the replaced functions have something to call. operator new goes through malloc, in a
// library that must see these: clang would hide them as it hides the rest.
#pragma GCC visibility push(default)
extern "C" {
void* __libc_malloc(size_t size);
void* __libc_calloc(size_t count, size_t size);
void* __libc_realloc(void* block, size_t size);
void* __libc_memalign(size_t alignment, size_t size);

void* malloc(size_t size) {
  Count();
  return __libc_malloc(size);
}
void* calloc(size_t count, size_t size) {
  Count();
  return __libc_calloc(count, size);
}
void* realloc(void* block, size_t size) {
  Count();
  return __libc_realloc(block, size);
}
void* aligned_alloc(size_t alignment, size_t size) {
  Count();
  return __libc_memalign(alignment, size);
}
int posix_memalign(void** block, size_t alignment, size_t size) {
  Count();
  *block = __libc_memalign(alignment, size);
  return *block == nullptr ? 12 : 0;  // ENOMEM
}
}
#pragma GCC visibility pop

#endif

namespace dcloth::testing {

AllocationTrap::AllocationTrap() {
  allocations = 0;
  armed = true;
}
AllocationTrap::~AllocationTrap() { armed = false; }
size_t AllocationTrap::count() const { return allocations; }

}  // namespace dcloth::testing

// Whole pages of memory and their protection, on POSIX and Windows.
#ifndef DCLOTH_TESTS_UNIT_KERNELS_PAGES_H_
#define DCLOTH_TESTS_UNIT_KERNELS_PAGES_H_

#include <cstddef>
#include <stdexcept>

#if defined(_WIN32)
#ifndef NOMINMAX
#define NOMINMAX
#endif
#ifndef WIN32_LEAN_AND_MEAN
#define WIN32_LEAN_AND_MEAN
#endif
#include <windows.h>
#undef near  // macros of 16-bit days; tests have such names
#undef far
#else
#include <sys/mman.h>
#include <unistd.h>
#endif
#if defined(DCLOTH_ARENA_RED_ZONES)
#include <sanitizer/asan_interface.h>
#endif

namespace dcloth::kernels {

enum class Access { kNone, kRead };

#if defined(_WIN32)
inline size_t PageBytes() {
  SYSTEM_INFO info;
  GetSystemInfo(&info);
  return info.dwPageSize;
}
inline void* AllocatePages(size_t size) {
  void* const pages = VirtualAlloc(nullptr, size, MEM_RESERVE | MEM_COMMIT, PAGE_READWRITE);
  if (pages == nullptr) throw std::runtime_error("VirtualAlloc failed");
  return pages;
}
inline void ProtectPages(void* pages, size_t size, Access access) {
  DWORD before;
  if (!VirtualProtect(pages, size, access == Access::kNone ? PAGE_NOACCESS : PAGE_READONLY, &before)) {
    throw std::runtime_error("VirtualProtect failed");
  }
}
inline void FreePages(void* pages, size_t) { VirtualFree(pages, 0, MEM_RELEASE); }
#else
inline size_t PageBytes() { return static_cast<size_t>(sysconf(_SC_PAGESIZE)); }
inline void* AllocatePages(size_t size) {
  void* const pages = mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (pages == MAP_FAILED) throw std::runtime_error("mmap failed");
#if defined(DCLOTH_ARENA_RED_ZONES)
  __asan_unpoison_memory_region(pages, size);  // the red zones of what lay there before
#endif
  return pages;
}
inline void ProtectPages(void* pages, size_t size, Access access) {
  if (mprotect(pages, size, access == Access::kNone ? PROT_NONE : PROT_READ) != 0) {
    throw std::runtime_error("mprotect failed");
  }
}
inline void FreePages(void* pages, size_t size) { munmap(pages, size); }
#endif

}  // namespace dcloth::kernels

#endif  // DCLOTH_TESTS_UNIT_KERNELS_PAGES_H_

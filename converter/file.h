// Files, whole or not at all. Errors name the path and the system's reason.
#ifndef DCLOTH_CONVERTER_FILE_H_
#define DCLOTH_CONVERTER_FILE_H_

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <new>
#include <span>
#include <vector>

namespace dcloth::converter {

// Allocator for bytes that dcloth_model_open accepts as they are.
template <typename T>
struct ModelAllocator {
  using value_type = T;
  static constexpr std::align_val_t kAlignment{64};
  ModelAllocator() = default;
  template <typename U>
  ModelAllocator(const ModelAllocator<U>&) {}  // NOLINT(google-explicit-constructor): allocators convert
  T* allocate(size_t count) { return static_cast<T*>(::operator new(count * sizeof(T), kAlignment)); }
  void deallocate(T* memory, size_t) { ::operator delete(memory, kAlignment); }
  bool operator==(const ModelAllocator&) const { return true; }
};

// Bytes that start on DCLOTH_ALIGNMENT: model files and lent engine memory.
using AlignedBytes = std::vector<std::byte, ModelAllocator<std::byte>>;

// The whole file in memory. Read, not mapped: a mapped file that somebody shortens kills the process. Pipes and devices
// are refused, as is a file of more than `limit_bytes`. Throws Error.
AlignedBytes ReadFile(const std::filesystem::path& path, uint64_t limit_bytes = uint64_t{16} << 30);

// Creates or replaces `path` with the pieces, one after another: a temporary file in its folder, flushed to the disk,
// then renamed. On failure an existing file is intact and the temporary file is gone. A symbolic link is followed; a
// file without write permission, a directory or a device is refused. Throws Error.
void WriteFileAtomically(const std::filesystem::path& path, std::span<const std::span<const std::byte>> pieces);
void WriteFileAtomically(const std::filesystem::path& path, std::span<const std::byte> bytes);

// The same in two steps, for several files: where each of them is prepared before the first one is put in its place, a
// full disk or a target that cannot be written loses none of the old ones.
class PreparedFile {
 public:
  // Writes the temporary file. Throws Error.
  PreparedFile(const std::filesystem::path& path, std::span<const std::span<const std::byte>> pieces);
  PreparedFile(const std::filesystem::path& path, std::span<const std::byte> bytes);
  PreparedFile(PreparedFile&& other) noexcept;
  PreparedFile& operator=(PreparedFile&&) = delete;
  ~PreparedFile();  // the temporary file is gone

  // Renames it, once. Throws Error.
  void Replace();

 private:
  class Temporary;
  std::unique_ptr<Temporary> temporary_;
};

}  // namespace dcloth::converter

#endif  // DCLOTH_CONVERTER_FILE_H_

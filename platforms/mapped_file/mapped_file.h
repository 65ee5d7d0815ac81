// A whole file as read-only memory: the bytes of a .dcloth file as dcloth_model_open takes them, without a copy. Pages
// are read when they are first touched and shared by every process that maps the file. POSIX (Linux, macOS, iOS,
// Android) and Windows; a host that has its own file system or archive needs none of this.
//
// The file must stay as it is while mapped. Windows refuses to shorten it; elsewhere whoever shortens it makes the next
// touch of a lost page fatal (SIGBUS). So replace a model by renaming a new file over it, as `dcloth convert` does; the
// `dcloth` command line itself reads files whole.
#ifndef DCLOTH_PLATFORMS_MAPPED_FILE_MAPPED_FILE_H_
#define DCLOTH_PLATFORMS_MAPPED_FILE_MAPPED_FILE_H_

#include <cstddef>
#include <filesystem>
#include <system_error>
#include <utility>

namespace dcloth::platforms {

class MappedFile {
 public:
  MappedFile() = default;
  MappedFile(MappedFile&& other) noexcept
      : data_(std::exchange(other.data_, nullptr)), size_(std::exchange(other.size_, 0)) {}
  MappedFile& operator=(MappedFile&& other) noexcept {
    std::swap(data_, other.data_);
    std::swap(size_, other.size_);
    return *this;
  }
  ~MappedFile();

  // Maps `path` and lets go of what was mapped before; on failure that stays as it was.
  // Memory: address space of the file's size; the file itself is closed again.
  // Thread: any, one object on one thread at a time.
  // Errors: the system's; is_a_directory or invalid_argument where `path` is no regular file. An empty file has no
  //         bytes to map and is no error: data() is null.
  // Cost: a few system calls, whatever the size; a page fault for each page at its first use.
  std::error_code Map(const std::filesystem::path& path);

  // On a page boundary (4 KB or more), hence on DCLOTH_ALIGNMENT. Valid until the next Map and the destructor.
  const void* data() const { return data_; }
  size_t size() const { return size_; }  // bytes

 private:
  MappedFile(void* data, size_t size) : data_(data), size_(size) {}

  void* data_ = nullptr;
  size_t size_ = 0;
};

}  // namespace dcloth::platforms

#endif  // DCLOTH_PLATFORMS_MAPPED_FILE_MAPPED_FILE_H_

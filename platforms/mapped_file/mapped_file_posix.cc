#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>

#include "platforms/mapped_file/mapped_file.h"

namespace dcloth::platforms {
namespace {

std::error_code LastError() { return {errno, std::generic_category()}; }

// Closes on every way out; the mapping outlives the descriptor.
struct Descriptor {
  int number;
  ~Descriptor() {
    if (number >= 0) ::close(number);
  }
};

}  // namespace

MappedFile::~MappedFile() {
  if (data_ != nullptr) ::munmap(data_, size_);
}

std::error_code MappedFile::Map(const std::filesystem::path& path) {
  // Not to wait for the other end of a pipe.
  const Descriptor file{::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK)};
  if (file.number < 0) return LastError();
  struct stat status;
  if (::fstat(file.number, &status) != 0) return LastError();
  if (S_ISDIR(status.st_mode)) return make_error_code(std::errc::is_a_directory);
  if (!S_ISREG(status.st_mode)) return make_error_code(std::errc::invalid_argument);
  if (static_cast<uintmax_t>(status.st_size) > SIZE_MAX) return make_error_code(std::errc::file_too_large);
  const size_t size = static_cast<size_t>(status.st_size);
  void* data = nullptr;
  if (size != 0) {
    data = ::mmap(nullptr, size, PROT_READ, MAP_PRIVATE, file.number, 0);
    if (data == MAP_FAILED) return LastError();
  }
  MappedFile mapped(data, size);
  *this = std::move(mapped);
  return {};
}

}  // namespace dcloth::platforms

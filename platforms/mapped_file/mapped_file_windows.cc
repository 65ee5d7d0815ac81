#include "platforms/mapped_file/mapped_file.h"

#ifndef NOMINMAX
#define NOMINMAX
#endif
#ifndef WIN32_LEAN_AND_MEAN
#define WIN32_LEAN_AND_MEAN
#endif
#include <windows.h>

#include <cstdint>

namespace dcloth::platforms {
namespace {

std::error_code LastError() { return {static_cast<int>(GetLastError()), std::system_category()}; }

// Closes on every way out; a view outlives both the file's handle and the mapping's.
struct Handle {
  HANDLE value;
  ~Handle() {
    if (value != nullptr && value != INVALID_HANDLE_VALUE) CloseHandle(value);
  }
};

}  // namespace

MappedFile::~MappedFile() {
  if (data_ != nullptr) UnmapViewOfFile(data_);
}

std::error_code MappedFile::Map(const std::filesystem::path& path) {
  const DWORD attributes = GetFileAttributesW(path.c_str());
  if (attributes == INVALID_FILE_ATTRIBUTES) return LastError();
  if ((attributes & FILE_ATTRIBUTE_DIRECTORY) != 0) return make_error_code(std::errc::is_a_directory);
  const Handle file{CreateFileW(path.c_str(), GENERIC_READ, FILE_SHARE_READ | FILE_SHARE_DELETE, nullptr, OPEN_EXISTING,
                                FILE_ATTRIBUTE_NORMAL, nullptr)};
  if (file.value == INVALID_HANDLE_VALUE) return LastError();
  if (GetFileType(file.value) != FILE_TYPE_DISK) return make_error_code(std::errc::invalid_argument);
  LARGE_INTEGER length;
  if (!GetFileSizeEx(file.value, &length)) return LastError();
  if (static_cast<uint64_t>(length.QuadPart) > SIZE_MAX) return make_error_code(std::errc::file_too_large);
  const size_t size = static_cast<size_t>(length.QuadPart);
  void* data = nullptr;
  if (size != 0) {  // Windows refuses to map nothing
    const Handle mapping{CreateFileMappingW(file.value, nullptr, PAGE_READONLY, 0, 0, nullptr)};
    if (mapping.value == nullptr) return LastError();
    data = MapViewOfFile(mapping.value, FILE_MAP_READ, 0, 0, 0);
    if (data == nullptr) return LastError();
  }
  MappedFile mapped(data, size);
  *this = std::move(mapped);
  return {};
}

}  // namespace dcloth::platforms

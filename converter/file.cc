#include "converter/file.h"

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <memory>
#include <string>
#include <system_error>

#include "converter/error.h"

#if defined(_WIN32)
#ifndef NOMINMAX
#define NOMINMAX
#endif
#include <fcntl.h>
#include <io.h>
#include <process.h>
#include <sys/stat.h>
#include <windows.h>
#else
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>
#endif

namespace dcloth::converter {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void Refuse(const fs::path& path, const std::string& found, const std::string& mend) {
  throw Error({path, "", found, "", mend});
}

std::string Reason(int error) { return std::generic_category().message(error); }

#if defined(_WIN32)
int OpenExclusive(const fs::path& path) {
  return _wopen(path.c_str(), _O_WRONLY | _O_CREAT | _O_EXCL | _O_BINARY, _S_IREAD | _S_IWRITE);
}
long long WriteSome(int file, const void* bytes, size_t size) {
  return _write(file, bytes, static_cast<unsigned>(std::min(size, size_t{1} << 30)));
}
int Flush(int file) { return _commit(file); }
int Close(int file) { return _close(file); }
int ProcessId() { return _getpid(); }
bool Rename(const fs::path& from, const fs::path& to, std::string* reason) {
  if (MoveFileExW(from.c_str(), to.c_str(), MOVEFILE_REPLACE_EXISTING | MOVEFILE_WRITE_THROUGH)) return true;
  *reason = std::system_category().message(static_cast<int>(GetLastError()));
  return false;
}
bool Writable(const fs::path&) { return true; }
#else
int OpenExclusive(const fs::path& path) { return ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666); }
long long WriteSome(int file, const void* bytes, size_t size) {
  return ::write(file, bytes, std::min(size, size_t{1} << 30));
}
int Flush(int file) { return ::fsync(file); }
int Close(int file) { return ::close(file); }
int ProcessId() { return static_cast<int>(::getpid()); }
bool Rename(const fs::path& from, const fs::path& to, std::string* reason) {
  if (::rename(from.c_str(), to.c_str()) != 0) {
    *reason = Reason(errno);
    return false;
  }
  // Makes the new name itself durable. A directory that cannot be flushed is no reason to undo a finished file.
  const int directory =
      ::open(to.has_parent_path() ? to.parent_path().c_str() : ".", O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (directory >= 0) {
    ::fsync(directory);
    ::close(directory);
  }
  return true;
}
bool Writable(const fs::path& path) { return ::access(path.c_str(), W_OK) == 0; }
#endif

// The name of a temporary file beside `target`, of this process. A long name (255 bytes are usual, 143 where a disk is
// encrypted) leaves no room for more and is left out of it.
fs::path TemporaryName(const fs::path& target, int attempt) {
  constexpr size_t kLongName = 100;
  fs::path name = target.filename().native().size() > kLongName ? fs::path("dcloth") : target.filename();
  std::string suffix(".");  // in pieces: GCC 12 warns of an overlap in sums
  suffix.append(std::to_string(ProcessId())).append(".").append(std::to_string(attempt)).append(".tmp");
  name += suffix;
  return target.parent_path() / name;
}

// The file that `path` means, and whether it may be replaced.
fs::path Target(const fs::path& path, fs::perms* keep) {
  if (path.empty()) Refuse(path, "an empty file name", "name the file to write");
  std::error_code failed;
  const fs::file_status status = fs::status(path, failed);
  if (status.type() == fs::file_type::not_found) {
    if (fs::is_symlink(fs::symlink_status(path, failed))) {
      Refuse(path, "a symbolic link to a file that does not exist", "remove the link or write elsewhere");
    }
    return path;
  }
  if (failed) Refuse(path, failed.message(), "choose a path that can be written");
  if (status.type() == fs::file_type::directory) Refuse(path, "a directory", "add a file name");
  if (status.type() != fs::file_type::regular) Refuse(path, "a device, pipe or socket", "write to a regular file");
  constexpr fs::perms kAnyWrite = fs::perms::owner_write | fs::perms::group_write | fs::perms::others_write;
  // The bits are asked as well as the system, which lets an administrator write anything.
  if ((status.permissions() & kAnyWrite) == fs::perms::none || !Writable(path)) {
    Refuse(path, "a file without write permission", "make it writable or write elsewhere");
  }
  *keep = status.permissions();
  const fs::path target = fs::canonical(path, failed);
  if (failed) Refuse(path, failed.message(), "choose a path that can be written");
  return target;
}

}  // namespace

// A file that vanishes unless it is renamed.
class PreparedFile::Temporary {
 public:
  explicit Temporary(const fs::path& path) : path_(path), target_(Target(path, &keep_)) {
    for (int attempt = 0; attempt < 100; ++attempt) {
      temporary_ = TemporaryName(target_, attempt);
      file_ = OpenExclusive(temporary_);
      if (file_ >= 0 || errno != EEXIST) break;
    }
    if (file_ < 0) {
      const std::string reason = Reason(errno);
      temporary_.clear();
      Refuse(path_, "a path where no file can be created: " + reason,
             "check that its directory exists and is writable");
    }
  }
  ~Temporary() {
    if (file_ >= 0) Close(file_);
    std::error_code ignored;
    if (!temporary_.empty()) fs::remove(temporary_, ignored);
  }
  Temporary(const Temporary&) = delete;
  Temporary& operator=(const Temporary&) = delete;

  void Write(std::span<const std::byte> bytes) {
    while (!bytes.empty()) {
      const long long written = WriteSome(file_, bytes.data(), bytes.size());
      if (written < 0 && errno == EINTR) continue;
      if (written <= 0) Refuse(path_, "a failed write: " + Reason(errno), "check the free disk space");
      bytes = bytes.subspan(static_cast<size_t>(written));
    }
  }

  void Finish() {
    if (Flush(file_) != 0) Refuse(path_, "a failed flush: " + Reason(errno), "check the disk");
    const int file = file_;
    file_ = -1;
    if (Close(file) != 0) Refuse(path_, "a failed close: " + Reason(errno), "check the disk");
    std::error_code ignored;
    if (keep_ != fs::perms::unknown) fs::permissions(temporary_, keep_, ignored);
  }

  void Replace() {
    std::string reason;
    if (!Rename(temporary_, target_, &reason)) {
      Refuse(path_, "a file that cannot be replaced: " + reason, "check the permissions of its directory");
    }
    temporary_.clear();
  }

 private:
  fs::perms keep_ = fs::perms::unknown;
  fs::path path_, target_, temporary_;  // as it was named, the file that means, the one that is written
  int file_ = -1;
};

AlignedBytes ReadFile(const fs::path& path, uint64_t limit_bytes) {
  std::error_code failed;
  const fs::file_status status = fs::status(path, failed);
  if (status.type() == fs::file_type::not_found) Refuse(path, "no such file", "check the path");
  if (failed) Refuse(path, failed.message(), "check the path");
  if (status.type() != fs::file_type::regular) {
    Refuse(path, status.type() == fs::file_type::directory ? "a directory" : "a device, pipe or socket", "pass a file");
  }
  const uint64_t size = fs::file_size(path, failed);
  if (failed) Refuse(path, failed.message(), "check the path");
  if (size > limit_bytes) {
    throw Error({path, "", std::to_string(size) + " bytes", "at most " + std::to_string(limit_bytes) + " bytes",
                 "split the file"});
  }
#if defined(_WIN32)
  std::FILE* const file = _wfopen(path.c_str(), L"rb");
#else
  std::FILE* const file = std::fopen(path.c_str(), "rb");
#endif
  if (file == nullptr) Refuse(path, "a file that cannot be read: " + Reason(errno), "check its permissions");
  AlignedBytes bytes;
  size_t read = 0;
  try {
    bytes.resize(size);
    read = std::fread(bytes.data(), 1, bytes.size(), file);
  } catch (...) {
    std::fclose(file);
    throw;
  }
  std::fclose(file);
  if (read != size) {
    throw Error({path, "", std::to_string(read) + " readable bytes", std::to_string(size),
                 "try again; another program may have changed the file"});
  }
  return bytes;
}

PreparedFile::PreparedFile(const fs::path& path, std::span<const std::span<const std::byte>> pieces)
    : temporary_(std::make_unique<Temporary>(path)) {
  for (const std::span<const std::byte> piece : pieces) temporary_->Write(piece);
  temporary_->Finish();
}

PreparedFile::PreparedFile(const fs::path& path, std::span<const std::byte> bytes)
    : PreparedFile(path, std::span(&bytes, 1)) {}

PreparedFile::PreparedFile(PreparedFile&& other) noexcept = default;
PreparedFile::~PreparedFile() = default;

void PreparedFile::Replace() { temporary_->Replace(); }

void WriteFileAtomically(const fs::path& path, std::span<const std::span<const std::byte>> pieces) {
  PreparedFile(path, pieces).Replace();
}

void WriteFileAtomically(const fs::path& path, std::span<const std::byte> bytes) {
  WriteFileAtomically(path, std::span(&bytes, 1));
}

}  // namespace dcloth::converter

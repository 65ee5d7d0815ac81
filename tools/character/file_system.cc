#include "tools/character/file_system.h"

#include <algorithm>
#include <cstring>
#include <system_error>
#include <utility>

#include "converter/error.h"
#include "converter/file.h"

namespace dcloth::tools {
namespace {

constexpr uint64_t kMaxFileBytes = uint64_t{1} << 30;

class BytesStream : public Assimp::IOStream {
 public:
  explicit BytesStream(converter::AlignedBytes bytes) : bytes_(std::move(bytes)) {}

  size_t Read(void* buffer, size_t size, size_t count) override {
    if (size == 0) return 0;
    const size_t whole = std::min(count, (bytes_.size() - at_) / size);
    if (whole != 0) std::memcpy(buffer, bytes_.data() + at_, whole * size);
    at_ += whole * size;
    return whole;
  }
  size_t Write(const void*, size_t, size_t) override { return 0; }
  aiReturn Seek(size_t offset, aiOrigin origin) override {
    const size_t base = origin == aiOrigin_CUR ? at_ : origin == aiOrigin_END ? bytes_.size() : 0;
    // From the end, offsets come as negative numbers wrapped around.
    const size_t target = base + offset;
    if (target > bytes_.size()) return aiReturn_FAILURE;
    at_ = target;
    return aiReturn_SUCCESS;
  }
  size_t Tell() const override { return at_; }
  size_t FileSize() const override { return bytes_.size(); }
  void Flush() override {}

 private:
  converter::AlignedBytes bytes_;
  size_t at_ = 0;
};

}  // namespace

FolderFileSystem::FolderFileSystem(const std::filesystem::path& folder, MemoryLimit* limit) : limit_(limit) {
  std::error_code failed;
  folder_ = std::filesystem::canonical(folder.empty() ? "." : folder, failed);
}

bool FolderFileSystem::Inside(const std::filesystem::path& file) const {
  std::error_code failed;
  const std::filesystem::path whole = std::filesystem::canonical(file, failed);
  if (failed || folder_.empty()) return false;
  return std::mismatch(folder_.begin(), folder_.end(), whole.begin(), whole.end()).first == folder_.end();
}

bool FolderFileSystem::Exists(const char* file) const {
  std::error_code failed;
  return Inside(file) && std::filesystem::is_regular_file(file, failed);
}

Assimp::IOStream* FolderFileSystem::Open(const char* file, const char* mode) {
  if (std::strchr(mode, 'w') != nullptr || std::strchr(mode, 'a') != nullptr || !Exists(file)) return nullptr;
  try {
    if (opened_.insert(std::filesystem::canonical(file)).second) limit_->Allow(std::filesystem::file_size(file));
    return new BytesStream(converter::ReadFile(file, kMaxFileBytes));
  } catch (const converter::Error&) {
    return nullptr;
  } catch (const std::filesystem::filesystem_error&) {
    return nullptr;
  }
}

void FolderFileSystem::Close(Assimp::IOStream* stream) { delete stream; }

}  // namespace dcloth::tools

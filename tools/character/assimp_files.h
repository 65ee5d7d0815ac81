// A folder's files as assimp asks for them.
#ifndef DCLOTH_TOOLS_CHARACTER_ASSIMP_FILES_H_
#define DCLOTH_TOOLS_CHARACTER_ASSIMP_FILES_H_

#include <algorithm>
#include <assimp/IOStream.hpp>
#include <assimp/IOSystem.hpp>
#include <cstring>
#include <utility>

#include "tools/character/folder.h"

namespace dcloth::tools {

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

class AssimpFiles : public Assimp::IOSystem {
 public:
  explicit AssimpFiles(Folder* folder) : folder_(folder) {}

  bool Exists(const char* file) const override { return folder_->Has(file); }
  char getOsSeparator() const override { return '/'; }
  Assimp::IOStream* Open(const char* file, const char* mode) override {  // null where not allowed
    if (std::strchr(mode, 'w') != nullptr || std::strchr(mode, 'a') != nullptr) return nullptr;
    auto bytes = folder_->Read(file);
    return bytes ? new BytesStream(std::move(*bytes)) : nullptr;
  }
  void Close(Assimp::IOStream* stream) override { delete stream; }

 private:
  Folder* folder_;
};

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_CHARACTER_ASSIMP_FILES_H_

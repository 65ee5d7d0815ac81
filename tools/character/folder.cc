#include "tools/character/folder.h"

#include <algorithm>
#include <system_error>

#include "converter/error.h"

namespace dcloth::tools {

Folder::Folder(const std::filesystem::path& folder, MemoryLimit* limit) : limit_(limit) {
  std::error_code failed;
  folder_ = std::filesystem::canonical(folder.empty() ? "." : folder, failed);
}

bool Folder::Has(const std::filesystem::path& file) const {
  std::error_code failed;
  const std::filesystem::path whole = std::filesystem::canonical(file, failed);
  if (failed || folder_.empty()) return false;
  const bool inside = std::mismatch(folder_.begin(), folder_.end(), whole.begin(), whole.end()).first == folder_.end();
  return inside && std::filesystem::is_regular_file(whole, failed);
}

std::optional<converter::AlignedBytes> Folder::Read(const std::filesystem::path& file, uint64_t most_bytes) {
  if (!Has(file)) return std::nullopt;
  try {
    if (opened_.insert(std::filesystem::canonical(file)).second) limit_->Allow(std::filesystem::file_size(file));
    return converter::ReadFile(file, most_bytes);
  } catch (const converter::Error&) {
    return std::nullopt;
  } catch (const std::filesystem::filesystem_error&) {
    return std::nullopt;
  }
}

}  // namespace dcloth::tools

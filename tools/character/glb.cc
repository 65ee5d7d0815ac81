#include "tools/character/glb.h"

#include <cstdint>
#include <cstring>
#include <string>

#include "converter/error.h"

namespace dcloth::tools {
namespace {

constexpr uint64_t kHeaderBytes = 12, kChunkHeaderBytes = 8;

uint64_t WordAt(std::span<const std::byte> bytes, uint64_t at) {
  uint64_t word = 0;
  for (uint64_t i = 0; i < 4; ++i) word |= std::to_integer<uint64_t>(bytes[at + i]) << (8 * i);
  return word;
}

void AtMost(const std::filesystem::path& path, const std::string& what, uint64_t length, uint64_t most) {
  if (length <= most) return;
  throw converter::Error({.path = path,
                          .tensor = {},
                          .found = what + " of " + std::to_string(length) + " bytes",
                          .expected = "at most " + std::to_string(most) + ", what the file holds",
                          .mend = "the file is damaged or was cut off; export it again"});
}

}  // namespace

void CheckGlbLengths(const std::filesystem::path& path, std::span<const std::byte> bytes) {
  const uint64_t size = bytes.size();
  if (size < kHeaderBytes + kChunkHeaderBytes || std::memcmp(bytes.data(), "glTF", 4) != 0) return;
  const uint64_t whole = WordAt(bytes, 8);
  AtMost(path, "a binary glTF", whole, size);
  // Version 1 has its one length where later ones have the first chunk's. Writers may leave a chunk's padding
  // uncounted.
  uint64_t at = kHeaderBytes;
  do {
    const uint64_t length = WordAt(bytes, at);
    AtMost(path, "a chunk at byte " + std::to_string(at), length, size - at - kChunkHeaderBytes);
    at += kChunkHeaderBytes + (length + 3) / 4 * 4;
  } while (WordAt(bytes, 4) == 2 && at + kChunkHeaderBytes <= whole);
}

}  // namespace dcloth::tools

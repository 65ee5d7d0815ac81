#include "tools/blob.h"

#include <zlib.h>

#include <stdexcept>
#include <vector>

namespace dcloth::tools {
namespace {

std::vector<unsigned char> Deflate(std::span<const std::byte> bytes) {
  uLongf size = compressBound(static_cast<uLong>(bytes.size()));
  std::vector<unsigned char> packed(size);
  // Residuals have short repeats at most; level 6 and 9 differ by 0.5 % and by a factor of 4 in time.
  const int status = compress2(packed.data(), &size, reinterpret_cast<const Bytef*>(bytes.data()),
                               static_cast<uLong>(bytes.size()), 6);
  if (status != Z_OK) throw std::runtime_error("zlib refuses to compress (status " + std::to_string(status) + ")");
  packed.resize(size);
  return packed;
}

// RFC 4648, with padding.
std::string Base64(std::span<const unsigned char> bytes) {
  constexpr char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (size_t i = 0; i < bytes.size(); i += 3) {
    const size_t left = bytes.size() - i;
    const unsigned triple = bytes[i] << 16 | (left > 1 ? bytes[i + 1] << 8 : 0) | (left > 2 ? bytes[i + 2] : 0);
    text += kDigits[triple >> 18];
    text += kDigits[triple >> 12 & 63];
    text += left > 1 ? kDigits[triple >> 6 & 63] : '=';
    text += left > 2 ? kDigits[triple & 63] : '=';
  }
  return text;
}

}  // namespace

std::string PackBlob(std::span<const std::byte> bytes) { return Base64(Deflate(bytes)); }

}  // namespace dcloth::tools

#include "tools/mdd.h"

#include <bit>
#include <cstdint>
#include <vector>

#include "converter/file.h"

namespace dcloth::tools {
namespace {

void Append(uint32_t value, std::vector<std::byte>* out) {  // big-endian
  for (int shift = 24; shift >= 0; shift -= 8) out->push_back(static_cast<std::byte>(value >> shift));
}

}  // namespace

void WriteMdd(const std::filesystem::path& path, std::span<const float> positions, size_t frame_count,
              size_t vertex_count, double fps) {
  std::vector<std::byte> out;
  out.reserve(8 + 4 * frame_count + 4 * positions.size());
  Append(static_cast<uint32_t>(frame_count), &out);
  Append(static_cast<uint32_t>(vertex_count), &out);
  for (size_t f = 0; f < frame_count; ++f) {
    Append(std::bit_cast<uint32_t>(static_cast<float>(static_cast<double>(f) / fps)), &out);
  }
  for (const float x : positions) Append(std::bit_cast<uint32_t>(x), &out);
  converter::WriteFileAtomically(path, out);
}

}  // namespace dcloth::tools

#include "tools/mesh_files.h"

#include <array>
#include <bit>
#include <charconv>
#include <cstdint>
#include <vector>

#include "converter/error.h"
#include "converter/file.h"

namespace dcloth::tools {
namespace {

template <typename Number>
void Append(Number value, std::string* text) {
  char digits[32];
  text->push_back(' ');
  text->append(digits, std::to_chars(digits, digits + sizeof(digits), value).ptr);
}

void Append(uint32_t value, std::vector<std::byte>* out) {  // big-endian
  for (int shift = 24; shift >= 0; shift -= 8) out->push_back(static_cast<std::byte>(value >> shift));
}

struct Header {  // 32 bytes, little-endian, no padding
  char signature[12] = {'P', 'O', 'I', 'N', 'T', 'C', 'A', 'C', 'H', 'E', '2', '\0'};
  int32_t version = 1;
  int32_t point_count = 0;
  float start_frame = 0;
  float sample_rate = 1;  // frames per sample
  int32_t sample_count = 0;
};
static_assert(sizeof(Header) == 32);

}  // namespace

std::string ObjText(const std::string& name, std::span<const float> positions, std::span<const uint16_t> triangles) {
  std::string text = "# metres, +Y up, +Z front\no " + converter::PrintableText(name) + "\n";
  for (size_t i = 0; i + 2 < positions.size(); i += 3) {
    text += 'v';
    for (size_t a = 0; a < 3; ++a) Append(positions[i + a], &text);
    text += '\n';
  }
  for (size_t i = 0; i + 2 < triangles.size(); i += 3) {
    text += 'f';
    for (size_t a = 0; a < 3; ++a) Append(triangles[i + a] + 1, &text);
    text += '\n';
  }
  return text;
}

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

void WritePc2(const std::filesystem::path& path, std::span<const float> positions, size_t frame_count,
              size_t vertex_count) {
  Header header;
  header.point_count = static_cast<int32_t>(vertex_count);
  header.sample_count = static_cast<int32_t>(frame_count);
  const std::array<std::span<const std::byte>, 2> pieces = {std::as_bytes(std::span(&header, 1)),
                                                            std::as_bytes(positions)};
  converter::WriteFileAtomically(path, pieces);
}

}  // namespace dcloth::tools

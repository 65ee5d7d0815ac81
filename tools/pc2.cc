#include "tools/pc2.h"

#include <array>
#include <cstdint>

#include "converter/file.h"

namespace dcloth::tools {
namespace {

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

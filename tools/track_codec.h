// Vertex animation packed for the report page: whole quanta, predicted from what came before, entropy left to deflate.
// report/data.js is the decoder; both follow the same rules word by word.
#ifndef DCLOTH_TOOLS_TRACK_CODEC_H_
#define DCLOTH_TOOLS_TRACK_CODEC_H_

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace dcloth::tools {

// Reaches +-6.5 m about the frame's origin in 16 bits; half of it tilts an edge of 10 mm by 0.6 degrees, which shading
// hides.
constexpr double kQuantumMm = 0.2;

// How a value is predicted. Numbers are the file's.
enum class Predictor : uint8_t {
  kNone = 0,
  kPrevious = 1,         // x[t-1]
  kLinear = 2,           // 2 x[t-1] - x[t-2]
  kReference = 3,        // reference[t]
  kReferenceMotion = 4,  // reference[t] + x[t-1] - reference[t-1]
};

// Frames as the page carries them.
struct PackedFrames {
  size_t frames = 0;
  Predictor predictor = Predictor::kNone;
  int32_t reference = -1;  // index of an earlier track
  std::string blob;        // of residuals: all low bytes, then all high bytes
};

struct Track {
  std::string name;
  std::vector<PackedFrames> packed = {};
  std::vector<int16_t> values;  // [frames, xyz, n] quanta about the frame's origin, of the frames after those
};

// Appends one frame. Points further than the 16 bits reach are put on the limit.
void AppendFrame(std::span<const float> positions, std::span<const int32_t> origin, Track* track);

// For each vertex the largest mesh neighbour with a smaller index, or the vertex before it; -1 for vertex 0.
std::vector<int32_t> SpatialParents(std::span<const uint16_t> triangles, size_t vertex_count);

// Packs the frames that the tracks hold, as many each, and lets go of them: a long clip need not fit into memory.
// Predictor and reference of each are those of least cost in sampled frames.
void PackFrames(std::span<const int32_t> parents, std::span<Track> tracks);

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_TRACK_CODEC_H_

// One self-contained page: figures, plots and the garment in 3D. No network, opens from the disk.
#ifndef DCLOTH_TOOLS_HTML_REPORT_H_
#define DCLOTH_TOOLS_HTML_REPORT_H_

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "tools/json_output.h"
#include "tools/track_codec.h"

namespace dcloth::tools {

// Triangles of the body that look alike.
struct ReportPart {
  size_t first = 0, count = 0;              // corners
  std::array<float, 3> colour = {1, 1, 1};  // linear; times the picture
  int32_t picture = -1;                     // -1: none
  bool cut_out = false;
};

struct ReportBody {
  std::vector<float> positions;  // [b, 3] bind pose
  std::vector<uint32_t> faces;   // [f, 3]
  std::vector<uint16_t> joints;  // [b, 4]
  std::vector<float> weights;    // [b, 4], rows sum to 1
  std::vector<uint8_t> colours;  // [b, 3] sRGB; empty: one colour for all
  // With pictures a vertex is there once for every place of a picture that it shows.
  std::vector<uint32_t> same;              // [b] the first vertex in its place
  std::vector<float> texture_coordinates;  // [b, 2]
  std::vector<ReportPart> parts;           // of all faces; empty: all look alike
  std::vector<std::vector<std::byte>> pictures;
};

struct ReportSequence {
  std::string name;
  double fps = 0;
  std::vector<int32_t> origins;  // [frames, 3] quanta; the tracks count from here
  std::vector<float> hips;       // [frames, 3] metres; the camera follows
  std::vector<float> joints;     // [frames, joints, 12]: skinning matrices with a body, else joint-to-world
  std::vector<Track> tracks;     // "truth" first where there is one
  std::vector<std::pair<std::string, std::vector<double>>> error_mm;  // per track: mean distance to truth per frame
};

struct Report {
  std::string title, subtitle;
  std::vector<std::string> facts;  // versions and machine, for the foot of the page
  std::string cpu;
  size_t joint_count = 0;
  std::vector<uint16_t> triangles;
  size_t vertex_count = 0;
  std::optional<ReportBody> body;
  std::vector<std::array<uint32_t, 2>> sticks;  // joint pairs, drawn where there is no body
  Json variants = Json::array();                // the rows of evaluate's JSON
  std::vector<ReportSequence> sequences;
};

// Packs the frames that are not packed yet, and writes atomically. Throws converter::Error.
void WriteHtmlReport(const std::filesystem::path& path, Report* report);

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_HTML_REPORT_H_

// From bundle, poses and positions to what the report page draws.
#ifndef DCLOTH_TOOLS_REPORT_SCENE_H_
#define DCLOTH_TOOLS_REPORT_SCENE_H_

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "converter/bundle.h"
#include "tools/html_report.h"
#include "tools/pose_track.h"

namespace dcloth::tools {

// The character's skin with the four strongest influences a vertex, renormalised.
ReportBody BodyOf(const converter::Bundle& bundle);

// Joint pairs whose distance keeps most constant: a spanning tree over spread and length of the distance. A model knows
// no parents, but bones are rigid.
std::vector<std::array<uint32_t, 2>> SticksOf(const PoseTrack& poses);

// Appends one frame's camera point and its quantised origin.
void AppendOrigin(std::span<const float> point, ReportSequence* sequence);
std::span<const int32_t> LastOrigin(const ReportSequence& sequence);

// Mean distance of two frames [n, 3], millimetres.
double MeanDistanceMm(std::span<const float> a, std::span<const float> b);

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_REPORT_SCENE_H_

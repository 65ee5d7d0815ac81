// A sequence's joint matrices in the order a model or bundle wants, and its wind, at any time.
#ifndef DCLOTH_TOOLS_POSE_TRACK_H_
#define DCLOTH_TOOLS_POSE_TRACK_H_

#include <array>
#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "converter/sequence.h"

namespace dcloth::tools {

class PoseTrack {
 public:
  // Joints are found by name; throws converter::Error with all the missing ones.
  PoseTrack(const converter::Sequence& sequence, std::span<const std::string> joint_names);

  size_t frame_count() const { return frame_count_; }
  size_t joint_count() const { return joint_count_; }
  double fps() const { return fps_; }
  double duration_seconds() const { return static_cast<double>(frame_count_ - 1) / fps_; }

  // [joint_count, 16], rows contiguous.
  std::span<const float> Frame(size_t frame) const;

  // The pose at `seconds`, clamped to the sequence: rotations by spherical, translations and scales by straight-line
  // interpolation. On a stored frame exactly that frame. Shear between frames is lost.
  void At(double seconds, std::span<float> matrices) const;

  // The wind, straight between frames and clamped to the sequence; zero where it has none.
  std::array<float, 3> WindAt(double seconds) const;

 private:
  size_t frame_count_ = 0, joint_count_ = 0;
  double fps_ = 0;
  std::vector<float> matrices_;  // [frame_count, joint_count, 16]
  std::vector<float> wind_;      // [frame_count, 3], or empty
};

// Frames at f / frame_rate from the track's first pose to its last. Throws converter::Error where nobody would wait for
// their end: a sequence can say that it has a frame a year. `source` names it.
size_t FrameCount(const PoseTrack& poses, double frame_rate, const std::filesystem::path& source);

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_POSE_TRACK_H_

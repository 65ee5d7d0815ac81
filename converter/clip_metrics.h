// How well a predicted clip moves: what training/dcloth_training/metrics.py defines, but E_d and E_n (metrics.h), and
// penetration and crossings, which need exact tests of meshes.
#ifndef DCLOTH_CONVERTER_CLIP_METRICS_H_
#define DCLOTH_CONVERTER_CLIP_METRICS_H_

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace dcloth::converter {

// A garment begins at rest: the first frames of a clip do not count.
constexpr size_t kWarmUpFrames = 12;

// The first frame that counts: kWarmUpFrames, or 0 in a clip no longer than that.
constexpr size_t FirstCounted(size_t frame_count) { return frame_count > kWarmUpFrames ? kWarmUpFrames : 0; }

struct BandError {
  double error_mm = 0;      // mean distance to the truth within the band
  double rms_mm = 0;        // of the band's motion about its mean over the clip, in the hips' frame
  double truth_rms_mm = 0;  // the same of the truth
};

// Of one clip, or the mean over clips in which each weighs the same (rms: of the mean square).
struct ClipError {
  size_t clip_count = 0;          // 0: nothing was measured
  double alive_mm = 0;            // the truth about its own mean shape over the clip, in the hips' frame
  double predicted_alive_mm = 0;  // the same of the prediction
  double offset_mm = 0;           // between the two mean shapes
  double motion_error_mm = 0;     // when each has lost its mean shape
  double fine_motion_mm = 0;      // of the truth: its middle and fine bands about their mean
  double strain_p99 = 0;          // edge length / rest length - 1
  double jitter_rms_mm = 0;       // second difference over time, in the hips' frame
  double jitter_truth_rms_mm = 0;
  std::array<BandError, 3> bands;  // coarse, middle, fine: 40 and 8 steps of averaging over mesh neighbours apart
  std::optional<double> calm_mm;   // predicted_alive_mm - alive_mm where the truth hardly moves
  std::optional<double> held_mm;   // how far vertices move a tick while a pose is held; the caller's to measure
};

ClipError OverClips(std::span<const ClipError> clips);

// A garment's neighbours and rest lengths.
class ClothMesh {
 public:
  // triangles [c, 3] below the vertex count; rest [n, 3] metres.
  ClothMesh(std::span<const uint16_t> triangles, std::span<const float> rest);

  size_t vertex_count() const { return row_starts_.size() - 1; }

  // Four frames of two quantities side by side, so that a neighbour is looked up once for all of them.
  static constexpr size_t kLanes = 24;
  // One step of averaging, x <- (x + mean of neighbours) / 2: [n, kLanes] to [n, kLanes].
  void Average(const float* in, float* out) const;
  // Appends edge length / rest length - 1 of every edge with a rest length.
  void Strain(std::span<const float> positions, std::vector<float>* out) const;

 private:
  struct Edge {
    uint16_t a, b;
    float rest;
  };
  std::vector<uint32_t> row_starts_;  // [n + 1]
  std::vector<uint16_t> neighbours_;  // without the vertex itself
  std::vector<Edge> edges_;
};

// The truth of one clip, which predictions are compared with.
class ClipTruth {
 public:
  using Frame = std::span<const float>;  // [n, 3] world, metres
  using Hips = std::array<float, 12>;    // rows of the joint's world matrix

  // `mesh` and what the frames refer to outlive it. At least one frame, as many hips.
  ClipTruth(const ClothMesh& mesh, std::vector<Frame> frames, std::vector<Hips> hips);

  // positions [frames, n, 3] world. About 1 ms a frame of 8,000 vertices; keeps the clip's counted frames meanwhile.
  ClipError Compare(std::span<const float> positions) const;

 private:
  // Positions of counted frame t in the hips' frame.
  void ToHips(Frame frame, size_t t, float* local) const;
  std::vector<float> Local(size_t t) const;
  // Sums of squares and lengths of the three bands of `moving`, and lengths of those of `apart`, both [count, n, 3] of
  // at most four frames.
  struct BandSums {
    std::array<double, 3> squares{}, lengths{};
    double fine_length = 0;
  };
  void AddBands(std::span<const float> moving, std::span<const float> apart, size_t count, BandSums* sums) const;

  const ClothMesh& mesh_;
  std::vector<Frame> frames_;  // all of them
  std::vector<Hips> hips_;
  size_t first_, counted_;
  std::vector<float> mean_;  // [n, 3] in the hips' frame
  ClipError truth_;          // what a comparison begins with: the truth's own figures
};

}  // namespace dcloth::converter

#endif  // DCLOTH_CONVERTER_CLIP_METRICS_H_

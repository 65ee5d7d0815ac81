// How far a predicted garment is from another: E_d and E_n of the D-Cloth paper, eq. 19.
#ifndef DCLOTH_CONVERTER_METRICS_H_
#define DCLOTH_CONVERTER_METRICS_H_

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace dcloth::converter {

// Nearest rank: the smallest value that at least `percent` (1 to 100) of 100 values do not exceed; 0 of none. Reorders.
double Percentile(std::vector<float>* values, size_t percent);

// Percentiles are over all vertices of all frames.
struct PositionError {
  double mean = 0;                            // mm: over frames, of a frame's mean distance
  double std = 0;                             // mm: of a frame's mean distance over frames (population)
  double p50 = 0, p95 = 0, p99 = 0, max = 0;  // mm
};

// Area-weighted vertex normals of both meshes over the same faces. A vertex whose normal vanishes in either mesh is
// left out and counted.
struct NormalError {
  double mean = 0;  // degrees
  double std = 0;   // degrees, of a frame's mean over frames (population)
  uint64_t skipped = 0;
};

struct MeshError {
  size_t frame_count = 0;
  PositionError position_mm;
  NormalError normal_deg;
};

// Collects frames; keeps one float per vertex and frame for the percentiles.
class ErrorMeter {
 public:
  // `triangles` [c, 3], indices below vertex_count; throws Error otherwise.
  ErrorMeter(std::span<const uint16_t> triangles, size_t vertex_count);

  // Positions [vertex_count, 3] in metres, both in one space. Throws Error for another length, NaN or infinity.
  void AddFrame(std::span<const float> predicted, std::span<const float> truth);

  // Adds another meter's frames, of a garment with the same triangles.
  void Add(const ErrorMeter& other);

  // All zero before the first frame.
  MeshError Result() const;

 private:
  std::vector<uint16_t> triangles_;
  size_t vertex_count_;
  std::vector<float> distances_mm_;
  std::vector<double> frame_mm_;
  std::vector<double> frame_deg_;
  uint64_t skipped_ = 0;
};

}  // namespace dcloth::converter

#endif  // DCLOTH_CONVERTER_METRICS_H_

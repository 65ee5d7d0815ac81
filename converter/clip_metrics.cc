#include "converter/clip_metrics.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "converter/error.h"
#include "converter/mesh_graph.h"
#include "converter/metrics.h"

namespace dcloth::converter {
namespace {

constexpr int kLittle = 8, kMuch = 40;  // steps of averaging that separate fine, middle and coarse
constexpr size_t kBlock = ClothMesh::kLanes / 6;
constexpr double kCalmMm = 5;
constexpr double ClipError::*kMeans[] = {&ClipError::alive_mm,       &ClipError::predicted_alive_mm,
                                         &ClipError::offset_mm,      &ClipError::motion_error_mm,
                                         &ClipError::fine_motion_mm, &ClipError::strain_p99};

double Length(const float* v) {
  const double x = v[0], y = v[1], z = v[2];
  return std::sqrt(x * x + y * y + z * z);
}

double Square(const float* v) {
  const double x = v[0], y = v[1], z = v[2];
  return x * x + y * y + z * z;
}

double Rms(double a, double b) { return std::sqrt(a * a + b * b); }

// Millimetres: mean of a sum of metres, root of a mean of square metres.
double MeanMm(double sum, size_t count) { return count == 0 ? 0 : 1000 * sum / static_cast<double>(count); }
double RmsMm(double sum, size_t count) { return count == 0 ? 0 : 1000 * std::sqrt(sum / static_cast<double>(count)); }

std::vector<float> MeanShape(const std::vector<std::vector<float>>& shapes) {
  std::vector<double> sum(shapes[0].size(), 0);
  for (const std::vector<float>& shape : shapes) {
    for (size_t i = 0; i < sum.size(); ++i) sum[i] += static_cast<double>(shape[i]);
  }
  std::vector<float> mean(sum.size());
  for (size_t i = 0; i < sum.size(); ++i) mean[i] = static_cast<float>(sum[i] / static_cast<double>(shapes.size()));
  return mean;
}

// Sum of squares of the second difference over time.
double SecondDifference(const std::vector<std::vector<float>>& shapes) {
  double sum = 0;
  for (size_t t = 1; t + 1 < shapes.size(); ++t) {
    for (size_t i = 0; i < shapes[t].size(); ++i) {
      const double second = static_cast<double>(shapes[t + 1][i]) - 2 * static_cast<double>(shapes[t][i]) +
                            static_cast<double>(shapes[t - 1][i]);
      sum += second * second;
    }
  }
  return sum;
}

}  // namespace

ClipError OverClips(std::span<const ClipError> clips) {
  ClipError out;
  std::vector<double> calm, held;
  for (const ClipError& clip : clips) {
    if (clip.clip_count == 0) continue;
    ++out.clip_count;
    for (double ClipError::*field : kMeans) {
      out.*field += clip.*field;
    }
    out.jitter_rms_mm = Rms(out.jitter_rms_mm, clip.jitter_rms_mm);
    out.jitter_truth_rms_mm = Rms(out.jitter_truth_rms_mm, clip.jitter_truth_rms_mm);
    for (size_t b = 0; b < out.bands.size(); ++b) {
      out.bands[b].error_mm += clip.bands[b].error_mm;
      out.bands[b].rms_mm = Rms(out.bands[b].rms_mm, clip.bands[b].rms_mm);
      out.bands[b].truth_rms_mm = Rms(out.bands[b].truth_rms_mm, clip.bands[b].truth_rms_mm);
    }
    if (clip.calm_mm) calm.push_back(*clip.calm_mm);
    if (clip.held_mm) held.push_back(*clip.held_mm);
  }
  if (out.clip_count == 0) return out;
  const double count = static_cast<double>(out.clip_count), root = std::sqrt(count);
  for (double ClipError::*field : kMeans) {
    out.*field /= count;
  }
  out.jitter_rms_mm /= root, out.jitter_truth_rms_mm /= root;
  for (BandError& band : out.bands) band.error_mm /= count, band.rms_mm /= root, band.truth_rms_mm /= root;
  const auto mean = [](const std::vector<double>& values) -> std::optional<double> {
    if (values.empty()) return std::nullopt;
    double sum = 0;
    for (const double value : values) sum += value;
    return sum / static_cast<double>(values.size());
  };
  out.calm_mm = mean(calm), out.held_mm = mean(held);
  return out;
}

ClothMesh::ClothMesh(std::span<const uint16_t> triangles, std::span<const float> rest) {
  Faces faces(static_cast<Eigen::Index>(triangles.size() / 3), 3);
  std::copy(triangles.begin(), triangles.end(), faces.data());
  const uint32_t n = static_cast<uint32_t>(rest.size() / 3);
  const MeshGraph graph = BuildMeshGraph(faces, n);
  row_starts_.push_back(0);
  for (uint32_t i = 0; i < n; ++i) {
    for (uint32_t k = graph.row_starts[i]; k < graph.row_starts[i + 1]; ++k) {
      const uint16_t j = graph.columns[k];
      if (j == i) continue;
      neighbours_.push_back(j);
      if (j < i) continue;
      float apart[3];
      for (size_t c = 0; c < 3; ++c) apart[c] = rest[3 * i + c] - rest[3 * size_t{j} + c];
      const float length = static_cast<float>(Length(apart));
      if (length > 0) edges_.push_back({static_cast<uint16_t>(i), j, length});
    }
    row_starts_.push_back(static_cast<uint32_t>(neighbours_.size()));
  }
}

void ClothMesh::Average(const float* in, float* out) const {
  for (size_t i = 0; i + 1 < row_starts_.size(); ++i) {
    const uint32_t first = row_starts_[i], last = row_starts_[i + 1];
    const float* const own = in + i * kLanes;
    float sum[kLanes] = {};
    for (uint32_t k = first; k < last; ++k) {
      const float* const other = in + size_t{neighbours_[k]} * kLanes;
      for (size_t lane = 0; lane < kLanes; ++lane) sum[lane] += other[lane];
    }
    const float share = first == last ? 0 : 0.5f / static_cast<float>(last - first);
    const float kept = first == last ? 1 : 0.5f;
    for (size_t lane = 0; lane < kLanes; ++lane) out[i * kLanes + lane] = kept * own[lane] + share * sum[lane];
  }
}

void ClothMesh::Strain(std::span<const float> positions, std::vector<float>* out) const {
  for (const Edge& edge : edges_) {
    float apart[3];
    for (size_t c = 0; c < 3; ++c) apart[c] = positions[3 * size_t{edge.a} + c] - positions[3 * size_t{edge.b} + c];
    out->push_back(static_cast<float>(Length(apart) / static_cast<double>(edge.rest) - 1));
  }
}

ClipTruth::ClipTruth(const ClothMesh& mesh, std::vector<Frame> frames, std::vector<Hips> hips)
    : mesh_(mesh),
      frames_(std::move(frames)),
      hips_(std::move(hips)),
      first_(FirstCounted(frames_.size())),
      counted_(frames_.size() - first_) {
  const size_t size = mesh.vertex_count() * 3;
  std::vector<std::vector<float>> local;
  for (size_t t = 0; t < counted_; ++t) local.push_back(Local(t));
  mean_ = MeanShape(local);
  BandSums sums;
  double alive = 0;
  std::vector<float> moving(kBlock * size);
  for (size_t t = 0; t < counted_; t += kBlock) {
    const size_t count = std::min(kBlock, counted_ - t);
    for (size_t k = 0; k < count; ++k) {
      float* const motion = &moving[k * size];
      for (size_t i = 0; i < size; ++i) motion[i] = local[t + k][i] - mean_[i];
      for (size_t i = 0; i < size; i += 3) alive += Length(motion + i);
    }
    AddBands(moving, moving, count, &sums);
  }
  const size_t points = counted_ * mesh.vertex_count();
  truth_.clip_count = 1;
  truth_.alive_mm = MeanMm(alive, points);
  truth_.fine_motion_mm = MeanMm(sums.fine_length, points);
  truth_.jitter_truth_rms_mm = RmsMm(SecondDifference(local), counted_ < 3 ? 0 : points - 2 * mesh.vertex_count());
  for (size_t b = 0; b < truth_.bands.size(); ++b) truth_.bands[b].truth_rms_mm = RmsMm(sums.squares[b], points);
}

void ClipTruth::ToHips(Frame frame, size_t t, float* local) const {
  const Hips& h = hips_[first_ + t];
  for (size_t i = 0; i + 2 < frame.size(); i += 3) {
    const double x = static_cast<double>(frame[i]) - static_cast<double>(h[3]);
    const double y = static_cast<double>(frame[i + 1]) - static_cast<double>(h[7]);
    const double z = static_cast<double>(frame[i + 2]) - static_cast<double>(h[11]);
    for (size_t c = 0; c < 3; ++c) {
      local[i + c] = static_cast<float>(static_cast<double>(h[c]) * x + static_cast<double>(h[4 + c]) * y +
                                        static_cast<double>(h[8 + c]) * z);
    }
  }
}

std::vector<float> ClipTruth::Local(size_t t) const {
  std::vector<float> local(mesh_.vertex_count() * 3);
  ToHips(frames_[first_ + t], t, local.data());
  return local;
}

void ClipTruth::AddBands(std::span<const float> moving, std::span<const float> apart, size_t count,
                         BandSums* sums) const {
  constexpr size_t kLanes = ClothMesh::kLanes;
  const size_t n = mesh_.vertex_count();
  std::vector<float> whole(n * kLanes, 0.0f), little, next(n * kLanes);
  for (size_t i = 0; i < n; ++i) {
    for (size_t k = 0; k < count; ++k) {
      for (size_t c = 0; c < 3; ++c) {
        whole[i * kLanes + 3 * k + c] = moving[(k * n + i) * 3 + c];
        whole[i * kLanes + 3 * (kBlock + k) + c] = apart[(k * n + i) * 3 + c];
      }
    }
  }
  std::vector<float> much = whole;
  for (int step = 1; step <= kMuch; ++step) {
    mesh_.Average(much.data(), next.data());
    much.swap(next);
    if (step == kLittle) little = much;
  }
  for (size_t i = 0; i < n; ++i) {
    for (size_t k = 0; k < 2 * kBlock; ++k) {
      if (k % kBlock >= count) continue;
      const size_t at = i * kLanes + 3 * k;
      float middle[3], fine[3], both[3];
      for (size_t c = 0; c < 3; ++c) {
        middle[c] = little[at + c] - much[at + c], fine[c] = whole[at + c] - little[at + c];
        both[c] = middle[c] + fine[c];
      }
      const float* const bands[] = {&much[at], middle, fine};
      for (size_t b = 0; b < 3; ++b) {
        if (k < kBlock) {
          sums->squares[b] += Square(bands[b]);
        } else {
          sums->lengths[b] += Length(bands[b]);
        }
      }
      if (k < kBlock) sums->fine_length += Length(both);
    }
  }
}

ClipError ClipTruth::Compare(std::span<const float> positions) const {
  const size_t n = mesh_.vertex_count(), size = 3 * n;
  if (positions.size() != frames_.size() * size) {
    throw Error({"", "", std::to_string(positions.size() / size) + " predicted frames",
                 std::to_string(frames_.size()) + ", as many as the truth has", ""});
  }
  std::vector<std::vector<float>> local(counted_, std::vector<float>(size));
  std::vector<float> strain;
  for (size_t t = 0; t < counted_; ++t) {
    const Frame frame = positions.subspan((first_ + t) * size, size);
    ToHips(frame, t, local[t].data());
    mesh_.Strain(frame, &strain);
  }
  const std::vector<float> mean = MeanShape(local);

  ClipError out = truth_;
  BandSums sums;
  double alive = 0, motion_error = 0, offset = 0;
  std::vector<float> moving(kBlock * size), apart(kBlock * size);
  for (size_t t = 0; t < counted_; t += kBlock) {
    const size_t count = std::min(kBlock, counted_ - t);
    for (size_t k = 0; k < count; ++k) {
      const std::vector<float> truth = Local(t + k);
      for (size_t i = 0; i < size; ++i) {
        moving[k * size + i] = local[t + k][i] - mean[i];
        apart[k * size + i] = local[t + k][i] - truth[i];
      }
      for (size_t i = 0; i < size; i += 3) {
        float moved[3];
        for (size_t c = 0; c < 3; ++c) moved[c] = moving[k * size + i + c] - (truth[i + c] - mean_[i + c]);
        alive += Length(&moving[k * size + i]);
        motion_error += Length(moved);
      }
    }
    AddBands(moving, apart, count, &sums);
  }
  for (size_t i = 0; i < size; i += 3) {
    float between[3];
    for (size_t c = 0; c < 3; ++c) between[c] = mean[i + c] - mean_[i + c];
    offset += Length(between);
  }
  const size_t points = counted_ * n;
  out.predicted_alive_mm = MeanMm(alive, points);
  out.motion_error_mm = MeanMm(motion_error, points);
  out.offset_mm = MeanMm(offset, n);
  out.jitter_rms_mm = RmsMm(SecondDifference(local), counted_ < 3 ? 0 : points - 2 * n);
  for (size_t b = 0; b < out.bands.size(); ++b) {
    out.bands[b].error_mm = MeanMm(sums.lengths[b], points);
    out.bands[b].rms_mm = RmsMm(sums.squares[b], points);
  }
  out.strain_p99 = Percentile(&strain, 99);
  if (out.alive_mm < kCalmMm) out.calm_mm = out.predicted_alive_mm - out.alive_mm;
  return out;
}

}  // namespace dcloth::converter

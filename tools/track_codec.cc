#include "tools/track_codec.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>

#include "tools/blob.h"

namespace dcloth::tools {
namespace {

// Arithmetic wraps at 16 bits, so decoding is exact whatever the prediction.
int16_t Wrap(int32_t value) { return static_cast<int16_t>(static_cast<uint16_t>(value)); }
uint16_t Zigzag(int16_t value) { return static_cast<uint16_t>((value << 1) ^ (value >> 15)); }

// Residuals of one coordinate of one frame.
void Residuals(const Track& track, const Track* reference, Predictor predictor, size_t frame, size_t axis,
               std::span<const int32_t> parents, std::span<uint16_t> out) {
  const size_t count = parents.size(), plane = 3 * count, base = frame * plane + axis * count;
  const int16_t* x = track.values.data();
  const int16_t* r = reference != nullptr ? reference->values.data() : nullptr;
  const auto difference = [&](size_t i) {
    const size_t at = base + i;
    int32_t predicted = 0;
    if (predictor == Predictor::kReference || predictor == Predictor::kReferenceMotion) {
      predicted = r[at];
      if (predictor == Predictor::kReferenceMotion && frame > 0) predicted += x[at - plane] - r[at - plane];
    } else if (predictor != Predictor::kNone && frame > 0) {
      predicted = x[at - plane];
      if (predictor == Predictor::kLinear && frame > 1) predicted += x[at - plane] - x[at - 2 * plane];
    }
    return Wrap(x[at] - predicted);
  };
  for (size_t i = 0; i < count; ++i) {
    const int32_t parent = parents[i] < 0 ? 0 : difference(static_cast<size_t>(parents[i]));
    out[i] = Zigzag(Wrap(difference(i) - parent));
  }
}

// Bits that an ideal coder of magnitudes would need, near enough to compare predictors.
uint64_t Cost(const Track& track, const Track* reference, Predictor predictor, std::span<const int32_t> parents) {
  constexpr size_t kSampledFrames = 6;
  const size_t frames = track.values.size() / (3 * parents.size());
  std::vector<uint16_t> residuals(parents.size());
  uint64_t bits = 0;
  for (size_t s = 0; s < kSampledFrames; ++s) {
    const size_t frame = frames * (2 * s + 1) / (2 * kSampledFrames);
    for (size_t axis = 0; axis < 3; ++axis) {
      Residuals(track, reference, predictor, frame, axis, parents, residuals);
      for (uint16_t z : residuals) bits += static_cast<uint64_t>(std::bit_width(z));
    }
  }
  return bits;
}

PackedFrames Pack(const Track& track, std::span<const Track> earlier, std::span<const int32_t> parents) {
  PackedFrames packed;
  uint64_t best = UINT64_MAX;
  const auto consider = [&](Predictor predictor, int32_t reference) {
    const Track* other = reference < 0 ? nullptr : &earlier[static_cast<size_t>(reference)];
    const uint64_t cost = Cost(track, other, predictor, parents);
    if (cost < best) {
      best = cost;
      packed.predictor = predictor;
      packed.reference = reference;
    }
  };
  for (Predictor p : {Predictor::kNone, Predictor::kPrevious, Predictor::kLinear}) consider(p, -1);
  for (size_t i = 0; i < earlier.size(); ++i) {
    consider(Predictor::kReference, static_cast<int32_t>(i));
    consider(Predictor::kReferenceMotion, static_cast<int32_t>(i));
  }
  const Track* reference = packed.reference < 0 ? nullptr : &earlier[static_cast<size_t>(packed.reference)];
  const size_t total = track.values.size();
  packed.frames = total / (3 * parents.size());
  std::vector<std::byte> bytes(2 * total);
  std::vector<uint16_t> residuals(parents.size());
  size_t at = 0;
  for (size_t frame = 0; frame < packed.frames; ++frame) {
    for (size_t axis = 0; axis < 3; ++axis) {
      Residuals(track, reference, packed.predictor, frame, axis, parents, residuals);
      for (uint16_t z : residuals) {
        bytes[at] = static_cast<std::byte>(z & 0xFF);
        bytes[total + at] = static_cast<std::byte>(z >> 8);
        ++at;
      }
    }
  }
  packed.blob = PackBlob(bytes);
  return packed;
}

}  // namespace

void AppendFrame(std::span<const float> positions, std::span<const int32_t> origin, Track* track) {
  const size_t count = positions.size() / 3, base = track->values.size();
  track->values.resize(base + 3 * count);
  for (size_t axis = 0; axis < 3; ++axis) {
    for (size_t i = 0; i < count; ++i) {
      const double quanta = std::round(positions[3 * i + axis] * (1000 / kQuantumMm)) - origin[axis];
      track->values[base + axis * count + i] = static_cast<int16_t>(std::clamp(quanta, -32768.0, 32767.0));
    }
  }
}

std::vector<int32_t> SpatialParents(std::span<const uint16_t> triangles, size_t vertex_count) {
  std::vector<int32_t> parents(vertex_count, -1);
  for (size_t f = 0; f + 2 < triangles.size(); f += 3) {
    for (size_t k = 0; k < 3; ++k) {
      const auto [low, high] = std::minmax<int32_t>({triangles[f + k], triangles[f + (k + 1) % 3]});
      if (low < high) parents[static_cast<size_t>(high)] = std::max(parents[static_cast<size_t>(high)], low);
    }
  }
  for (size_t i = 1; i < vertex_count; ++i) {
    if (parents[i] < 0) parents[i] = static_cast<int32_t>(i) - 1;
  }
  return parents;
}

void PackFrames(std::span<const int32_t> parents, std::span<Track> tracks) {
  for (size_t i = 0; i < tracks.size(); ++i) tracks[i].packed.push_back(Pack(tracks[i], tracks.first(i), parents));
  for (Track& track : tracks) track.values.clear();
}

}  // namespace dcloth::tools

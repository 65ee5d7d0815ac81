// Random but valid bundles and sequences of any size, for tests: a helical tube of cloth around a chain of joints.
#ifndef DCLOTH_TESTS_UNIT_CONVERTER_BUNDLE_BUILDER_H_
#define DCLOTH_TESTS_UNIT_CONVERTER_BUNDLE_BUILDER_H_

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "converter/bundle.h"
#include "converter/safetensors.h"
#include "converter/sequence.h"

namespace dcloth::testing {

struct BundleSpec {
  uint32_t vertices = 60;       // n, at least 9
  uint32_t joints = 6;          // J
  uint32_t feature_joints = 3;  // first ones of the joints; d = 9 feature_joints (+ 4 or 7)
  converter::RootMotion root_motion = converter::RootMotion::kHips;
  uint32_t bones = 4;  // m, the last ones of the joints
  uint32_t body_vertices = 12;
  uint32_t residuals = 2;
  uint32_t static_width = 12;
  bool skeleton = true;
  uint32_t skeleton_basis = 10;  // k_S
  bool mesh = true;              // needs skeleton
  uint32_t mesh_basis = 7;       // k_M
  uint32_t feature_width = 8;    // F
  uint32_t layers = 2;           // L
  uint32_t mesh_width = 16;      // h
  bool half_weights = false;     // trained weights as F16
  // Of a patch stage, which then is in place of the skeleton and the mesh stage. 0 patches: none.
  uint32_t patches = 0, patch_points = 3, patch_width = 16, patch_neighbours = 2, patch_layers = 2;
  uint32_t capsules = 3, embedding = 5, sources = 4;
  uint64_t seed = 1;

  uint32_t features() const {
    return 9 * feature_joints + (root_motion == converter::RootMotion::kAir    ? 7
                                 : root_motion == converter::RootMotion::kHips ? 4
                                                                               : 0);
  }
};

// A safetensors file in pieces, so that a test can break one.
struct RawTensor {
  std::string name;
  converter::SafeType type;
  converter::Shape shape;
  std::vector<std::byte> bytes;
};

struct RawFile {
  converter::Metadata metadata;
  std::vector<RawTensor> tensors;

  RawTensor& At(std::string_view name);  // throws std::out_of_range
  void Erase(std::string_view name);
  void SetFloat(std::string_view name, size_t index, float value);  // F32 only
  void SetInt(std::string_view name, size_t index, int32_t value);  // I32 only
  void Replace(std::string_view name, converter::Shape shape,
               const std::vector<float>& values);                           // adds or replaces, F32
  void SetMasks(std::string_view name, const std::vector<int32_t>& masks);  // adds or replaces, I32

  converter::AlignedBytes Bytes() const;
  void Write(const std::filesystem::path& path) const;
};

RawFile BuildBundle(const BundleSpec& spec);

// A character with the bundle's joints that walks in a curve and bends; `truth` adds noise-free positions near the
// tube.
RawFile BuildSequence(const BundleSpec& spec, uint32_t frames, bool truth = false, double fps = 30);

// As the converter reads them, from files "b.safetensors" and "s.safetensors".
converter::Bundle ParseRawBundle(const RawFile& raw);
converter::Bundle ParseBundle(const BundleSpec& spec);
converter::Sequence ParseRawSequence(const RawFile& raw);
converter::Sequence ParseSequence(const BundleSpec& spec, uint32_t frames, double fps = 30);

}  // namespace dcloth::testing

#endif  // DCLOTH_TESTS_UNIT_CONVERTER_BUNDLE_BUILDER_H_

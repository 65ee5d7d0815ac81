// A model file out of packed parts: FlatBuffer tables and the one weight vector.
#ifndef DCLOTH_CONVERTER_WRITE_MODEL_H_
#define DCLOTH_CONVERTER_WRITE_MODEL_H_

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "converter/file.h"
#include "converter/pack.h"

namespace dcloth::converter {

// Fields of engine/format/dcloth.fbs, one for one.
struct MeshLayerParts {
  PackedTensor gate_bias, output_bias, norm_gain, norm_offset;
  std::optional<PackedTensor> input_gates, hidden_gates, hidden_candidate, output;
  std::optional<PackedTensor> weights, column_scales, input_inverse_steps;
  float prelu_slope = 0;
};

struct MeshStageParts {
  uint8_t body_influences = 0;
  PackedTensor body_points, body_joints, body_weights, input_mean, input_inverse_deviation, row_starts, columns;
  uint16_t feature_width = 0;
  std::vector<MeshLayerParts> layers;
  PackedTensor embed;
  float embed_bias = 0;
  PackedLinear hidden, coefficients;
};

struct SkeletonStageParts {
  PackedLinear input, hidden;
};

struct PatchStageParts {
  uint16_t patches = 0;
  uint8_t points = 0;
  uint16_t width = 0;
  uint8_t neighbours = 0;
  PackedTensor joints, axes, centres, point_joints, point_parts, capsule_joints, capsules, limbs;
  std::optional<PackedTensor> near, embedding;
  PackedLinear enter;
  std::vector<PackedLinear> mix;
  PackedLinear input_gates, hidden_gates, out;
  PackedTensor keep, sources, vertices, group_starts;
  PackedLinear map;
};

struct BodyParts {
  uint8_t influences = 0;
  PackedTensor positions, joints, weights, faces, row_starts, columns;
  std::optional<PackedTensor> touch_classes, touched_by, garment_order, sites;
  float clearance = 0, reach = 0;
};

struct ModelParts {
  std::string producer, precision, garment;
  float tick_rate = 0;
  uint32_t vertices = 0;
  std::vector<std::string> joint_names;
  std::vector<uint16_t> parents;  // format::kNoParent at the top; empty where they are not known
  uint16_t hips = 0;
  std::vector<uint16_t> feature_joints, bones;
  RootMotion root_motion = RootMotion::kNone;
  uint8_t influences = 0;
  uint32_t skeleton_rows = 0, mesh_rows = 0;

  PackedTensor template_positions, faces, inverse_bind;
  std::optional<PackedTensor> coarse_vertices, coarse_faces;
  std::optional<PackedTensor> texture_coordinates, seam_vertices, textured_faces;
  PackedTensor mean, inverse_deviation, low, high;
  PackedTensor pivots, influence_bones, influence_weights;
  PackedLinear static_hidden, static_increments;
  std::optional<SkeletonStageParts> skeleton;
  std::optional<MeshStageParts> mesh;
  std::optional<PatchStageParts> patches;
  std::optional<PackedLinear> basis, head;
  std::optional<BodyParts> body;
};

// The file's bytes. Tensors lie in the order in which a tick reads them, each on 64 bytes, gaps zero. The same parts
// give the same bytes. Throws Error beyond 2 GB, where FlatBuffers' offsets end.
AlignedBytes WriteModel(const ModelParts& parts);

// Every tensor of the parts in file order.
std::vector<const PackedTensor*> TensorsOf(const ModelParts& parts);

}  // namespace dcloth::converter

#endif  // DCLOTH_CONVERTER_WRITE_MODEL_H_

#include "converter/assemble_patches.h"

#include <string>
#include <vector>

#include "kernels/matvec/matvec.h"

namespace dcloth::converter {
namespace {

std::string Field(const std::string& name) { return "patch_stage." + name; }

PackedTensor Bytes(const std::string& name, std::vector<uint32_t> shape, const std::vector<uint32_t>& values) {
  return PackIndices(Field(name), StoredType::kU8, std::move(shape), values);
}

PackedTensor Joints(const std::string& name, std::vector<uint32_t> shape, const std::vector<uint32_t>& joints,
                    const JointSubset& subset) {
  std::vector<uint32_t> kept;
  kept.reserve(joints.size());
  for (const uint32_t joint : joints) kept.push_back(subset.kept[joint]);
  return Bytes(name, std::move(shape), kept);
}

// PyTorch's [out, in] as [in, out].
PackedLinear Pack(const std::string& name, const LinearWeights& linear, const PrecisionPlan& plan) {
  return PackLinear(Field(name), linear.weight.transpose(), linear.bias, FormatOf(plan, Field(name)),
                    Int8Scales::kColumns);
}

// Row 3 m + b takes component b of source m; each group's columns begin a panel of their own.
void AddMap(const PatchWeights& patches, const PrecisionPlan& plan, PatchStageParts* parts) {
  std::vector<uint32_t> starts = {0}, vertices;
  Eigen::Index columns = 0;
  for (const std::vector<uint32_t>& group : patches.groups) {
    vertices.insert(vertices.end(), group.begin(), group.end());
    starts.push_back(static_cast<uint32_t>(vertices.size()));
    columns += static_cast<Eigen::Index>(kernels::PaddedColumns(3 * group.size()));
  }
  const auto sources = static_cast<Eigen::Index>(patches.source_count);
  Matrix map = Matrix::Zero(3 * sources, columns);
  Vector offsets = Vector::Zero(columns);
  Eigen::Index group_column = 0;
  for (const std::vector<uint32_t>& group : patches.groups) {
    Eigen::Index column = group_column;
    for (const uint32_t v : group) {
      for (Eigen::Index a = 0; a < 3; ++a, ++column) {
        for (Eigen::Index m = 0; m < sources; ++m) {
          for (Eigen::Index b = 0; b < 3; ++b) map(3 * m + b, column) = patches.map(v, 9 * m + 3 * a + b);
        }
        offsets[column] = patches.offsets(v, a);
      }
    }
    group_column += static_cast<Eigen::Index>(kernels::PaddedColumns(3 * group.size()));
  }
  const auto n = static_cast<uint32_t>(vertices.size());
  parts->vertices = PackIndices(Field("vertices"), StoredType::kU16, {n}, vertices);
  parts->group_starts =
      PackIndices(Field("group_starts"), StoredType::kU32, {static_cast<uint32_t>(starts.size())}, starts);
  parts->map = PackLinear(Field("map"), map, offsets, FormatOf(plan, Field("map")), Int8Scales::kColumns);
}

}  // namespace

PatchStageParts AssemblePatches(const PatchWeights& patches, const JointSubset& joints, const PrecisionPlan& plan) {
  const uint32_t k = patches.patch_count, points = k * patches.point_count;
  const auto layers = static_cast<uint32_t>(patches.mix.size());
  PatchStageParts parts;
  parts.patches = static_cast<uint16_t>(k);
  parts.points = static_cast<uint8_t>(patches.point_count);
  parts.width = static_cast<uint16_t>(patches.enter.weight.rows());
  parts.neighbours = static_cast<uint8_t>(patches.neighbour_count);
  parts.joints = Joints("joints", {k}, patches.joints, joints);
  parts.axes = PackFloats(Field("axes"), patches.axes);
  parts.centres = PackFloats(Field("centres"), patches.centres);
  parts.point_joints = Joints("point_joints", {points, 4}, patches.point_joints, joints);
  parts.point_parts = PackFloats(Field("point_parts"), patches.point_parts);
  parts.capsule_joints =
      Joints("capsule_joints", {static_cast<uint32_t>(patches.capsule_joints.size())}, patches.capsule_joints, joints);
  parts.capsules = PackFloats(Field("capsules"), patches.capsules);
  parts.limbs = Bytes("limbs", {k, 4}, patches.limbs);
  if (!patches.near.empty()) parts.near = Bytes("near", {layers * patches.neighbour_count, k}, patches.near);
  if (patches.embedding.size() != 0) parts.embedding = PackFloats(Field("embedding"), patches.embedding);
  parts.enter = Pack("enter", patches.enter, plan);
  for (uint32_t l = 0; l < layers; ++l) parts.mix.push_back(Pack("mix." + std::to_string(l), patches.mix[l], plan));
  parts.input_gates = Pack("input_gates", patches.input_gates, plan);
  parts.hidden_gates = Pack("hidden_gates", patches.hidden_gates, plan);
  parts.out = Pack("out", patches.out, plan);
  parts.keep = PackFloats(Field("keep"), patches.keep);
  parts.sources = PackIndices(Field("sources"), StoredType::kU16, {points, patches.source_count}, patches.sources);
  AddMap(patches, plan, &parts);
  return parts;
}

}  // namespace dcloth::converter

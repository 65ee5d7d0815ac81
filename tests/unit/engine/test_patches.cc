#include "tests/unit/engine/test_patches.h"

#include <algorithm>
#include <cmath>

#include "kernels/matvec/matvec.h"

namespace dcloth::testing {
namespace {

using Vec = std::array<double, 3>;

Vec RandomVec(double low, double high, TensorWriter* writer) {
  Vec vec = {};
  for (double& component : vec) component = writer->Uniform(low, high);
  return vec;
}

// Orthonormal columns, row-major.
std::array<double, 9> RandomAxes(TensorWriter* writer) {
  const Vec axis = RandomVec(0.2, 1, writer);
  const double length = std::hypot(axis[0], axis[1], axis[2]), angle = writer->Uniform(0.5, 2.5);
  const double x = axis[0] / length, y = axis[1] / length, z = axis[2] / length, c = std::cos(angle),
               s = std::sin(angle), t = 1 - c;
  return {t * x * x + c,     t * x * y - s * z, t * x * z + s * y, t * x * y + s * z, t * y * y + c,
          t * y * z - s * x, t * x * z - s * y, t * y * z + s * x, t * z * z + c};
}

// The vertices of each point in turn, and where each point's begin.
void AddGroups(const ModelSpec& spec, Patches* patches) {
  const uint32_t n = spec.rings * spec.segments, k = spec.patches, r = spec.patch_points;
  for (uint32_t point = 0; point < k * r; ++point) {
    patches->group_starts.push_back(static_cast<uint32_t>(patches->vertices.size()));
    for (uint32_t v = 0; v < n; ++v) {
      const uint32_t patch = v % spec.segments * k / spec.segments, piece = v / spec.segments * r / spec.rings;
      if (patch * r + piece == point) patches->vertices.push_back(static_cast<uint16_t>(v));
    }
  }
  patches->group_starts.push_back(n);
}

// What plain skinning makes of the mean of each group, were its vertices all on the same four joints.
void AddPoints(TensorWriter* writer, const Numbers& numbers, std::vector<float>* parts) {
  const Patches& patches = numbers.patches;
  for (size_t point = 0; point + 1 < patches.group_starts.size(); ++point) {
    Vec mean = {};
    const uint32_t begin = patches.group_starts[point], end = patches.group_starts[point + 1];
    for (uint32_t i = begin; i < end; ++i) {
      for (size_t a = 0; a < 3; ++a) mean[a] += numbers.positions[3 * patches.vertices[i] + a] / (end - begin);
    }
    std::array<double, 4> weights = {};
    double sum = 0;
    for (double& weight : weights) sum += weight = writer->Uniform(0, 1);
    for (const double weight : weights) {
      for (const double place : mean) parts->push_back(static_cast<float>(weight / sum * place));
      parts->push_back(static_cast<float>(weight / sum));
    }
  }
}

// Near the joints, long enough to have a side. Every second one begins where the one before ends, as a shank at a knee.
std::vector<float> RandomCapsules(const ModelSpec& spec, TensorWriter* writer, const Numbers& numbers) {
  std::vector<float> capsules;
  for (uint32_t c = 0; c < spec.capsules; ++c) {
    const Vec& joint = numbers.joint_positions[numbers.patches.capsule_joints[c]];
    const Vec way = RandomVec(0.1, 0.3, writer);
    const size_t before = capsules.size() - 5;  // the second end
    for (size_t a = 0; a < 3; ++a) capsules.push_back(c % 2 == 1 ? capsules[before + a] : static_cast<float>(joint[a]));
    for (size_t a = 0; a < 3; ++a) capsules.push_back(capsules[8 * c + a] - static_cast<float>(way[a]));
    for (int end = 0; end < 2; ++end) capsules.push_back(static_cast<float>(writer->Uniform(0.04, 0.12)));
  }
  return capsules;
}

// Different points for each group, its own first.
std::vector<uint16_t> RandomSources(const ModelSpec& spec, TensorWriter* writer) {
  const uint32_t points = spec.patches * spec.patch_points;
  std::vector<uint16_t> sources;
  for (uint32_t point = 0; point < points; ++point) {
    std::vector<uint16_t> own = {static_cast<uint16_t>(point)};
    while (own.size() < spec.sources) {
      const auto other = static_cast<uint16_t>(writer->Uniform(0, points - 0.001));
      if (std::find(own.begin(), own.end(), other) == own.end()) own.push_back(other);
    }
    sources.insert(sources.end(), own.begin(), own.end());
  }
  return sources;
}

void AddNetwork(const ModelSpec& spec, TensorWriter* writer, Patches* patches, format::PatchStageT* stage) {
  const uint32_t r = spec.patch_points, width = spec.patch_width, inputs = 19 * r + 33 + spec.embedding;
  const LinearKind kind = {.row_scales = false};
  stage->enter = writer->RandomLinear(inputs, width, 1.0, 0.2, &patches->enter, kind);
  for (uint32_t l = 0; l < spec.mixes; ++l) {
    patches->mix.emplace_back();
    stage->mix.push_back(
        writer->RandomLinear((1 + spec.patch_neighbours) * width, width, 1.0, 0.1, &patches->mix.back(), kind));
  }
  stage->input_gates = writer->RandomLinear(width, 3 * width, 1.0, 0.3, &patches->input_gates, kind);
  stage->hidden_gates = writer->RandomLinear(width, 3 * width, 0.25, 0, &patches->hidden_gates, kind);
  stage->out = writer->RandomLinear(width + inputs, 3 * r, 0.5, 0.1, &patches->out, kind);
}

// Zeros fill up each group's last panel.
void AddMap(const ModelSpec& spec, TensorWriter* writer, Patches* patches, format::PatchStageT* stage) {
  LinearKind kind = {.row_scales = false};
  size_t columns = 0;
  for (size_t point = 0; point + 1 < patches->group_starts.size(); ++point) {
    const size_t own = size_t{3} * (patches->group_starts[point + 1] - patches->group_starts[point]);
    const size_t padded = kernels::PaddedColumns(own);
    for (size_t c = own; c < padded; ++c) kind.zero_columns.insert(columns + c);
    columns += padded;
  }
  stage->map = writer->RandomLinear(3 * spec.sources, static_cast<uint32_t>(columns), 1.0, 0.02, &patches->map, kind);
}

}  // namespace

std::unique_ptr<format::PatchStageT> PatchStage(const ModelSpec& spec, TensorWriter* writer, Numbers* numbers) {
  auto stage = std::make_unique<format::PatchStageT>();
  Patches& patches = numbers->patches;
  const uint32_t k = spec.patches, r = spec.patch_points, points = k * r;
  stage->patches = static_cast<uint16_t>(k);
  stage->points = static_cast<uint8_t>(r);
  stage->width = static_cast<uint16_t>(spec.patch_width);
  stage->neighbours = static_cast<uint8_t>(spec.patch_neighbours);
  stage->joints = writer->RandomBytes({k}, spec.joints, &patches.joints);
  std::vector<float> axes, parts;
  for (uint32_t patch = 0; patch < k; ++patch) {
    for (const double value : RandomAxes(writer)) axes.push_back(static_cast<float>(value));
  }
  stage->axes = writer->Floats({k, 9}, axes, &patches.axes);
  stage->centres = writer->RandomFloats({k, 3}, 0.1, 0.9, &patches.centres);
  AddGroups(spec, &patches);
  stage->point_joints = writer->RandomBytes({points, 4}, spec.joints, &patches.point_joints);
  AddPoints(writer, *numbers, &parts);
  stage->point_parts = writer->Floats({points, 16}, parts, &patches.point_parts);
  stage->capsule_joints = writer->RandomBytes({spec.capsules}, spec.joints, &patches.capsule_joints);
  stage->capsules = writer->Floats({spec.capsules, 8}, RandomCapsules(spec, writer, *numbers), &patches.capsules);
  stage->limbs = writer->RandomBytes({k, 4}, spec.capsules, &patches.limbs);
  if (spec.patch_neighbours != 0)
    stage->near = writer->RandomBytes({spec.mixes * spec.patch_neighbours, k}, k, &patches.near);
  if (spec.embedding != 0) stage->embedding = writer->RandomFloats({k, spec.embedding}, -1, 1, &patches.embedding);
  AddNetwork(spec, writer, &patches, stage.get());
  stage->keep = writer->RandomFloats({r}, 0.3, 0.9, &patches.keep);
  patches.sources = RandomSources(spec, writer);
  stage->sources = writer->Add(format::DType_U16, {points, spec.sources}, patches.sources);
  stage->vertices = writer->Add(format::DType_U16, {static_cast<uint32_t>(numbers->n)}, patches.vertices);
  stage->group_starts = writer->Add(format::DType_U32, {points + 1}, patches.group_starts);
  AddMap(spec, writer, &patches, stage.get());
  return stage;
}

}  // namespace dcloth::testing

#include "converter/bundle_patches.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "converter/error.h"
#include "engine/format/limits.h"

namespace dcloth::converter {
namespace {

constexpr uint64_t kAny = TensorReader::kAny;

// An extent that the tensor defines.
uint32_t Extent(TensorReader* reader, const std::string& name, const Shape& shape, const char* names, size_t axis,
                const char* what, uint64_t most) {
  const uint64_t found = reader->Take(name, shape, names).shape[axis];
  if (found > most) reader->Refuse(name, std::to_string(found) + " " + what, "1 to " + std::to_string(most));
  return static_cast<uint32_t>(found);
}

// Rounding to half floats moves a length by less.
void RequireUnitAxes(const TensorReader& reader, const Matrix& axes) {
  constexpr float kTolerance = 0.002f;
  for (Eigen::Index k = 0; k < axes.rows(); ++k) {
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      const float length = std::hypot(axes(k, axis), axes(k, 3 + axis), axes(k, 6 + axis));
      if (std::abs(length - 1) <= kTolerance) continue;
      reader.Refuse("patch.axes",
                    "a column of length " + NumberText(static_cast<double>(length)) + " in patch " + std::to_string(k),
                    "columns of length 1: out, up, along");
    }
  }
}

void ReadFrames(TensorReader* reader, uint64_t joints, PatchWeights* patches) {
  patches->patch_count = Extent(reader, "patch.joints", {kAny}, "[K]", 0, "patches", format::kMaxPatches);
  const uint64_t k = patches->patch_count;
  patches->joints = reader->TakeIndices("patch.joints", {k}, "[K]", joints);
  patches->axes = reader->TakeRows("patch.axes", {k, 3, 3}, "[K, 3, 3]");
  RequireUnitAxes(*reader, patches->axes);
  patches->centres = reader->TakeMatrix("patch.centres", k, 3, "[K, 3]");
  const std::string point_joints = "patch.point_joints";
  patches->point_count =
      Extent(reader, point_joints, {k, kAny, 4}, "[K, R, 4]", 1, "points of a patch", format::kMaxPatchPoints);
  const uint64_t r = patches->point_count;
  patches->point_joints = reader->TakeIndices(point_joints, {k, r, 4}, "[K, R, 4]", joints);
  patches->point_parts = reader->TakeRows("patch.point_parts", {k, r, 4, 4}, "[K, R, 4, 4]");
  patches->point_parts.resize(static_cast<Eigen::Index>(k * r), 16);
}

void ReadLimbs(TensorReader* reader, uint64_t joints, PatchWeights* patches) {
  const std::string name = "patch.capsule_joints";
  const uint64_t c = Extent(reader, name, {kAny}, "[C]", 0, "capsules", format::kMaxCapsules);
  patches->capsule_joints = reader->TakeIndices(name, {c}, "[C]", joints);
  patches->capsules = reader->TakeMatrix("patch.capsules", c, 8, "[C, 8]");
  for (Eigen::Index i = 0; i < patches->capsules.rows(); ++i) {
    if (patches->capsules.row(i).tail<2>().minCoeff() < 0)
      reader->Refuse("patch.capsules", "a radius below 0 in capsule " + std::to_string(i), "0 or more");
  }
  patches->limbs = reader->TakeIndices("patch.limbs", {patches->patch_count, 2, 2}, "[K, 2, 2]", c);
}

void ReadNetwork(TensorReader* reader, PatchWeights* patches) {
  const uint64_t k = patches->patch_count, r = patches->point_count;
  if (reader->Has("patch.embedding")) {
    const std::string name = "patch.embedding";
    const uint32_t numbers = Extent(reader, name, {k, kAny}, "[K, E]", 1, "numbers of a patch", format::kMaxEmbedding);
    patches->embedding = reader->TakeMatrix(name, k, numbers, "[K, E]");
  }
  const uint64_t inputs =
      format::PatchInputs(static_cast<uint32_t>(r), static_cast<uint32_t>(patches->embedding.cols()));
  patches->enter = reader->TakeLinear("patch.enter", kAny, inputs, "[W, I] with I = 19 R + 33 + E");
  const auto width = static_cast<uint64_t>(patches->enter.weight.rows());
  if (width % format::kPatchWidthStep != 0 || width > format::kMaxPatchWidth) {
    reader->Refuse("patch.enter.weight", "width " + std::to_string(width), "a multiple of 8 from 8 to 256");
  }
  if (reader->Has("patch.near")) {
    patches->neighbour_count = Extent(reader, "patch.near", {kAny, kAny, k}, "[L, S, K]", 1, "neighbours of a patch",
                                      format::kMaxPatchNeighbours);
  }
  const uint64_t neighbours = patches->neighbour_count;
  while (reader->Has("patch.mix." + std::to_string(patches->mix.size()) + ".") || patches->mix.empty()) {
    const std::string name = "patch.mix." + std::to_string(patches->mix.size());
    if (patches->mix.size() == format::kMaxMixes) reader->Refuse(name + ".weight", "more than 8 layers", "1 to 8");
    patches->mix.push_back(reader->TakeLinear(name, width, (1 + neighbours) * width, "[W, (1 + S) W]"));
  }
  if (neighbours != 0)
    patches->near = reader->TakeIndices("patch.near", {patches->mix.size(), neighbours, k}, "[L, S, K]", k);
  patches->input_gates.weight = reader->TakeMatrix("patch.gates.weight_ih", 3 * width, width, "[3 W, W]");
  patches->input_gates.bias = reader->TakeVector("patch.gates.bias", 3 * width, "[3 W]");
  patches->hidden_gates.weight = reader->TakeMatrix("patch.gates.weight_hh", 3 * width, width, "[3 W, W]");
  patches->out = reader->TakeLinear("patch.out", 3 * r, width + inputs, "[3 R, W + I]");
  patches->keep = reader->TakeVector("patch.keep", r, "[R]");
  for (const float share : patches->keep) {
    if (!(share >= 0 && share <= 1))
      reader->Refuse("patch.keep", NumberText(static_cast<double>(share)), "shares from 0 to 1");
  }
}

void ReadSources(TensorReader* reader, PatchWeights* patches) {
  const uint64_t points = uint64_t{patches->patch_count} * patches->point_count;
  const std::string name = "patch.map.sources";
  const uint32_t count = Extent(reader, name, {points, kAny}, "[K R, M]", 1, "sources of a point", format::kMaxSources);
  if (count % 2 != 0) reader->Refuse(name, std::to_string(count) + " sources of a point", "an even number");
  patches->source_count = count;
  patches->sources = reader->TakeIndices(name, {points, count}, "[K R, M]", points);
  for (uint64_t point = 0; point < points; ++point) {
    const uint32_t* const own = patches->sources.data() + point * count;
    for (uint32_t m = 1; m < count; ++m) {
      if (std::find(own, own + m, own[m]) == own + m) continue;
      reader->Refuse(name, "point " + std::to_string(own[m]) + " twice for point " + std::to_string(point),
                     "different points");
    }
  }
}

void ReadMap(TensorReader* reader, uint64_t n, PatchWeights* patches) {
  const uint64_t points = uint64_t{patches->patch_count} * patches->point_count;
  ReadSources(reader, patches);
  const std::string name = "patch.map.groups";
  const std::vector<uint32_t> of_vertex = reader->TakeIndices(name, {n}, "[n]", points);
  patches->groups.resize(points);
  for (uint32_t v = 0; v < n; ++v) patches->groups[of_vertex[v]].push_back(v);
  for (uint64_t point = 0; point < points; ++point) {
    if (patches->groups[point].empty())
      reader->Refuse(name, "no vertex of point " + std::to_string(point), "at least one vertex of each point");
  }
  patches->map = reader->TakeRows("patch.map.weights", {n, patches->source_count, 3, 3}, "[n, M, 3, 3]");
  patches->offsets = reader->TakeMatrix("patch.map.offsets", n, 3, "[n, 3]");
}

}  // namespace

PatchWeights ReadPatches(TensorReader* reader, uint64_t vertices, uint64_t joints) {
  PatchWeights patches;
  ReadFrames(reader, joints, &patches);
  ReadLimbs(reader, joints, &patches);
  ReadNetwork(reader, &patches);
  ReadMap(reader, vertices, &patches);
  return patches;
}

}  // namespace dcloth::converter

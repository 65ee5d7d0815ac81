#include "tests/unit/converter/bundle_builder.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <numbers>
#include <span>
#include <stdexcept>

#include "kernels/half.h"

namespace dcloth::testing {
namespace {

using converter::SafeType;
using converter::Shape;

// SplitMix64 (Steele, Lea, Flood 2014): the same numbers with every standard library.
class Random {
 public:
  explicit Random(uint64_t seed) : state_(seed) {}
  float Uniform(float low, float high) {
    state_ += 0x9E3779B97F4A7C15u;
    uint64_t z = state_;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    return low + (high - low) * (static_cast<float>((z ^ (z >> 31)) >> 40) * 0x1p-24f);
  }
  std::vector<float> Values(const Shape& shape, float size) {
    size_t count = 1;
    for (const uint64_t extent : shape) count *= extent;
    std::vector<float> values(count);
    for (float& value : values) value = Uniform(-size, size);
    return values;
  }

 private:
  uint64_t state_;
};

std::vector<std::byte> FloatBytes(const std::vector<float>& values) {
  const auto bytes = std::as_bytes(std::span(values));
  return {bytes.begin(), bytes.end()};
}

std::string JointName(uint32_t joint) { return "joint_" + std::to_string(joint); }

constexpr float kJointSpacing = 0.15f;  // metres
constexpr float kTop = 1.0f;            // height of joint 0

// A chain that hangs down, each joint turned a little, so that no inverse is trivial.
Eigen::Matrix4f BindMatrix(uint32_t joint) {
  Eigen::Affine3f bind =
      Eigen::Translation3f(0.02f * static_cast<float>(joint % 3), kTop - kJointSpacing * static_cast<float>(joint), 0) *
      Eigen::AngleAxisf(0.1f * static_cast<float>(joint), Eigen::Vector3f::UnitX());
  return bind.matrix();
}

void Put(RawTensor tensor, std::vector<RawTensor>* tensors) {
  for (RawTensor& old : *tensors) {
    if (old.name != tensor.name) continue;
    old = std::move(tensor);
    return;
  }
  tensors->push_back(std::move(tensor));
}

class Builder {
 public:
  Builder(const BundleSpec& spec) : spec_(spec), random_(spec.seed) {}  // NOLINT: local

  RawFile Build() {
    Metadata();
    Template();
    Character();
    Features();
    Static();
    if (spec_.patches != 0) {
      Patches();
      return std::move(file_);
    }
    if (spec_.skeleton) Skeleton();
    if (spec_.mesh) Mesh();
    return std::move(file_);
  }

 private:
  void Add(const std::string& name, const Shape& shape, const std::vector<float>& values, bool trained = true) {
    RawTensor tensor{name, SafeType::kF32, shape, {}};
    if (trained && spec_.half_weights) {
      tensor.type = SafeType::kF16;
      std::vector<uint16_t> halves;
      for (const float value : values) halves.push_back(kernels::HalfFromFloat(value));
      const auto bytes = std::as_bytes(std::span(halves));
      tensor.bytes.assign(bytes.begin(), bytes.end());
    } else {
      tensor.bytes = FloatBytes(values);
    }
    file_.tensors.push_back(std::move(tensor));
  }
  void AddRandom(const std::string& name, const Shape& shape, float size) {
    Add(name, shape, random_.Values(shape, size));
  }

  // PyTorch's own start: uniform within 1 / sqrt(inputs).
  void AddLinear(const std::string& name, uint64_t out, uint64_t in) {
    const float size = 1 / std::sqrt(static_cast<float>(in));
    AddRandom(name + ".weight", {out, in}, size);
    AddRandom(name + ".bias", {out}, size);
  }

  void AddFaces(const std::string& name, const std::vector<int32_t>& corners) {
    AddIntegers(name, {corners.size() / 3, 3}, corners);
  }
  void AddIntegers(const std::string& name, const Shape& shape, const std::vector<int32_t>& values) {
    const auto bytes = std::as_bytes(std::span(values));
    file_.tensors.push_back({name, SafeType::kI32, shape, {bytes.begin(), bytes.end()}});
  }
  void AddIndices(const std::string& name, const Shape& shape, uint32_t limit) {
    std::vector<int32_t> indices;
    for (const float value : random_.Values(shape, 0.5f))
      indices.push_back(
          std::min(static_cast<int32_t>((value + 0.5f) * static_cast<float>(limit)), static_cast<int32_t>(limit) - 1));
    AddIntegers(name, shape, indices);
  }

  std::vector<float> SkinRows(uint64_t rows, uint64_t columns) {
    std::vector<float> weights(rows * columns);
    for (uint64_t i = 0; i < rows; ++i) {
      float sum = 0;
      for (uint64_t j = 0; j < columns; ++j) {
        // Squared twice: a few strong influences and a weak tail, as in real skins.
        const float u = random_.Uniform(0, 1);
        sum += weights[i * columns + j] = u * u * u * u + 1e-4f;
      }
      for (uint64_t j = 0; j < columns; ++j) weights[i * columns + j] /= sum;
    }
    return weights;
  }

  void Metadata() {
    std::vector<std::string> names, features, bones;
    for (uint32_t j = 0; j < spec_.joints; ++j) names.push_back(JointName(j));
    features.assign(names.begin(), names.begin() + spec_.feature_joints);
    bones.assign(names.end() - spec_.bones, names.end());
    file_.metadata = {{"format", "dcloth-bundle"},
                      {"format_version", "1"},
                      {"garment", "tube"},
                      {"tick_rate", "30"},
                      {"joint_names", nlohmann::json(names).dump()},
                      {"hips", names[0]},
                      {"feature_joints", nlohmann::json(features).dump()},
                      {"root_motion", spec_.root_motion == converter::RootMotion::kAir    ? "air"
                                      : spec_.root_motion == converter::RootMotion::kHips ? "true"
                                                                                          : "false"},
                      {"bones", nlohmann::json(bones).dump()},
                      {"training", R"({"licence": "none, random numbers"})"}};
  }

  // One vertex after another winds down a tube; each joins the next one and those a turn below.
  void Template() {
    const uint32_t n = spec_.vertices;
    const auto ring = static_cast<uint32_t>(std::max(3.0, std::floor(std::sqrt(n))));
    std::vector<float> positions, nearest;
    std::vector<int32_t> corners;
    for (uint32_t i = 0; i < n; ++i) {
      const double angle = 2 * std::numbers::pi * i / ring, height = 0.9 - 0.6 * i / n;
      for (const double radius : {0.25, 0.18}) {
        std::vector<float>& points = radius == 0.25 ? positions : nearest;
        points.insert(points.end(), {static_cast<float>(radius * std::cos(angle)), static_cast<float>(height),
                                     static_cast<float>(radius * std::sin(angle))});
      }
      const auto a = static_cast<int32_t>(i), below = static_cast<int32_t>(i + ring);
      if (i + ring < n) corners.insert(corners.end(), {a, a + 1, below});
      if (i + ring + 1 < n) corners.insert(corners.end(), {a + 1, below + 1, below});
    }
    Add("template.positions", {n, 3}, positions, false);
    AddFaces("template.faces", corners);
    if (spec_.mesh && spec_.patches == 0) Add("nearest.points", {n, 3}, nearest, false);
  }

  void Character() {
    std::vector<float> bind;
    for (uint32_t j = 0; j < spec_.joints; ++j) {
      const Eigen::Matrix<float, 4, 4, Eigen::RowMajor> matrix = BindMatrix(j);
      bind.insert(bind.end(), matrix.data(), matrix.data() + 16);
    }
    const uint32_t b = spec_.body_vertices;
    Add("character.bind", {spec_.joints, 4, 4}, bind, false);
    Add("body.positions", {b, 3}, random_.Values({b, 3}, 0.2f), false);
    std::vector<int32_t> corners;
    for (int32_t i = 0; i + 2 < static_cast<int32_t>(b); ++i) corners.insert(corners.end(), {i, i + 1, i + 2});
    AddFaces("body.faces", corners);
    Add("body.joint_weights", {b, spec_.joints}, SkinRows(b, spec_.joints), false);
    if (spec_.mesh && spec_.patches == 0)
      Add("nearest.joint_weights", {spec_.vertices, spec_.joints}, SkinRows(spec_.vertices, spec_.joints), false);
  }

  void Features() {
    const uint64_t d = spec_.features();
    Add("features.mean", {d}, random_.Values({d}, 0.3f), false);
    std::vector<float> deviation(d), low(d), high(d);
    for (uint64_t i = 0; i < d; ++i) {
      deviation[i] = random_.Uniform(0.2f, 1.0f);
      low[i] = random_.Uniform(-3, -2);
      high[i] = random_.Uniform(2, 3);
    }
    Add("features.deviation", {d}, deviation, false);
    Add("features.low", {d}, low, false);
    Add("features.high", {d}, high, false);
  }

  void Static() {
    const uint32_t n = spec_.vertices, m = spec_.bones;
    AddLinear("static.mlp.0", spec_.static_width, spec_.features());
    // Pivots move by centimetres.
    AddRandom("static.mlp.2.weight", {3 * uint64_t{m}, spec_.static_width}, 0.03f);
    AddRandom("static.mlp.2.bias", {3 * uint64_t{m}}, 0.01f);
    Add("static.initial_weights", {n, m}, SkinRows(n, m));
    AddRandom("static.residual_weights", {spec_.residuals, n, m}, 0.5f / static_cast<float>(m * (spec_.residuals + 1)));
  }

  void Skeleton() {
    const uint64_t k = spec_.skeleton_basis;
    const float size = 1 / std::sqrt(static_cast<float>(k));
    AddRandom("skeleton.gru.weight_ih", {3 * k, spec_.features()}, size);
    AddRandom("skeleton.gru.weight_hh", {3 * k, k}, size);
    AddRandom("skeleton.gru.bias_ih", {3 * k}, size);
    AddRandom("skeleton.gru.bias_hh", {3 * k}, size);
    AddRandom("skeleton.basis", {k, spec_.vertices, 3}, 0.05f * size);
  }

  void Mesh() {
    const uint64_t width = spec_.feature_width, k = spec_.mesh_basis;
    AddRandom("mesh.input_mean", {3}, 0.5f);
    Add("mesh.input_deviation", {3}, {0.2f, 0.4f, 0.3f});
    for (uint32_t l = 0; l < spec_.layers; ++l) {
      const std::string name = "mesh.layers." + std::to_string(l) + ".";
      const float size = 1 / std::sqrt(static_cast<float>(width));
      AddRandom(name + "w_p", {l == 0 ? 3 : width, width}, 0.5f);
      for (const char* square : {"w_z", "w_r", "w", "u_z", "u_r", "u", "w_o"})
        AddRandom(name + square, {width, width}, size);
      for (const char* row : {"b", "b_o", "norm.bias"}) AddRandom(name + row, {width}, 0.2f);
      std::vector<float> gain(width);
      for (float& value : gain) value = random_.Uniform(0.7f, 1.3f);
      Add(name + "norm.weight", {width}, gain);
      Add(name + "prelu", {1}, {random_.Uniform(0.1f, 0.4f)});
    }
    AddLinear("mesh.embed", 1, width);
    AddLinear("mesh.mlp.0", spec_.mesh_width, spec_.vertices);
    AddLinear("mesh.mlp.2", k, spec_.mesh_width);
    AddRandom("mesh.basis", {k, spec_.vertices, 3}, 0.02f / std::sqrt(static_cast<float>(k)));
  }

  // Runs of vertices, whose points stand where skinning puts their mean if all were on one joint.
  void Patches() {
    const uint64_t n = spec_.vertices, k = spec_.patches, r = spec_.patch_points, points = k * r, m = spec_.sources;
    const uint64_t inputs = 19 * r + 33 + spec_.embedding, width = spec_.patch_width, s = spec_.patch_neighbours;
    AddIndices("patch.joints", {k}, spec_.joints);
    std::vector<float> axes, parts, capsules, keep(r);
    for (uint64_t patch = 0; patch < k; ++patch) {
      const Eigen::Vector3f axis(random_.Uniform(0.1f, 1), random_.Uniform(0.1f, 1), random_.Uniform(0.1f, 1));
      const Eigen::Matrix<float, 3, 3, Eigen::RowMajor> turn =
          Eigen::AngleAxisf(random_.Uniform(0.5f, 2.5f), axis.normalized()).toRotationMatrix();
      axes.insert(axes.end(), turn.data(), turn.data() + 9);
    }
    Add("patch.axes", {k, 3, 3}, axes, false);
    Add("patch.centres", {k, 3}, random_.Values({k, 3}, 0.5f), false);
    AddIndices("patch.point_joints", {k, r, 4}, spec_.joints);
    for (uint64_t part = 0; part < 4 * points; ++part) {
      const float weight = part % 4 == 0 ? 0.7f : 0.1f;
      for (int axis = 0; axis < 3; ++axis) parts.push_back(weight * random_.Uniform(0.1f, 0.9f));
      parts.push_back(weight);
    }
    Add("patch.point_parts", {k, r, 4, 4}, parts, false);
    AddIndices("patch.capsule_joints", {spec_.capsules}, spec_.joints);
    for (uint32_t c = 0; c < spec_.capsules; ++c) {
      for (int coordinate = 0; coordinate < 6; ++coordinate) capsules.push_back(random_.Uniform(0.1f, 0.9f));
      for (int end = 0; end < 2; ++end) capsules.push_back(random_.Uniform(0.05f, 0.1f));
    }
    Add("patch.capsules", {spec_.capsules, 8}, capsules, false);
    AddIndices("patch.limbs", {k, 2, 2}, spec_.capsules);
    if (s != 0) AddIndices("patch.near", {spec_.patch_layers, s, k}, spec_.patches);
    if (spec_.embedding != 0) AddRandom("patch.embedding", {k, spec_.embedding}, 1);
    AddLinear("patch.enter", width, inputs);
    for (uint32_t l = 0; l < spec_.patch_layers; ++l)
      AddLinear("patch.mix." + std::to_string(l), width, (1 + s) * width);
    const float size = 1 / std::sqrt(static_cast<float>(width));
    AddRandom("patch.gates.weight_ih", {3 * width, width}, size);
    AddRandom("patch.gates.weight_hh", {3 * width, width}, size);
    AddRandom("patch.gates.bias", {3 * width}, size);
    AddLinear("patch.out", 3 * r, width + inputs);
    for (float& share : keep) share = random_.Uniform(0.3f, 0.9f);
    Add("patch.keep", {r}, keep);
    std::vector<int32_t> sources, groups;
    for (uint64_t point = 0; point < points; ++point) {
      for (uint64_t i = 0; i < m; ++i) sources.push_back(static_cast<int32_t>((point + 5 * i) % points));
    }
    for (uint64_t v = 0; v < n; ++v) groups.push_back(static_cast<int32_t>(v * 7 % n * points / n));
    AddIntegers("patch.map.sources", {points, m}, sources);
    AddIntegers("patch.map.groups", {n}, groups);
    AddRandom("patch.map.weights", {n, m, 3, 3}, 1 / static_cast<float>(m));
    AddRandom("patch.map.offsets", {n, 3}, 0.01f);
  }

  const BundleSpec& spec_;
  Random random_;
  RawFile file_;
};

std::vector<converter::SafeTensor> Views(const RawFile& file) {
  std::vector<converter::SafeTensor> views;
  for (const RawTensor& tensor : file.tensors) views.push_back({tensor.name, tensor.type, tensor.shape, tensor.bytes});
  return views;
}

}  // namespace

RawTensor& RawFile::At(std::string_view name) {
  for (RawTensor& tensor : tensors) {
    if (tensor.name == name) return tensor;
  }
  throw std::out_of_range(std::string(name));
}

void RawFile::Erase(std::string_view name) {
  const RawTensor* const tensor = &At(name);
  tensors.erase(tensors.begin() + (tensor - tensors.data()));
}

void RawFile::SetFloat(std::string_view name, size_t index, float value) {
  RawTensor& tensor = At(name);
  if (tensor.type != SafeType::kF32 || 4 * index + 4 > tensor.bytes.size()) throw std::out_of_range(std::string(name));
  std::memcpy(tensor.bytes.data() + 4 * index, &value, 4);
}

void RawFile::SetInt(std::string_view name, size_t index, int32_t value) {
  RawTensor& tensor = At(name);
  if (tensor.type != SafeType::kI32 || 4 * index + 4 > tensor.bytes.size()) throw std::out_of_range(std::string(name));
  std::memcpy(tensor.bytes.data() + 4 * index, &value, 4);
}

void RawFile::Replace(std::string_view name, Shape shape, const std::vector<float>& values) {
  Put(RawTensor{std::string(name), SafeType::kF32, std::move(shape), FloatBytes(values)}, &tensors);
}

void RawFile::SetMasks(std::string_view name, const std::vector<int32_t>& masks) {
  const auto bytes = std::as_bytes(std::span(masks));
  Put(RawTensor{std::string(name), SafeType::kI32, {masks.size()}, {bytes.begin(), bytes.end()}}, &tensors);
}

converter::AlignedBytes RawFile::Bytes() const {
  const std::string header = converter::SafeHeader(Views(*this), metadata);
  const uint64_t size = header.size();
  converter::AlignedBytes bytes;
  auto append = [&](std::span<const std::byte> more) { bytes.insert(bytes.end(), more.begin(), more.end()); };
  append(std::as_bytes(std::span(&size, 1)));
  append(std::as_bytes(std::span(header)));
  for (const RawTensor& tensor : tensors) append(tensor.bytes);
  return bytes;
}

void RawFile::Write(const std::filesystem::path& path) const {
  converter::WriteSafetensors(path, Views(*this), metadata);
}

RawFile BuildBundle(const BundleSpec& spec) { return Builder(spec).Build(); }

RawFile BuildSequence(const BundleSpec& spec, uint32_t frames, bool truth, double fps) {
  std::vector<std::string> names;
  for (uint32_t j = 0; j < spec.joints; ++j) names.push_back(JointName(j));
  std::vector<float> matrices, positions;
  for (uint32_t frame = 0; frame < frames; ++frame) {
    const float t = static_cast<float>(frame / fps);
    // A curve of 1 m radius, one turn in 6.3 s, facing along it.
    Eigen::Affine3f parent = Eigen::Translation3f(std::cos(t), 0.03f * std::sin(9 * t), std::sin(t)) *
                             Eigen::AngleAxisf(-t, Eigen::Vector3f::UnitY());
    Eigen::Affine3f bind_parent = Eigen::Affine3f::Identity();
    for (uint32_t j = 0; j < spec.joints; ++j) {
      const Eigen::Affine3f bind(BindMatrix(j));
      const float swing = 0.3f * std::sin(5 * t + static_cast<float>(j));
      parent = parent * (bind_parent.inverse() * bind) *
               Eigen::AngleAxisf(swing, Eigen::Vector3f(1, 0.3f, 0.2f * static_cast<float>(j % 4)).normalized());
      bind_parent = bind;
      Eigen::Matrix<float, 4, 4, Eigen::RowMajor> world = parent.matrix();
      world.row(3) << 0, 0, 0, 1;
      matrices.insert(matrices.end(), world.data(), world.data() + 16);
    }
    for (uint32_t i = 0; truth && i < spec.vertices; ++i) {
      const float angle = 0.7f * static_cast<float>(i);
      positions.insert(positions.end(),
                       {std::cos(t) + 0.25f * std::cos(angle), 0.6f, std::sin(t) + 0.25f * std::sin(angle)});
    }
  }
  RawFile file;
  file.metadata = {{"joint_names", nlohmann::json(names).dump()}, {"fps", nlohmann::json(fps).dump()}};
  file.Replace("joint_matrices", {frames, spec.joints, 4, 4}, matrices);
  if (truth) file.Replace("truth", {frames, spec.vertices, 3}, positions);
  return file;
}

converter::Bundle ParseRawBundle(const RawFile& raw) {
  return converter::BundleFrom(converter::SafeFile::Parse(raw.Bytes(), "b.safetensors"));
}

converter::Bundle ParseBundle(const BundleSpec& spec) { return ParseRawBundle(BuildBundle(spec)); }

converter::Sequence ParseRawSequence(const RawFile& raw) {
  return converter::SequenceFrom(converter::SafeFile::Parse(raw.Bytes(), "s.safetensors"));
}

converter::Sequence ParseSequence(const BundleSpec& spec, uint32_t frames, double fps) {
  return ParseRawSequence(BuildSequence(spec, frames, false, fps));
}

}  // namespace dcloth::testing

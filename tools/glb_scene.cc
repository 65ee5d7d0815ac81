#include "tools/glb_scene.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cstring>

#include "tools/json_output.h"

namespace dcloth::tools {
namespace {

enum Component : int { kUnsignedShort = 5123, kUnsignedInt = 5125, kFloat = 5126 };

// The binary chunk, with a view and an accessor for each array in it.
class Arrays {
 public:
  template <typename T>
  size_t Add(std::span<const T> values, Component component, const char* type, size_t per_element,
             bool bounds = false) {
    bytes_.resize((bytes_.size() + 3) / 4 * 4);
    const size_t offset = bytes_.size(), size = values.size_bytes();
    bytes_.resize(offset + size);
    if (size != 0) std::memcpy(bytes_.data() + offset, values.data(), size);
    views_.push_back({{"buffer", 0}, {"byteOffset", offset}, {"byteLength", size}});
    Json accessor = {{"bufferView", views_.size() - 1},
                     {"componentType", static_cast<int>(component)},
                     {"count", values.size() / per_element},
                     {"type", type}};
    if (bounds && !values.empty()) {
      std::vector<T> low(values.begin(), values.begin() + static_cast<ptrdiff_t>(per_element)), high = low;
      for (size_t i = 0; i < values.size(); ++i) {
        low[i % per_element] = std::min(low[i % per_element], values[i]);
        high[i % per_element] = std::max(high[i % per_element], values[i]);
      }
      accessor["min"] = low;
      accessor["max"] = high;
    }
    accessors_.push_back(std::move(accessor));
    return accessors_.size() - 1;
  }
  size_t Floats(std::span<const float> values, const char* type, size_t per_element, bool bounds = false) {
    return Add(values, kFloat, type, per_element, bounds);
  }

  const Json& views() const { return views_; }
  const Json& accessors() const { return accessors_; }
  const std::string& bytes() const { return bytes_; }

 private:
  Json views_ = Json::array(), accessors_ = Json::array();
  std::string bytes_;
};

using RowMajor = Eigen::Matrix<float, 4, 4, Eigen::RowMajor>;

Eigen::Matrix4d MatrixAt(std::span<const float> matrices, size_t index) {
  return Eigen::Map<const RowMajor>(matrices.data() + 16 * index).cast<double>();
}

void AppendWord(uint32_t word, std::string* out) {
  for (int i = 0; i < 4; ++i) out->push_back(static_cast<char>(word >> (8 * i) & 0xFF));
}

void AppendChunk(const char* kind, std::string bytes, char pad, std::string* out) {
  bytes.resize((bytes.size() + 3) / 4 * 4, pad);
  AppendWord(static_cast<uint32_t>(bytes.size()), out);
  out->append(kind, 4);
  out->append(bytes);
}

}  // namespace

std::string GlbBytes(const GlbScene& scene) {
  const size_t frames = scene.frame_count, joint_count = scene.joints.size();
  Arrays arrays;
  std::vector<float> times(frames);
  for (size_t f = 0; f < frames; ++f) times[f] = static_cast<float>(static_cast<double>(f) / scene.fps);
  const size_t time = arrays.Floats(times, "SCALAR", 1, true);
  Json nodes = Json::array(), channels = Json::array(), samplers = Json::array(), meshes = Json::array();
  const auto animate = [&](size_t node, const char* path, size_t output, const char* how) {
    samplers.push_back({{"input", time}, {"output", output}, {"interpolation", how}});
    channels.push_back({{"sampler", samplers.size() - 1}, {"target", {{"node", node}, {"path", path}}}});
  };
  Json roots = Json::array();

  // Joints all hang on the scene itself: a joint's matrix to world is its own transform. Scales stay those of the bind
  // pose.
  std::vector<float> inverse;
  for (size_t j = 0; j < joint_count; ++j) {
    const Eigen::Matrix4d bind = MatrixAt(scene.bind, j);
    const Eigen::Matrix4f inverted = bind.inverse().cast<float>();  // stored by columns, as glTF wants it
    inverse.insert(inverse.end(), inverted.data(), inverted.data() + 16);
    std::vector<float> moves, turns;
    Eigen::Quaterniond before = Eigen::Quaterniond::Identity();
    for (size_t f = 0; f < frames; ++f) {
      const Eigen::Matrix4d pose = MatrixAt(scene.poses, f * joint_count + j);
      Eigen::Matrix3d linear = pose.topLeftCorner<3, 3>();
      for (int c = 0; c < 3; ++c) linear.col(c).normalize();
      Eigen::Quaterniond turn(linear);
      turn.normalize();
      if (turn.dot(before) < 0) turn.coeffs() = -turn.coeffs();  // players turn the short way
      before = turn;
      for (int a = 0; a < 3; ++a) moves.push_back(static_cast<float>(pose(a, 3)));
      for (const double q : {turn.x(), turn.y(), turn.z(), turn.w()}) turns.push_back(static_cast<float>(q));
    }
    const Eigen::Vector3d scale = bind.topLeftCorner<3, 3>().colwise().norm();
    nodes.push_back({{"name", scene.joints[j]},
                     {"translation", {moves[0], moves[1], moves[2]}},
                     {"rotation", {turns[0], turns[1], turns[2], turns[3]}},
                     {"scale", {scale[0], scale[1], scale[2]}}});
    roots.push_back(j);
    animate(j, "translation", arrays.Floats(moves, "VEC3", 3), "LINEAR");
    animate(j, "rotation", arrays.Floats(turns, "VEC4", 4), "LINEAR");
  }
  Json document = {{"asset", {{"version", "2.0"}, {"generator", "dcloth"}}}, {"scene", 0}};
  if (!scene.body.empty()) {
    const std::vector<uint16_t> influences(scene.influences.begin(), scene.influences.end());
    meshes.push_back({{"name", "body"},
                      {"primitives",
                       {{{"attributes",
                          {{"POSITION", arrays.Floats(scene.body, "VEC3", 3, true)},
                           {"JOINTS_0", arrays.Add(std::span<const uint16_t>(influences), kUnsignedShort, "VEC4", 4)},
                           {"WEIGHTS_0", arrays.Floats(scene.weights, "VEC4", 4)}}},
                         {"indices", arrays.Add(scene.body_triangles, kUnsignedInt, "SCALAR", 1)},
                         {"material", 0}}}}});
    Json skin_joints = Json::array();
    for (size_t j = 0; j < joint_count; ++j) skin_joints.push_back(j);
    document["skins"] = {{{"joints", skin_joints}, {"inverseBindMatrices", arrays.Floats(inverse, "MAT4", 16)}}};
    nodes.push_back({{"name", "body"}, {"mesh", 0}, {"skin", 0}});
    roots.push_back(nodes.size() - 1);
  }

  // The first frame is the mesh; target f takes it to frame f + 1.
  const size_t frame_size = scene.garment.size() / frames;
  const auto drawn = [&](size_t frame) {
    const auto positions = scene.garment.subspan(frame * frame_size, frame_size);
    std::vector<float> all(positions.begin(), positions.end());
    for (const uint16_t vertex : scene.seam_vertices) {
      const auto repeated = positions.subspan(size_t{3} * vertex, 3);
      all.insert(all.end(), repeated.begin(), repeated.end());
    }
    return all;
  };
  const std::vector<float> first = drawn(0);
  Json targets = Json::array();
  for (size_t f = 1; f < frames; ++f) {
    std::vector<float> moved = drawn(f);
    for (size_t i = 0; i < moved.size(); ++i) moved[i] -= first[i];
    targets.push_back({{"POSITION", arrays.Floats(moved, "VEC3", 3, true)}});
  }
  Json attributes = {{"POSITION", arrays.Floats(first, "VEC3", 3, true)}};
  if (!scene.texture_coordinates.empty())
    attributes["TEXCOORD_0"] = arrays.Floats(scene.texture_coordinates, "VEC2", 2);
  Json primitive = {{"attributes", attributes},
                    {"indices", arrays.Add(scene.garment_triangles, kUnsignedShort, "SCALAR", 1)},
                    {"material", 1}};
  if (frames > 1) primitive["targets"] = targets;
  meshes.push_back({{"name", "garment"}, {"primitives", {primitive}}});
  nodes.push_back({{"name", "garment"}, {"mesh", meshes.size() - 1}});
  roots.push_back(nodes.size() - 1);
  if (frames > 1) {
    std::vector<float> weights(frames * (frames - 1));
    for (size_t f = 1; f < frames; ++f) weights[f * (frames - 1) + f - 1] = 1;
    animate(nodes.size() - 1, "weights", arrays.Floats(weights, "SCALAR", 1), "LINEAR");
  }
  document["scenes"] = {{{"nodes", roots}}};
  document["nodes"] = nodes;
  document["meshes"] = meshes;
  document["materials"] = {
      {{"name", "body"}, {"pbrMetallicRoughness", {{"baseColorFactor", {0.6, 0.57, 0.54, 1}}, {"metallicFactor", 0}}}},
      {{"name", "garment"},
       {"doubleSided", true},
       {"pbrMetallicRoughness",
        {{"baseColorFactor", {0.56, 0.07, 0.05, 1}}, {"metallicFactor", 0}, {"roughnessFactor", 0.8}}}}};
  if (frames > 1) document["animations"] = {{{"name", scene.name}, {"channels", channels}, {"samplers", samplers}}};
  document["bufferViews"] = arrays.views();
  document["accessors"] = arrays.accessors();
  document["buffers"] = {{{"byteLength", (arrays.bytes().size() + 3) / 4 * 4}}};
  std::string chunks;
  AppendChunk("JSON", DumpJson(document, -1), ' ', &chunks);
  AppendChunk("BIN\0", arrays.bytes(), 0, &chunks);
  std::string out = "glTF";
  AppendWord(2, &out);
  AppendWord(static_cast<uint32_t>(12 + chunks.size()), &out);
  return out + chunks;
}

}  // namespace dcloth::tools

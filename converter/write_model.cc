#include "converter/write_model.h"

#include <algorithm>
#include <cstring>
#include <unordered_map>

#ifndef FLATBUFFERS_MAX_ALIGNMENT
#define FLATBUFFERS_MAX_ALIGNMENT 64  // FlatBuffers' own limit is 16
#endif
#include "converter/error.h"
#include "dcloth_generated.h"
#include "engine/format/checksum.h"
#include "engine/format/limits.h"

namespace dcloth::converter {
namespace {

namespace fb = flatbuffers;

constexpr uint64_t kTableRoom = uint64_t{16} << 20;  // tables and names stay far below
constexpr uint16_t kFormatMinor = 2, kFormatMinorOfIntegerLayers = 3, kFormatMinorOfTouch = 4, kFormatMinorOfOrders = 5,
                   kFormatMinorOfCoarse = 6, kFormatMinorOfTexture = 7, kFormatMinorOfPatches = 8;

// The first minor version that has all of a model's parts, so that libraries before this one open what they can run.
uint16_t FormatMinor(const ModelParts& parts) {
  if (parts.patches) return kFormatMinorOfPatches;
  if (parts.texture_coordinates) return kFormatMinorOfTexture;
  if (parts.coarse_vertices) return kFormatMinorOfCoarse;
  const bool orders = parts.body && parts.body->garment_order;
  if (parts.root_motion == RootMotion::kAir || orders || !parts.parents.empty()) return kFormatMinorOfOrders;
  if (parts.body && parts.body->touch_classes) return kFormatMinorOfTouch;
  const auto has_integers = [](const MeshLayerParts& layer) { return layer.weights.has_value(); };
  const bool integers = parts.mesh && std::any_of(parts.mesh->layers.begin(), parts.mesh->layers.end(), has_integers);
  return integers ? kFormatMinorOfIntegerLayers : kFormatMinor;
}

// Where each tensor lies in the weight vector.
struct Layout {
  std::unordered_map<const PackedTensor*, uint64_t> offsets;
  uint64_t size = 0;
};

Layout Arrange(const std::vector<const PackedTensor*>& tensors) {
  Layout layout;
  for (const PackedTensor* tensor : tensors) {
    layout.offsets[tensor] = layout.size;
    layout.size += (tensor->bytes.size() + format::kAlignment - 1) / format::kAlignment * format::kAlignment;
  }
  return layout;
}

// Keeps the place: FlatBuffers leaves out fields that hold their default.
constexpr uint64_t kNoIdentityYet = 1;

void SetIdentity(AlignedBytes* bytes) {
  auto* root = fb::GetMutableRoot<fb::Table>(bytes->data());
  root->SetField<uint64_t>(format::Model::VT_IDENTITY, 0);
  root->SetField<uint64_t>(format::Model::VT_IDENTITY, format::Checksum(bytes->data(), bytes->size()));
}

class Writer {
 public:
  Writer(const ModelParts& parts, uint64_t room) : parts_(parts), builder_(room) {}

  AlignedBytes Write() {
    const std::vector<const PackedTensor*> tensors = TensorsOf(parts_);
    layout_ = Arrange(tensors);
    const auto weights = Weights(tensors);
    const auto garment = Garment();
    const auto character = Character();
    const auto features = Features();
    const auto static_stage = Static();
    const auto skeleton = parts_.skeleton ? Skeleton(*parts_.skeleton) : fb::Offset<format::SkeletonStage>();
    const auto mesh = parts_.mesh ? Mesh(*parts_.mesh) : fb::Offset<format::MeshStage>();
    const auto displacement = parts_.basis ? Displacement(*parts_.basis) : fb::Offset<format::Displacement>();
    const auto body = parts_.body ? Body(*parts_.body) : fb::Offset<format::Body>();
    const auto patches = parts_.patches ? Patches(*parts_.patches) : fb::Offset<format::PatchStage>();
    const auto producer = String(parts_.producer);
    const auto precision = String(parts_.precision);
    const auto model = format::CreateModel(builder_, format::kFormatMajor, FormatMinor(parts_), producer, precision,
                                           parts_.tick_rate, garment, character, features, static_stage, skeleton, mesh,
                                           displacement, weights, kNoIdentityYet, body, patches);
    builder_.Finish(model, format::ModelIdentifier());
    AlignedBytes bytes(builder_.GetSize());
    std::memcpy(bytes.data(), builder_.GetBufferPointer(), bytes.size());
    SetIdentity(&bytes);
    return bytes;
  }

 private:
  // Children are made in named steps, never inside an argument list: its order of evaluation is the compiler's choice,
  // and the file's bytes must not depend on it.
  fb::Offset<fb::String> String(const std::string& text) { return builder_.CreateString(text); }

  fb::Offset<fb::Vector<uint8_t>> Weights(const std::vector<const PackedTensor*>& tensors) {
    builder_.ForceVectorAlignment(layout_.size, sizeof(uint8_t), format::kAlignment);
    uint8_t* weights = nullptr;
    const auto vector = builder_.CreateUninitializedVector(layout_.size, &weights);
    std::memset(weights, 0, layout_.size);
    for (const PackedTensor* tensor : tensors) {
      if (!tensor->bytes.empty())
        std::memcpy(weights + layout_.offsets[tensor], tensor->bytes.data(), tensor->bytes.size());
    }
    return vector;
  }

  fb::Offset<format::Tensor> Tensor(const PackedTensor& tensor) {
    const auto shape = builder_.CreateVector(tensor.report.shape);
    return format::CreateTensor(builder_, static_cast<format::DType>(tensor.type), shape, layout_.offsets.at(&tensor));
  }
  fb::Offset<format::Tensor> Tensor(const std::optional<PackedTensor>& tensor) {
    return tensor ? Tensor(*tensor) : fb::Offset<format::Tensor>();
  }

  fb::Offset<format::Linear> Linear(const PackedLinear& linear) {
    const auto weights = Tensor(linear.weights);
    const auto row_scales = Tensor(linear.row_scales);
    const auto column_scales = Tensor(linear.column_scales);
    const auto bias = Tensor(linear.bias);
    return format::CreateLinear(builder_, weights, row_scales, column_scales, bias);
  }

  fb::Offset<format::Garment> Garment() {
    const auto name = String(parts_.garment);
    const auto positions = Tensor(parts_.template_positions);
    const auto faces = Tensor(parts_.faces);
    const auto coarse_vertices = Tensor(parts_.coarse_vertices);
    const auto coarse_faces = Tensor(parts_.coarse_faces);
    const auto texture_coordinates = Tensor(parts_.texture_coordinates);
    const auto seam_vertices = Tensor(parts_.seam_vertices);
    const auto textured_faces = Tensor(parts_.textured_faces);
    return format::CreateGarment(builder_, name, parts_.vertices, positions, faces, coarse_vertices, coarse_faces,
                                 texture_coordinates, seam_vertices, textured_faces);
  }

  fb::Offset<format::Character> Character() {
    const auto names = builder_.CreateVectorOfStrings(parts_.joint_names);
    const auto inverse_bind = Tensor(parts_.inverse_bind);
    const auto parents =
        parts_.parents.empty() ? fb::Offset<fb::Vector<uint16_t>>() : builder_.CreateVector(parts_.parents);
    return format::CreateCharacter(builder_, names, inverse_bind, parts_.hips, parents);
  }

  fb::Offset<format::Features> Features() {
    const auto joints = builder_.CreateVector(parts_.feature_joints);
    const auto mean = Tensor(parts_.mean);
    const auto inverse_deviation = Tensor(parts_.inverse_deviation);
    const auto low = Tensor(parts_.low);
    const auto high = Tensor(parts_.high);
    return format::CreateFeatures(builder_, joints, static_cast<format::RootMotion>(parts_.root_motion), mean,
                                  inverse_deviation, low, high);
  }

  fb::Offset<format::StaticStage> Static() {
    const auto bones = builder_.CreateVector(parts_.bones);
    const auto pivots = Tensor(parts_.pivots);
    const auto hidden = Linear(parts_.static_hidden);
    const auto increments = Linear(parts_.static_increments);
    const auto influence_bones = Tensor(parts_.influence_bones);
    const auto influence_weights = Tensor(parts_.influence_weights);
    return format::CreateStaticStage(builder_, bones, pivots, hidden, increments, parts_.influences, influence_bones,
                                     influence_weights);
  }

  fb::Offset<format::SkeletonStage> Skeleton(const SkeletonStageParts& skeleton) {
    const auto input = Linear(skeleton.input);
    const auto hidden = Linear(skeleton.hidden);
    return format::CreateSkeletonStage(builder_, input, hidden);
  }

  fb::Offset<format::MeshLayer> MeshLayer(const MeshLayerParts& layer) {
    const auto input_gates = Tensor(layer.input_gates);
    const auto gate_bias = Tensor(layer.gate_bias);
    const auto hidden_gates = Tensor(layer.hidden_gates);
    const auto hidden_candidate = Tensor(layer.hidden_candidate);
    const auto output = Tensor(layer.output);
    const auto output_bias = Tensor(layer.output_bias);
    const auto norm_gain = Tensor(layer.norm_gain);
    const auto norm_offset = Tensor(layer.norm_offset);
    const auto weights = Tensor(layer.weights);
    const auto column_scales = Tensor(layer.column_scales);
    const auto input_inverse_steps = Tensor(layer.input_inverse_steps);
    return format::CreateMeshLayer(builder_, input_gates, gate_bias, hidden_gates, hidden_candidate, output,
                                   output_bias, norm_gain, norm_offset, layer.prelu_slope, weights, column_scales,
                                   input_inverse_steps);
  }

  fb::Offset<format::MeshStage> Mesh(const MeshStageParts& mesh) {
    const auto body_points = Tensor(mesh.body_points);
    const auto body_joints = Tensor(mesh.body_joints);
    const auto body_weights = Tensor(mesh.body_weights);
    const auto input_mean = Tensor(mesh.input_mean);
    const auto input_inverse_deviation = Tensor(mesh.input_inverse_deviation);
    const auto row_starts = Tensor(mesh.row_starts);
    const auto columns = Tensor(mesh.columns);
    std::vector<fb::Offset<format::MeshLayer>> layers;
    for (const MeshLayerParts& layer : mesh.layers) layers.push_back(MeshLayer(layer));
    const auto layer_vector = builder_.CreateVector(layers);
    const auto embed = Tensor(mesh.embed);
    const auto hidden = Linear(mesh.hidden);
    const auto coefficients = Linear(mesh.coefficients);
    return format::CreateMeshStage(builder_, mesh.body_influences, body_points, body_joints, body_weights, input_mean,
                                   input_inverse_deviation, row_starts, columns, mesh.feature_width, layer_vector,
                                   embed, mesh.embed_bias, hidden, coefficients);
  }

  fb::Offset<format::Displacement> Displacement(const PackedLinear& basis) {
    const auto linear = Linear(basis);
    const auto head = parts_.head ? Linear(*parts_.head) : fb::Offset<format::Linear>();
    return format::CreateDisplacement(builder_, parts_.skeleton_rows, parts_.mesh_rows, linear, head);
  }

  fb::Offset<format::PatchStage> Patches(const PatchStageParts& patches) {
    const auto joints = Tensor(patches.joints);
    const auto axes = Tensor(patches.axes);
    const auto centres = Tensor(patches.centres);
    const auto point_joints = Tensor(patches.point_joints);
    const auto point_parts = Tensor(patches.point_parts);
    const auto capsule_joints = Tensor(patches.capsule_joints);
    const auto capsules = Tensor(patches.capsules);
    const auto limbs = Tensor(patches.limbs);
    const auto near = Tensor(patches.near);
    const auto embedding = Tensor(patches.embedding);
    const auto enter = Linear(patches.enter);
    std::vector<fb::Offset<format::Linear>> layers;
    for (const PackedLinear& layer : patches.mix) layers.push_back(Linear(layer));
    const auto mix = builder_.CreateVector(layers);
    const auto input_gates = Linear(patches.input_gates);
    const auto hidden_gates = Linear(patches.hidden_gates);
    const auto out = Linear(patches.out);
    const auto keep = Tensor(patches.keep);
    const auto sources = Tensor(patches.sources);
    const auto vertices = Tensor(patches.vertices);
    const auto group_starts = Tensor(patches.group_starts);
    const auto map = Linear(patches.map);
    return format::CreatePatchStage(builder_, patches.patches, patches.points, patches.width, patches.neighbours,
                                    joints, axes, centres, point_joints, point_parts, capsule_joints, capsules, limbs,
                                    near, embedding, enter, mix, input_gates, hidden_gates, out, keep, sources,
                                    vertices, group_starts, map);
  }

  fb::Offset<format::Body> Body(const BodyParts& body) {
    const auto positions = Tensor(body.positions);
    const auto joints = Tensor(body.joints);
    const auto weights = Tensor(body.weights);
    const auto faces = Tensor(body.faces);
    const auto row_starts = Tensor(body.row_starts);
    const auto columns = Tensor(body.columns);
    const auto touch_classes = Tensor(body.touch_classes);
    const auto touched_by = Tensor(body.touched_by);
    const auto garment_order = Tensor(body.garment_order);
    const auto sites = Tensor(body.sites);
    return format::CreateBody(builder_, body.influences, positions, joints, weights, faces, row_starts, columns,
                              body.clearance, body.reach, touch_classes, touched_by, garment_order, sites);
  }

  const ModelParts& parts_;
  fb::FlatBufferBuilder builder_;
  Layout layout_;
};

}  // namespace

std::vector<const PackedTensor*> TensorsOf(const ModelParts& parts) {
  std::vector<const PackedTensor*> tensors;
  auto add = [&](const auto&... tensor) { (tensors.push_back(&tensor), ...); };
  auto add_present = [&](const auto&... optional) { ((optional ? tensors.push_back(&*optional) : void()), ...); };
  auto add_linear = [&](const PackedLinear& linear) {
    add(linear.weights);
    add_present(linear.row_scales, linear.column_scales, linear.bias);
  };
  add(parts.inverse_bind, parts.mean, parts.inverse_deviation, parts.low, parts.high, parts.pivots);
  add_linear(parts.static_hidden);
  add_linear(parts.static_increments);
  if (parts.skeleton) {
    add_linear(parts.skeleton->input);
    add_linear(parts.skeleton->hidden);
  }
  if (parts.mesh) {
    const MeshStageParts& mesh = *parts.mesh;
    add(mesh.input_mean, mesh.input_inverse_deviation, mesh.body_points, mesh.body_joints, mesh.body_weights,
        mesh.row_starts, mesh.columns);
    for (const MeshLayerParts& layer : mesh.layers) {
      add_present(layer.input_gates);
      add(layer.gate_bias);
      add_present(layer.hidden_gates, layer.hidden_candidate, layer.output, layer.weights, layer.column_scales,
                  layer.input_inverse_steps);
      add(layer.output_bias, layer.norm_gain, layer.norm_offset);
    }
    add(mesh.embed);
    add_linear(mesh.hidden);
    add_linear(mesh.coefficients);
  }
  if (parts.patches) {
    const PatchStageParts& patches = *parts.patches;
    add(patches.joints, patches.axes, patches.centres, patches.point_joints, patches.point_parts,
        patches.capsule_joints, patches.capsules, patches.limbs);
    add_present(patches.near, patches.embedding);
    add_linear(patches.enter);
    for (const PackedLinear& layer : patches.mix) add_linear(layer);
    add_linear(patches.input_gates);
    add_linear(patches.hidden_gates);
    add_linear(patches.out);
    add(patches.keep, patches.sources, patches.vertices, patches.group_starts);
    add_linear(patches.map);
  }
  if (parts.head) add_linear(*parts.head);
  if (parts.basis) add_linear(*parts.basis);
  add(parts.template_positions, parts.influence_bones, parts.influence_weights, parts.faces);
  add_present(parts.coarse_vertices, parts.coarse_faces, parts.texture_coordinates, parts.seam_vertices,
              parts.textured_faces);
  if (parts.body) {
    const BodyParts& body = *parts.body;
    add(body.positions, body.joints, body.weights, body.faces, body.row_starts, body.columns);
    add_present(body.touch_classes, body.touched_by, body.garment_order, body.sites);
  }
  return tensors;
}

AlignedBytes WriteModel(const ModelParts& parts) {
  const uint64_t size = Arrange(TensorsOf(parts)).size;
  if (size > format::kMaxModelBytes - kTableRoom) {
    throw Error({"", "", "a model of " + std::to_string(size) + " bytes", "less than 2 GB",
                 "use a smaller basis or --precision int8"});
  }
  return Writer(parts, size + (uint64_t{1} << 16)).Write();
}

}  // namespace dcloth::converter

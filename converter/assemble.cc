#include "converter/assemble.h"

#include <string>
#include <vector>

#include "converter/assemble_patches.h"
#include "converter/correct.h"
#include "converter/integer_layer.h"
#include "converter/mesh_graph.h"
#include "dcloth/dcloth.h"
#include "kernels/nearest/nearest_order.h"

namespace dcloth::converter {
namespace {

constexpr const char* kProducer = "dcloth converter";

std::string ProducerText() {
  return std::string(kProducer) + " " + std::to_string(DCLOTH_VERSION_MAJOR) + "." +
         std::to_string(DCLOTH_VERSION_MINOR) + "." + std::to_string(DCLOTH_VERSION_PATCH);
}

Vector Reciprocal(const Vector& values) { return values.cast<double>().cwiseInverse().cast<float>(); }

std::vector<uint16_t> Subset(const std::vector<uint32_t>& joints, const JointSubset& subset) {
  std::vector<uint16_t> indices;
  indices.reserve(joints.size());
  for (const uint32_t joint : joints) indices.push_back(static_cast<uint16_t>(subset.kept[joint]));
  return indices;
}

// PyTorch's [out, in] as the [rows = in, columns = out] of the layouts.
PackedLinear Pack(const std::string& name, const LinearWeights& linear, const PrecisionPlan& plan) {
  return PackLinear(name, linear.weight.transpose(), linear.bias, FormatOf(plan, name));
}

// Rows that give back what int8 takes make sense beside int8 rows only.
bool IsCorrected(const FoldedBundle& folded, const PrecisionPlan& plan) {
  return FormatOf(plan, "displacement.basis") == Precision::kInt8 && !folded.reduced->corrected.empty();
}

void AddReduced(const FoldedBundle& folded, const PrecisionPlan& plan, ModelParts* parts) {
  const std::string name = "displacement.basis";
  const ReducedBasis& reduced = *folded.reduced;
  const bool corrected = IsCorrected(folded, plan);
  if (corrected) {
    const CorrectedMatrix basis = QuantizeCorrected(name + ".weights", reduced.basis, reduced.corrected);
    parts->basis = PackQuantized(name, basis.exact, basis.stored);
  } else {
    parts->basis = PackLinear(name, reduced.basis, Vector(), FormatOf(plan, name));
  }
  parts->skeleton_rows = parts->basis->weights.report.shape[0];
  parts->head = PackLinear("displacement.head", corrected ? HeadWithCopies(reduced) : reduced.head, Vector(),
                           FormatOf(plan, "displacement.head"));
}

// `before` is the layer that gives the inputs, null for the first.
MeshLayerParts AssembleLayer(const MeshLayerWeights& layer, const MeshLayerWeights* before, const std::string& name,
                             Precision format) {
  const FoldedMeshLayer folded = FoldMeshLayer(layer);
  const auto field = [&](const char* tensor) { return name + "." + tensor; };
  const bool integers = format == Precision::kInt8;
  MeshLayerParts parts;
  if (integers) {
    IntegerLayer stored = StackIntegerLayer(folded, layer.w_o, before);
    PackedLinear packed = PackFlatIntegers(name, stored.weights);
    parts.weights = std::move(packed.weights);
    parts.column_scales = std::move(packed.column_scales);
    if (before != nullptr) {
      parts.input_inverse_steps = PackFloats(field("input_inverse_steps"), stored.input_inverse_steps);
    }
  } else {
    parts.hidden_gates = PackFloats(field("hidden_gates"), folded.hidden_gates);
    parts.hidden_candidate = PackFloats(field("hidden_candidate"), folded.hidden_candidate);
    parts.output = PackFloats(field("output"), layer.w_o);
  }
  if (!integers || before == nullptr) parts.input_gates = PackFloats(field("input_gates"), folded.input_gates);
  parts.gate_bias = PackFloats(field("gate_bias"), folded.gate_bias);
  parts.output_bias = PackFloats(field("output_bias"), layer.b_o);
  parts.norm_gain = PackFloats(field("norm_gain"), layer.norm_weight);
  parts.norm_offset = PackFloats(field("norm_offset"), layer.norm_bias);
  parts.prelu_slope = layer.prelu;
  return parts;
}

// Narrow layers stay float: what surrounds their products takes the time, and rounding adds to it (kernels/README.md).
bool IsNarrowLayer(const Bundle& bundle) {
  constexpr Eigen::Index kLeastIntegerWidth = 16;
  return bundle.mesh->embed.weight.cols() < kLeastIntegerWidth;
}

MeshStageParts AssembleMesh(const Bundle& bundle, const FoldedBundle& folded, const PrecisionPlan& plan) {
  const MeshWeights& mesh = *bundle.mesh;
  const uint32_t n = bundle.vertex_count(), influences = folded.body.influences;
  MeshStageParts parts;
  parts.body_influences = static_cast<uint8_t>(influences);
  parts.body_points = PackFloats("mesh_stage.body_points", mesh.nearest_points);
  std::vector<uint32_t> joints;
  for (const uint32_t column : folded.body.columns) joints.push_back(folded.joints.kept[column]);
  parts.body_joints = PackIndices("mesh_stage.body_joints", StoredType::kU8, {n, influences}, joints);
  parts.body_weights = PackFloats("mesh_stage.body_weights", {n, influences}, folded.body.weights);
  parts.input_mean = PackFloats("mesh_stage.input_mean", mesh.input_mean);
  parts.input_inverse_deviation = PackFloats("mesh_stage.input_inverse_deviation", Reciprocal(mesh.input_deviation));
  const MeshGraph graph = BuildMeshGraph(bundle.template_faces, n);
  parts.row_starts = PackIndices("mesh_stage.row_starts", StoredType::kU32, {n + 1}, graph.row_starts);
  parts.columns = PackIndices("mesh_stage.columns", StoredType::kU16, {static_cast<uint32_t>(graph.columns.size())},
                              {graph.columns.begin(), graph.columns.end()});
  parts.feature_width = static_cast<uint16_t>(mesh.embed.weight.cols());
  for (size_t l = 0; l < mesh.layers.size(); ++l) {
    const std::string name = "mesh_stage.layers." + std::to_string(l);
    const Precision format = IsNarrowLayer(bundle) ? Precision::kFp32 : FormatOf(plan, name);
    parts.layers.push_back(AssembleLayer(mesh.layers[l], l == 0 ? nullptr : &mesh.layers[l - 1], name, format));
  }
  parts.embed = PackFloats("mesh_stage.embed", Vector(mesh.embed.weight.row(0).transpose()));
  parts.embed_bias = mesh.embed.bias[0];
  parts.hidden = Pack("mesh_stage.hidden", mesh.hidden, plan);
  parts.coefficients = Pack("mesh_stage.coefficients",
                            !folded.reduced             ? mesh.coefficients
                            : IsCorrected(folded, plan) ? CoefficientsWithCopies(*folded.reduced)
                                                        : folded.reduced->coefficients,
                            plan);
  return parts;
}

BodyParts AssembleBody(const Bundle& bundle, const FoldedBundle& folded) {
  constexpr float kClearance = 0.004f;  // eps of eq. 18; at 2 mm flat triangles of cloth let skin through
  constexpr float kReach = 0.15f;       // no part of a grown body is thicker than twice that
  const BodySurface& surface = folded.surface;
  const auto b = static_cast<uint32_t>(surface.vertices.size()), influences = surface.skin.influences;
  const Matrix positions = bundle.body_positions(surface.vertices, Eigen::all);
  std::vector<uint32_t> joints;
  for (const uint32_t column : surface.skin.columns) joints.push_back(folded.joints.kept[column]);
  const auto corners = static_cast<uint32_t>(surface.faces.size());
  BodyParts parts;
  parts.influences = static_cast<uint8_t>(influences);
  parts.positions = PackFloats("body.positions", positions);
  parts.joints = PackIndices("body.joints", StoredType::kU8, {b, influences}, joints);
  parts.weights = PackFloats("body.weights", {b, influences}, surface.skin.weights);
  parts.faces = PackIndices("body.faces", StoredType::kU16, {corners / 3, 3}, surface.faces);
  parts.row_starts = PackIndices("body.row_starts", StoredType::kU32, {b + 1}, surface.row_starts);
  parts.columns = PackIndices("body.columns", StoredType::kU16, {corners}, surface.columns);
  std::vector<uint16_t> order(bundle.vertex_count());
  kernels::OrderPoints(bundle.template_positions.data(),
                       surface.touch_classes.empty() ? nullptr : surface.touch_classes.data(), order.size(),
                       order.data());
  parts.garment_order = PackIndices("body.garment_order", StoredType::kU16, {static_cast<uint32_t>(order.size())},
                                    {order.begin(), order.end()});
  if (!surface.touch_classes.empty()) {
    const auto groups = static_cast<uint32_t>(kernels::CountSiteGroups(surface.touched_by.data(), b));
    std::vector<uint16_t> sites(groups * kernels::kNearestGroup);
    kernels::OrderSites(positions.data(), surface.touched_by.data(), b, sites.data());
    parts.sites = PackIndices("body.sites", StoredType::kU16, {groups, static_cast<uint32_t>(kernels::kNearestGroup)},
                              {sites.begin(), sites.end()});
    const auto bytes = [](const std::string& name, const std::vector<uint8_t>& values) {
      return PackIndices(name, StoredType::kU8, {static_cast<uint32_t>(values.size())}, {values.begin(), values.end()});
    };
    parts.touch_classes = bytes("body.touch_classes", surface.touch_classes);
    parts.touched_by = bytes("body.touched_by", surface.touched_by);
  }
  parts.clearance = kClearance;
  parts.reach = kReach;
  return parts;
}

void AddCoarseMesh(const CoarseMesh& mesh, ModelParts* parts) {
  if (mesh.empty()) return;
  parts->coarse_vertices = PackIndices("garment.coarse_vertices", StoredType::kU16,
                                       {static_cast<uint32_t>(mesh.vertices.size())}, mesh.vertices);
  parts->coarse_faces = PackIndices("garment.coarse_faces", StoredType::kU16,
                                    {static_cast<uint32_t>(mesh.faces.size() / 3), 3}, mesh.faces);
}

void AddTexture(const TextureMesh& mesh, ModelParts* parts) {
  if (mesh.empty()) return;
  parts->texture_coordinates = PackFloats("garment.texture_coordinates", mesh.coordinates);
  if (mesh.seam_vertices.empty()) return;
  parts->seam_vertices = PackIndices("garment.seam_vertices", StoredType::kU16,
                                     {static_cast<uint32_t>(mesh.seam_vertices.size())}, mesh.seam_vertices);
  parts->textured_faces = PackIndices("garment.textured_faces", StoredType::kU16,
                                      {static_cast<uint32_t>(mesh.faces.size() / 3), 3}, mesh.faces);
}

}  // namespace

FoldedBundle FoldBundle(const Bundle& bundle, uint32_t influences, uint32_t body_influences) {
  FoldedBundle folded;
  folded.skin_weights = FoldSkinWeights(bundle);
  folded.skin = Prune(folded.skin_weights, influences);
  if (bundle.mesh) {
    folded.body_weights = NormaliseRows(bundle.mesh->nearest_joint_weights);
    folded.body = Prune(folded.body_weights, body_influences);
  }
  folded.surface = MakeBodySurface(bundle, body_influences);
  folded.coarse = MakeCoarseMesh(bundle.template_positions, bundle.template_faces, bundle.vertex_count() / 2);
  folded.texture = MakeTextureMesh(bundle);
  folded.joints = ChooseJoints(bundle, folded.body, folded.surface.skin);
  return folded;
}

bool IsLayer(const std::string& matrix) { return matrix.starts_with("mesh_stage.layers."); }

// Small matrices that int8 would save little of and cost much: what patches read and move by is fed back every tick.
bool KeepsHalves(const std::string& matrix) {
  return matrix.starts_with("static_stage.") || matrix == "patch_stage.enter" || matrix == "patch_stage.out";
}

Precision FormatOf(const PrecisionPlan& plan, const std::string& matrix) {
  const std::string tensor = matrix + ".weights";
  if (!plan.only.empty() && plan.only != tensor) return Precision::kFp32;
  const auto named = plan.formats.find(tensor);
  const Precision format = named == plan.formats.end() ? plan.precision : named->second;
  if (matrix == "displacement.head") return HeadPrecision(format);
  if (IsLayer(matrix)) return format == Precision::kInt8 ? format : Precision::kFp32;  // halves would save 20 KB
  return KeepsHalves(matrix) && format == Precision::kInt8 ? Precision::kFp16 : format;
}

ModelParts Assemble(const Bundle& bundle, const FoldedBundle& folded, const PrecisionPlan& plan) {
  const uint32_t n = bundle.vertex_count();
  ModelParts parts;
  parts.producer = ProducerText();
  parts.precision = plan.name();
  parts.garment = bundle.garment;
  parts.tick_rate = static_cast<float>(bundle.tick_rate);
  parts.vertices = n;
  for (const uint32_t joint : folded.joints.joints) parts.joint_names.push_back(bundle.joint_names[joint]);
  if (!bundle.parents.empty()) parts.parents = KeptParents(bundle, folded.joints);
  parts.hips = static_cast<uint16_t>(folded.joints.kept[bundle.hips]);
  parts.feature_joints = Subset(bundle.feature_joints, folded.joints);
  parts.bones = Subset(bundle.bones, folded.joints);
  parts.root_motion = bundle.root_motion;
  parts.influences = static_cast<uint8_t>(folded.skin.influences);

  parts.template_positions = PackFloats("garment.template_positions", bundle.template_positions);
  std::vector<uint32_t> corners(bundle.template_faces.data(),
                                bundle.template_faces.data() + bundle.template_faces.size());
  parts.faces =
      PackIndices("garment.faces", StoredType::kU16, {static_cast<uint32_t>(bundle.template_faces.rows()), 3}, corners);
  AddCoarseMesh(folded.coarse, &parts);
  AddTexture(folded.texture, &parts);
  parts.inverse_bind = PackFloats("character.inverse_bind", InverseBinds(bundle, folded.joints.joints));
  parts.mean = PackFloats("features.mean", bundle.feature_mean);
  parts.inverse_deviation = PackFloats("features.inverse_deviation", Reciprocal(bundle.feature_deviation));
  parts.low = PackFloats("features.low", bundle.feature_low);
  parts.high = PackFloats("features.high", bundle.feature_high);

  parts.pivots = PackFloats("static_stage.pivots", Matrix(BindPositions(bundle, bundle.bones).cast<float>()));
  parts.influence_bones =
      PackIndices("static_stage.influence_bones", StoredType::kU8, {n, folded.skin.influences}, folded.skin.columns);
  parts.influence_weights =
      PackFloats("static_stage.influence_weights", {n, folded.skin.influences}, folded.skin.weights);
  parts.static_hidden = Pack("static_stage.hidden", bundle.static_hidden, plan);
  parts.static_increments = Pack("static_stage.increments", bundle.static_increments, plan);

  if (bundle.skeleton) {
    parts.skeleton = SkeletonStageParts{Pack("skeleton_stage.input", bundle.skeleton->input, plan),
                                        Pack("skeleton_stage.hidden", bundle.skeleton->hidden, plan)};
    if (folded.reduced) {
      AddReduced(folded, plan, &parts);
    } else {
      const StackedBasis stacked = StackBasis(bundle);
      parts.skeleton_rows = stacked.skeleton_rows;
      parts.mesh_rows = stacked.mesh_rows;
      parts.basis = PackLinear("displacement.basis", stacked.basis, Vector(), FormatOf(plan, "displacement.basis"));
    }
  }
  if (bundle.mesh) parts.mesh = AssembleMesh(bundle, folded, plan);
  if (bundle.patches) parts.patches = AssemblePatches(*bundle.patches, folded.joints, plan);
  if (!folded.surface.empty()) parts.body = AssembleBody(bundle, folded);
  return parts;
}

}  // namespace dcloth::converter

#include "converter/bundle.h"

#include <Eigen/Dense>
#include <cmath>
#include <utility>

#include "converter/bundle_metadata.h"
#include "converter/bundle_patches.h"
#include "converter/error.h"
#include "converter/tensor_reader.h"

namespace dcloth::converter {
namespace {

constexpr uint64_t kAny = TensorReader::kAny;

uint64_t Rows(const Matrix& matrix) { return static_cast<uint64_t>(matrix.rows()); }

RootMotion ReadRootMotion(const SafeFile& file) {
  const std::string_view allowed[] = {"false", "true", "air"};
  return static_cast<RootMotion>(OneOf(file, "root_motion", allowed));
}

void ReadMetadata(const SafeFile& file, Bundle* bundle) {
  if (file.RequireMetadata("format") != "dcloth-bundle") {
    throw Error({file.path(), "", "metadata format '" + file.RequireMetadata("format") + "'", "dcloth-bundle",
                 "pass a training bundle"});
  }
  if (file.RequireMetadata("format_version") != "1") {
    throw Error({file.path(), "", "format_version '" + file.RequireMetadata("format_version") + "'", "1",
                 "export the bundle again for this converter"});
  }
  bundle->garment = file.RequireMetadata("garment");
  if (bundle->garment.empty() || bundle->garment.find('\0') != std::string::npos) {
    throw Error({file.path(), "", "a garment name that is empty or has a zero byte", "a name without zero bytes",
                 "set the garment's name and export the bundle again"});
  }
  bundle->tick_rate = PositiveNumber(file, "tick_rate", 1000);
  bundle->joint_names = UniqueNames(file, "joint_names");
  bundle->parents = Parents(file, "parents", bundle->joint_names.size());
  bundle->hips = IndexOf(file, "hips", file.RequireMetadata("hips"), bundle->joint_names);
  for (const std::string& name : UniqueNames(file, "feature_joints")) {
    bundle->feature_joints.push_back(IndexOf(file, "feature_joints", name, bundle->joint_names));
  }
  for (const std::string& name : UniqueNames(file, "bones")) {
    bundle->bones.push_back(IndexOf(file, "bones", name, bundle->joint_names));
  }
  bundle->root_motion = ReadRootMotion(file);
  bundle->training = JsonObject(file, "training");
}

void ReadBind(TensorReader* reader, const SafeFile& file, Bundle* bundle) {
  const SafeTensor& tensor = reader->Take("character.bind", {bundle->joint_names.size(), 4, 4}, "[J, 4, 4]");
  reader->RequireType(tensor, SafeType::kF32);
  const std::vector<float> values = FloatsOf(file, tensor);
  using RowMatrix4 = Eigen::Matrix<float, 4, 4, Eigen::RowMajor>;
  for (size_t j = 0; j < bundle->joint_names.size(); ++j) {
    const Eigen::Matrix4f bind = Eigen::Map<const RowMatrix4>(values.data() + 16 * j);
    const double determinant = bind.cast<double>().topLeftCorner<3, 3>().determinant();
    if (bind(3, 0) != 0 || bind(3, 1) != 0 || bind(3, 2) != 0 || bind(3, 3) != 1) {
      reader->Refuse(tensor.name,
                     "a last row other than 0 0 0 1 in the matrix of joint '" + bundle->joint_names[j] + "'",
                     "row-major matrices that act on column vectors");
    }
    if (!(std::abs(determinant) >= 1e-9)) {
      reader->Refuse(tensor.name, "a matrix that has no inverse for joint '" + bundle->joint_names[j] + "'",
                     "invertible matrices");
    }
    bundle->bind.push_back(bind);
  }
}

void ReadFeatures(TensorReader* reader, Bundle* bundle) {
  const uint64_t root = bundle->root_motion == RootMotion::kAir ? 7 : bundle->root_motion == RootMotion::kHips ? 4 : 0;
  const uint64_t d = 9 * bundle->feature_joints.size() + root;
  const char* const names = "[d] = [9 feature joints + 4 with root_motion true, 7 with air]";
  bundle->feature_mean = reader->TakeVector("features.mean", d, names);
  bundle->feature_deviation = reader->TakePositive("features.deviation", d, names);
  bundle->feature_low = reader->TakeVector("features.low", d, names);
  bundle->feature_high = reader->TakeVector("features.high", d, names);
  for (Eigen::Index i = 0; i < bundle->feature_low.size(); ++i) {
    if (bundle->feature_low[i] > bundle->feature_high[i]) {
      reader->Refuse("features.low", "a value above features.high at element " + std::to_string(i),
                     "at most features.high");
    }
  }
}

// S as it is or as the product of its factors. The sums are in double: the float basis keeps the rank R, which is how
// the converter finds it again.
Matrix ReadSkeletonBasis(TensorReader* reader, uint64_t k, uint64_t n, Matrix* components) {
  if (!reader->Has("skeleton.components")) return reader->TakeBasis("skeleton.basis", k, n, "[k_S, n, 3]");
  const Matrix readout = reader->TakeMatrix("skeleton.readout", k, TensorReader::kAny, "[k_S, R]");
  const auto rank = static_cast<uint64_t>(readout.cols());
  if (rank > k) {
    reader->Refuse("skeleton.readout", std::to_string(rank) + " components", "at most k_S = " + std::to_string(k));
  }
  *components = reader->TakeBasis("skeleton.components", rank, n, "[R, n, 3]");
  Matrix basis = (readout.cast<double>() * components->cast<double>()).cast<float>();
  if (!basis.allFinite())
    reader->Refuse("skeleton.components", "a product with skeleton.readout that F32 cannot hold", "finite numbers");
  return basis;
}

SkeletonWeights ReadSkeleton(TensorReader* reader, uint64_t n, uint64_t d) {
  SkeletonWeights skeleton;
  const std::string gru = "skeleton.gru.";
  skeleton.hidden.bias = reader->TakeVector(gru + "bias_hh", kAny, "[3 k_S]");
  const auto rows = static_cast<uint64_t>(skeleton.hidden.bias.size());
  const uint64_t k = rows / 3;
  if (rows % 3 != 0) reader->Refuse(gru + "bias_hh", std::to_string(rows) + " values", "3 k_S values: r, z and n");
  skeleton.hidden.weight = reader->TakeMatrix(gru + "weight_hh", 3 * k, k, "[3 k_S, k_S]");
  skeleton.input.weight = reader->TakeMatrix(gru + "weight_ih", 3 * k, d, "[3 k_S, d]");
  skeleton.input.bias = reader->TakeVector(gru + "bias_ih", 3 * k, "[3 k_S]");
  skeleton.basis = ReadSkeletonBasis(reader, k, n, &skeleton.components);
  return skeleton;
}

MeshLayerWeights ReadMeshLayer(TensorReader* reader, size_t index, uint64_t width) {
  const std::string name = "mesh.layers." + std::to_string(index) + ".";
  MeshLayerWeights layer;
  layer.w_p = reader->TakeMatrix(name + "w_p", index == 0 ? 3 : width, width, index == 0 ? "[3, F]" : "[F, F]");
  const std::pair<const char*, Matrix*> square[] = {{"w_z", &layer.w_z}, {"w_r", &layer.w_r}, {"w", &layer.w},
                                                    {"u_z", &layer.u_z}, {"u_r", &layer.u_r}, {"u", &layer.u},
                                                    {"w_o", &layer.w_o}};
  for (const auto& [suffix, matrix] : square) *matrix = reader->TakeMatrix(name + suffix, width, width, "[F, F]");
  const std::pair<const char*, Vector*> rows[] = {
      {"b", &layer.b}, {"b_o", &layer.b_o}, {"norm.weight", &layer.norm_weight}, {"norm.bias", &layer.norm_bias}};
  for (const auto& [suffix, vector] : rows) *vector = reader->TakeVector(name + suffix, width, "[F]");
  layer.prelu = reader->TakeVector(name + "prelu", 1, "[1]")[0];
  return layer;
}

MeshWeights ReadMesh(TensorReader* reader, uint64_t n) {
  MeshWeights mesh;
  mesh.input_mean = reader->TakeVector("mesh.input_mean", 3, "[3]");
  mesh.input_deviation = reader->TakePositive("mesh.input_deviation", 3, "[3]");
  mesh.embed = reader->TakeLinear("mesh.embed", 1, kAny, "[1, F]");
  const uint64_t width = static_cast<uint64_t>(mesh.embed.weight.cols());
  if (width % 8 != 0 || width > 64) {
    reader->Refuse("mesh.embed.weight", "feature width " + std::to_string(width), "a multiple of 8 from 8 to 64");
  }
  while (reader->Has("mesh.layers." + std::to_string(mesh.layers.size()) + ".") || mesh.layers.empty()) {
    if (mesh.layers.size() == 8) reader->Refuse("mesh.layers.8", "more than 8 layers", "1 to 8");
    mesh.layers.push_back(ReadMeshLayer(reader, mesh.layers.size(), width));
  }
  mesh.hidden = reader->TakeLinear("mesh.mlp.0", kAny, n, "[h, n]");
  mesh.coefficients = reader->TakeLinear("mesh.mlp.2", kAny, Rows(mesh.hidden.weight), "[k_M, h]");
  mesh.basis = reader->TakeBasis("mesh.basis", Rows(mesh.coefficients.weight), n, "[k_M, n, 3]");
  return mesh;
}

void ReadBody(TensorReader* reader, Bundle* bundle) {
  bundle->body_positions = reader->TakeGeometry("body.positions", kAny, 3, "[b, 3]");
  const uint64_t b = Rows(bundle->body_positions);
  bundle->body_faces = reader->TakeFaces("body.faces", b);
  bundle->body_joint_weights = reader->TakeSkinWeights("body.joint_weights", b, bundle->joint_names.size(), "[b, J]");
  if (reader->Has("body.parts") || reader->Has("template.touches")) {
    bundle->body_parts = reader->TakeMasks("body.parts", b, "[b]");
    bundle->touches = reader->TakeMasks("template.touches", bundle->vertex_count(), "[n]");
  }
  if (reader->Has("body.colours")) {
    bundle->body_colours = reader->TakeGeometry("body.colours", b, 3, "[b, 3]");
    const bool within = (bundle->body_colours.array() >= 0 && bundle->body_colours.array() <= 1).all();
    if (!within) reader->Refuse("body.colours", "a number outside 0 to 1", "sRGB colours from 0 to 1");
  }
  if (!reader->Has("body.collides")) return;
  bundle->body_collides = reader->TakeVector("body.collides", b, "[b]");
  for (Eigen::Index i = 0; i < bundle->body_collides.size(); ++i) {
    const float value = bundle->body_collides[i];
    if (value == 0 || value == 1) continue;
    reader->Refuse("body.collides", NumberText(static_cast<double>(value)) + " at vertex " + std::to_string(i),
                   "1 for skin that cloth collides with, else 0");
  }
}

// Names as a wrapper around the network writes them into its state dict.
void RefuseWrappers(const SafeFile& file) {
  for (const SafeTensor& tensor : file.tensors()) {
    for (const std::string prefix : {"_orig_mod.", "module."}) {
      const size_t at = tensor.name.find(prefix);
      if (at == std::string::npos || (at != 0 && tensor.name[at - 1] != '.')) continue;
      throw Error(
          {file.path(), tensor.name,
           "the prefix '" + prefix + "' of " + (prefix == "module." ? "torch.nn.DataParallel" : "torch.compile"),
           "the names of converter/BUNDLE.md", RewriteCommand("k.replace('" + prefix + "', ''): v")});
    }
  }
}

}  // namespace

Bundle BundleFrom(const SafeFile& file) {
  Bundle bundle;
  bundle.path = file.path();
  RefuseWrappers(file);
  ReadMetadata(file, &bundle);
  TensorReader reader(file);
  bundle.template_positions = reader.TakeGeometry("template.positions", kAny, 3, "[n, 3]");
  const uint64_t n = Rows(bundle.template_positions);
  if (n < 3 || n > 65535) {
    reader.Refuse("template.positions", std::to_string(n) + " vertices", "3 to 65535");
  }
  bundle.template_faces = reader.TakeFaces("template.faces", n);
  if (reader.Has("template.texture_coordinates")) {
    bundle.texture_coordinates =
        reader.TakeCorners("template.texture_coordinates", static_cast<uint64_t>(bundle.template_faces.rows()));
  }
  ReadBind(&reader, file, &bundle);
  ReadBody(&reader, &bundle);
  ReadFeatures(&reader, &bundle);

  const uint64_t m = bundle.bones.size();
  bundle.static_hidden = reader.TakeLinear("static.mlp.0", kAny, bundle.feature_count(), "[h, d]");
  bundle.static_increments = reader.TakeLinear("static.mlp.2", 3 * m, Rows(bundle.static_hidden.weight), "[3 m, h]");
  bundle.initial_weights = reader.TakeMatrix("static.initial_weights", n, m, "[n, m]");
  bundle.residual_weights = reader.TakeStack("static.residual_weights", n, m, "[r, n, m]");

  // A stage is there when any tensor of its group is: half a group is then missed by name.
  const bool has_mesh = reader.Has("mesh.");
  if (has_mesh && !reader.Has("skeleton.")) {
    reader.Refuse("skeleton.basis", "a mesh stage without a skeleton stage", "both stages, or no mesh stage");
  }
  if (has_mesh || reader.Has("nearest.")) {
    MeshWeights nearest;
    nearest.nearest_points = reader.TakeGeometry("nearest.points", n, 3, "[n, 3]");
    nearest.nearest_joint_weights =
        reader.TakeSkinWeights("nearest.joint_weights", n, bundle.joint_names.size(), "[n, J]");
    if (has_mesh) {
      bundle.mesh = ReadMesh(&reader, n);
      bundle.mesh->nearest_points = std::move(nearest.nearest_points);
      bundle.mesh->nearest_joint_weights = std::move(nearest.nearest_joint_weights);
    }
  }
  if (reader.Has("skeleton.")) bundle.skeleton = ReadSkeleton(&reader, n, bundle.feature_count());
  if (reader.Has("patch.")) {
    if (bundle.skeleton)
      reader.Refuse("patch.joints", "a patch stage beside a skeleton stage", "patch.* or skeleton.*, not both");
    bundle.patches = ReadPatches(&reader, n, bundle.joint_names.size());
  }
  reader.RefuseUnknown();
  return bundle;
}

Bundle ReadBundle(const std::filesystem::path& path) { return BundleFrom(SafeFile::Read(path)); }

}  // namespace dcloth::converter

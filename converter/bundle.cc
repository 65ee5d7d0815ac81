#include "converter/bundle.h"

#include <Eigen/Dense>
#include <cmath>
#include <cstring>
#include <set>
#include <utility>

#include "converter/bundle_metadata.h"
#include "converter/error.h"

namespace dcloth::converter {
namespace {

constexpr uint64_t kAny = UINT64_MAX;  // a free dimension: this tensor defines it
// Above any dimension that makes sense, so that products of two stay far from 64 bits and indices from 32.
constexpr uint64_t kMaxExtent = uint64_t{1} << 24;

// Hands tensors out once each, checked, and knows which were never asked for.
class Reader {
 public:
  explicit Reader(const SafeFile& file) : file_(file) {}

  bool Has(std::string_view prefix) const {
    for (const SafeTensor& tensor : file_.tensors()) {
      if (std::string_view(tensor.name).substr(0, prefix.size()) == prefix) return true;
    }
    return false;
  }

  // `expected` holds kAny where any extent from 1 up (0 up for the leading one of `may_be_empty`) is good.
  const SafeTensor& Take(const std::string& name, const Shape& expected, const char* names, bool may_be_empty = false) {
    const SafeTensor& tensor = file_.Require(name);
    taken_.insert(name);
    bool good = tensor.shape.size() == expected.size();
    for (size_t i = 0; good && i < expected.size(); ++i) {
      const uint64_t least = may_be_empty && i == 0 ? 0 : 1;
      good = expected[i] == kAny ? tensor.shape[i] >= least && tensor.shape[i] <= kMaxExtent : tensor.shape[i] == expected[i];
    }
    if (good) return tensor;
    std::string text = "[";
    for (size_t i = 0; i < expected.size(); ++i) {
      text += (i == 0 ? "" : ", ") + (expected[i] == kAny ? std::string("any") : std::to_string(expected[i]));
    }
    Refuse(name, "shape " + ShapeText(tensor.shape), text + "] = " + names);
  }

  Matrix TakeMatrix(const std::string& name, uint64_t rows, uint64_t columns, const char* names) {
    return ToMatrix(Take(name, {rows, columns}, names));
  }

  Vector TakeVector(const std::string& name, uint64_t size, const char* names) {
    const std::vector<float> values = FloatsOf(file_, Take(name, {size}, names));
    return Eigen::Map<const Vector>(values.data(), static_cast<Eigen::Index>(values.size()));
  }

  // Geometry: F32 only, since half floats would move it.
  Matrix TakeGeometry(const std::string& name, uint64_t rows, uint64_t columns, const char* names) {
    RequireType(Take(name, {rows, columns}, names), SafeType::kF32);
    return TakeMatrix(name, rows, columns, names);
  }

  LinearWeights TakeLinear(const std::string& name, uint64_t out, uint64_t in, const char* names) {
    LinearWeights linear;
    linear.weight = TakeMatrix(name + ".weight", out, in, names);
    linear.bias = TakeVector(name + ".bias", static_cast<uint64_t>(linear.weight.rows()), "the rows of its weight");
    return linear;
  }

  // [k, n, 3] as [k, 3n].
  Matrix TakeBasis(const std::string& name, uint64_t rows, uint64_t vertices, const char* names) {
    const SafeTensor& tensor = Take(name, {rows, vertices, 3}, names);
    return ToMatrix(tensor, tensor.shape[0], 3 * tensor.shape[1]);
  }

  std::vector<Matrix> TakeStack(const std::string& name, uint64_t rows, uint64_t columns, const char* names) {
    const SafeTensor& tensor = Take(name, {kAny, rows, columns}, names, /*may_be_empty=*/true);
    const std::vector<float> values = FloatsOf(file_, tensor);
    std::vector<Matrix> stack;
    for (uint64_t i = 0; i < tensor.shape[0]; ++i) {
      stack.emplace_back(Eigen::Map<const Matrix>(values.data() + i * rows * columns, static_cast<Eigen::Index>(rows),
                                                  static_cast<Eigen::Index>(columns)));
    }
    return stack;
  }

  Faces TakeFaces(const std::string& name, uint64_t vertices) {
    const SafeTensor& tensor = Take(name, {kAny, 3}, "[c, 3]");
    RequireType(tensor, SafeType::kI32);
    Faces faces(static_cast<Eigen::Index>(tensor.shape[0]), 3);
    std::memcpy(faces.data(), tensor.bytes.data(), tensor.bytes.size());
    for (Eigen::Index i = 0; i < faces.rows(); ++i) {
      for (Eigen::Index corner = 0; corner < 3; ++corner) {
        const int32_t vertex = faces(i, corner);
        if (vertex < 0 || static_cast<uint64_t>(vertex) >= vertices) {
          Refuse(name, "vertex " + std::to_string(vertex) + " in face " + std::to_string(i),
                 "indices from 0 to " + std::to_string(vertices - 1));
        }
      }
      if (faces(i, 0) == faces(i, 1) || faces(i, 1) == faces(i, 2) || faces(i, 0) == faces(i, 2)) {
        Refuse(name, "a vertex twice in face " + std::to_string(i), "three different vertices");
      }
    }
    return faces;
  }

  // Nonnegative, rows sum to 1 within kRowSumTolerance.
  Matrix TakeSkinWeights(const std::string& name, uint64_t rows, uint64_t columns, const char* names) {
    Matrix weights = TakeGeometry(name, rows, columns, names);
    for (Eigen::Index i = 0; i < weights.rows(); ++i) {
      const double sum = weights.row(i).cast<double>().sum();
      if (weights.row(i).minCoeff() < 0) Refuse(name, "a negative weight in row " + std::to_string(i), "0 or more");
      if (std::abs(sum - 1) > kRowSumTolerance) {
        Refuse(name, "a sum of " + std::to_string(sum) + " in row " + std::to_string(i), "1 within 0.0001");
      }
    }
    return weights;
  }

  Vector TakePositive(const std::string& name, uint64_t size, const char* names) {
    Vector values = TakeVector(name, size, names);
    for (Eigen::Index i = 0; i < values.size(); ++i) {
      // Its reciprocal is stored as a float.
      if (!(values[i] >= 1e-30f && values[i] <= 1e30f)) {
        Refuse(name, std::to_string(values[i]) + " at element " + std::to_string(i), "1e-30 to 1e30");
      }
    }
    return values;
  }

  void RequireType(const SafeTensor& tensor, SafeType type) const {
    if (tensor.type != type) Refuse(tensor.name, std::string("dtype ") + SafeTypeName(tensor.type), SafeTypeName(type));
  }

  void RefuseUnknown() const {
    for (const SafeTensor& tensor : file_.tensors()) {
      if (taken_.count(tensor.name) == 0) {
        Refuse(tensor.name, "a tensor that a bundle does not have", "the names in converter/BUNDLE.md");
      }
    }
  }

  [[noreturn]] void Refuse(const std::string& name, const std::string& found, const std::string& expected) const {
    throw Error({file_.path(), name, found, expected, "export the bundle again"});
  }

 private:
  Matrix ToMatrix(const SafeTensor& tensor) { return ToMatrix(tensor, tensor.shape[0], tensor.shape[1]); }
  Matrix ToMatrix(const SafeTensor& tensor, uint64_t rows, uint64_t columns) {
    const std::vector<float> values = FloatsOf(file_, tensor);
    return Eigen::Map<const Matrix>(values.data(), static_cast<Eigen::Index>(rows), static_cast<Eigen::Index>(columns));
  }

  const SafeFile& file_;
  std::set<std::string> taken_;
};

uint64_t Rows(const Matrix& matrix) { return static_cast<uint64_t>(matrix.rows()); }

void ReadMetadata(const SafeFile& file, Bundle* bundle) {
  if (file.RequireMetadata("format") != "dcloth-bundle") {
    throw Error({file.path(), "", "metadata format '" + file.RequireMetadata("format") + "'", "dcloth-bundle", "pass a bundle"});
  }
  if (file.RequireMetadata("format_version") != "1") {
    throw Error({file.path(), "", "format_version '" + file.RequireMetadata("format_version") + "'", "1",
                 "export the bundle for this converter"});
  }
  bundle->garment = file.RequireMetadata("garment");
  if (bundle->garment.empty() || bundle->garment.find('\0') != std::string::npos) {
    throw Error({file.path(), "", "an empty garment name, or one with a zero byte", "a plain name", ""});
  }
  bundle->tick_rate = PositiveNumber(file, "tick_rate", 1000);
  bundle->joint_names = UniqueNames(file, "joint_names");
  bundle->hips = IndexOf(file, "hips", file.RequireMetadata("hips"), bundle->joint_names);
  for (const std::string& name : UniqueNames(file, "feature_joints")) {
    bundle->feature_joints.push_back(IndexOf(file, "feature_joints", name, bundle->joint_names));
  }
  for (const std::string& name : UniqueNames(file, "bones")) {
    bundle->bones.push_back(IndexOf(file, "bones", name, bundle->joint_names));
  }
  bundle->root_motion = TrueOrFalse(file, "root_motion");
  bundle->training = JsonObject(file, "training");
}

void ReadBind(Reader* reader, const SafeFile& file, Bundle* bundle) {
  const SafeTensor& tensor = reader->Take("character.bind", {bundle->joint_names.size(), 4, 4}, "[J, 4, 4]");
  reader->RequireType(tensor, SafeType::kF32);
  const std::vector<float> values = FloatsOf(file, tensor);
  using RowMatrix4 = Eigen::Matrix<float, 4, 4, Eigen::RowMajor>;
  for (size_t j = 0; j < bundle->joint_names.size(); ++j) {
    const Eigen::Matrix4f bind = Eigen::Map<const RowMatrix4>(values.data() + 16 * j);
    const double determinant = bind.cast<double>().topLeftCorner<3, 3>().determinant();
    if (bind(3, 0) != 0 || bind(3, 1) != 0 || bind(3, 2) != 0 || bind(3, 3) != 1) {
      reader->Refuse(tensor.name, "another last row than 0 0 0 1 in joint '" + bundle->joint_names[j] + "'",
                     "row-major matrices that act on column vectors");
    }
    if (!(std::abs(determinant) >= 1e-9)) {
      reader->Refuse(tensor.name, "a matrix without inverse in joint '" + bundle->joint_names[j] + "'", "invertible ones");
    }
    bundle->bind.push_back(bind);
  }
}

void ReadFeatures(Reader* reader, Bundle* bundle) {
  const uint64_t d = 9 * bundle->feature_joints.size() + (bundle->root_motion ? 4 : 0);
  const char* const names = "[d] = [9 feature joints + 4 with root motion]";
  bundle->feature_mean = reader->TakeVector("features.mean", d, names);
  bundle->feature_deviation = reader->TakePositive("features.deviation", d, names);
  bundle->feature_low = reader->TakeVector("features.low", d, names);
  bundle->feature_high = reader->TakeVector("features.high", d, names);
  for (Eigen::Index i = 0; i < bundle->feature_low.size(); ++i) {
    if (bundle->feature_low[i] > bundle->feature_high[i]) {
      reader->Refuse("features.low", "a value above features.high at element " + std::to_string(i), "low <= high");
    }
  }
}

SkeletonWeights ReadSkeleton(Reader* reader, uint64_t n, uint64_t d) {
  SkeletonWeights skeleton;
  skeleton.basis = reader->TakeBasis("skeleton.basis", kAny, n, "[k_S, n, 3]");
  const uint64_t k = Rows(skeleton.basis);
  const std::string gru = "skeleton.gru.";
  skeleton.input.weight = reader->TakeMatrix(gru + "weight_ih", 3 * k, d, "[3 k_S, d]");
  skeleton.hidden.weight = reader->TakeMatrix(gru + "weight_hh", 3 * k, k, "[3 k_S, k_S]");
  skeleton.input.bias = reader->TakeVector(gru + "bias_ih", 3 * k, "[3 k_S]");
  skeleton.hidden.bias = reader->TakeVector(gru + "bias_hh", 3 * k, "[3 k_S]");
  return skeleton;
}

MeshLayerWeights ReadMeshLayer(Reader* reader, size_t index, uint64_t width) {
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

MeshWeights ReadMesh(Reader* reader, uint64_t n) {
  MeshWeights mesh;
  mesh.input_mean = reader->TakeVector("mesh.input_mean", 3, "[3]");
  mesh.input_deviation = reader->TakePositive("mesh.input_deviation", 3, "[3]");
  mesh.embed = reader->TakeLinear("mesh.embed", 1, kAny, "[1, F]");
  const uint64_t width = static_cast<uint64_t>(mesh.embed.weight.cols());
  if (width % 8 != 0 || width > 64) {
    reader->Refuse("mesh.embed.weight", "feature width " + std::to_string(width), "a multiple of 8, 8 to 64");
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

void ReadBody(Reader* reader, Bundle* bundle) {
  bundle->body_positions = reader->TakeGeometry("body.positions", kAny, 3, "[b, 3]");
  const uint64_t b = Rows(bundle->body_positions);
  bundle->body_faces = reader->TakeFaces("body.faces", b);
  bundle->body_joint_weights = reader->TakeSkinWeights("body.joint_weights", b, bundle->joint_names.size(), "[b, J]");
}

}  // namespace

Bundle BundleFrom(const SafeFile& file) {
  Bundle bundle;
  bundle.path = file.path();
  ReadMetadata(file, &bundle);
  Reader reader(file);
  bundle.template_positions = reader.TakeGeometry("template.positions", kAny, 3, "[n, 3]");
  const uint64_t n = Rows(bundle.template_positions);
  if (n < 3 || n > 65535) {
    reader.Refuse("template.positions", std::to_string(n) + " vertices", "3 to 65535");
  }
  bundle.template_faces = reader.TakeFaces("template.faces", n);
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
    reader.Refuse("skeleton.basis", "a mesh stage without a skeleton stage", "both, or no mesh stage");
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
  reader.RefuseUnknown();
  return bundle;
}

Bundle ReadBundle(const std::filesystem::path& path) { return BundleFrom(SafeFile::Read(path)); }

}  // namespace dcloth::converter

// A training bundle, checked: what BUNDLE.md describes, typed. Numbers are the file's own (F16 widens exactly).
#ifndef DCLOTH_CONVERTER_BUNDLE_H_
#define DCLOTH_CONVERTER_BUNDLE_H_

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "converter/safetensors.h"

namespace dcloth::converter {

using Matrix = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using Vector = Eigen::VectorXf;
using MatrixD = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using VectorD = Eigen::VectorXd;
using Faces = Eigen::Matrix<int32_t, Eigen::Dynamic, 3, Eigen::RowMajor>;

// A row of skin weights sums to 1 within this: a point 2 m from the origin moves by at most 0.2 mm when it is
// renormalised.
constexpr double kRowSumTolerance = 1e-4;

struct LinearWeights {
  Matrix weight;  // [out, in], PyTorch's layout
  Vector bias;    // [out]
};

struct MeshLayerWeights {
  Matrix w_p, w_z, w_r, w, u_z, u_r, u, w_o;  // x W: rows are inputs
  Vector b, b_o, norm_weight, norm_bias;
  float prelu = 0;
};

struct SkeletonWeights {
  LinearWeights input;   // [3k, d], gate order r, z, n
  LinearWeights hidden;  // [3k, k]
  Matrix basis;          // [k, 3n]
  Matrix components;     // [R, 3n], the right factor of a basis that came as two; else empty
};

struct MeshWeights {
  Matrix nearest_points;               // [n, 3]
  Matrix nearest_joint_weights;        // [n, J]
  Vector input_mean, input_deviation;  // [3]
  std::vector<MeshLayerWeights> layers;
  LinearWeights embed;         // [1, F]
  LinearWeights hidden;        // [h, n]
  LinearWeights coefficients;  // [k_M, h]
  Matrix basis;                // [k_M, 3n]
};

// K patches of R points, P = K R.
struct PatchWeights {
  uint32_t patch_count = 0, point_count = 0, neighbour_count = 0, source_count = 0;  // K, R, S, M
  std::vector<uint32_t> joints;               // [K] indices into joint_names, as all joints here
  Matrix axes, centres;                       // [K, 9], [K, 3]
  std::vector<uint32_t> point_joints;         // [P, 4]
  Matrix point_parts;                         // [P, 16]
  std::vector<uint32_t> capsule_joints;       // [C]
  Matrix capsules;                            // [C, 8]
  std::vector<uint32_t> limbs, near;          // [K, 4], [L, S, K]
  Matrix embedding;                           // [K, E]; empty where E is 0
  LinearWeights enter, input_gates, out;      // [W, I], [3 W, W], [3 R, W + I]
  std::vector<LinearWeights> mix;             // [W, (1 + S) W]
  LinearWeights hidden_gates;                 // [3 W, W], no bias
  Vector keep;                                // [R]
  std::vector<uint32_t> sources;              // [P, M]
  std::vector<std::vector<uint32_t>> groups;  // [P], vertices of each point
  Matrix map, offsets;                        // [n, 9 M], [n, 3]
};

// Root-motion features; the file format's values.
enum class RootMotion : uint8_t { kNone, kHips, kAir };

struct Bundle {
  std::filesystem::path path;
  std::string garment;
  double tick_rate = 0;  // Hz
  std::vector<std::string> joint_names;
  std::vector<int32_t> parents;          // [J] indices into joint_names, -1 at the top; empty where not told
  uint32_t hips = 0;                     // index into joint_names
  std::vector<uint32_t> feature_joints;  // indices into joint_names
  RootMotion root_motion = RootMotion::kNone;
  std::vector<uint32_t> bones;  // indices into joint_names
  std::string training;         // JSON object, free

  Matrix template_positions;  // [n, 3]
  Faces template_faces;
  Matrix texture_coordinates;         // [3 c, 2] of the faces' corners; empty where the bundle does not say
  std::vector<Eigen::Matrix4f> bind;  // [J] joint to world
  Matrix body_positions;              // [b, 3]
  Faces body_faces;
  Matrix body_joint_weights;  // [b, J]
  Matrix body_colours;        // [b, 3] sRGB, 0 to 1; empty where the bundle does not say
  Vector body_collides;       // [b] 0 or 1; empty where the bundle does not say
  // Bit masks: cloth touches skin where they share a bit. Both empty where the bundle does not say.
  std::vector<uint32_t> touches;     // [n]
  std::vector<uint32_t> body_parts;  // [b]

  Vector feature_mean, feature_deviation, feature_low, feature_high;  // [d]
  LinearWeights static_hidden;                                        // [h, d]
  LinearWeights static_increments;                                    // [3m, h]
  Matrix initial_weights;                                             // [n, m]
  std::vector<Matrix> residual_weights;                               // r of [n, m]

  std::optional<SkeletonWeights> skeleton;
  std::optional<MeshWeights> mesh;      // only with skeleton
  std::optional<PatchWeights> patches;  // only without skeleton

  uint32_t vertex_count() const { return static_cast<uint32_t>(template_positions.rows()); }
  uint32_t feature_count() const { return static_cast<uint32_t>(feature_mean.size()); }
};

// Throws Error with the tensor's name, the shape found and the shape expected. A tensor that BUNDLE.md does not name is
// refused: a misspelt optional group would otherwise drop a stage in silence.
Bundle ReadBundle(const std::filesystem::path& path);
Bundle BundleFrom(const SafeFile& file);

}  // namespace dcloth::converter

#endif  // DCLOTH_CONVERTER_BUNDLE_H_

// Small random garments: the numbers of a model in double, as the reference network reads them, and the same model as a
// .dcloth file, whose tables a test may spoil before they are written.
#ifndef DCLOTH_TESTS_UNIT_ENGINE_MODEL_BUILDER_H_
#define DCLOTH_TESTS_UNIT_ENGINE_MODEL_BUILDER_H_

#ifndef FLATBUFFERS_MAX_ALIGNMENT
#define FLATBUFFERS_MAX_ALIGNMENT 64
#endif
#ifndef FLATBUFFERS_ASSERT
#define FLATBUFFERS_ASSERT(condition) ((void)0)  // corruption tests leave required fields out
#endif

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "dcloth_objects.h"
#include "tests/unit/engine/aligned_bytes.h"

namespace dcloth::testing {

struct ModelSpec {
  format::DType precision = format::DType_F32;
  uint32_t rings = 6, segments = 10;  // n = rings * segments, a tube
  uint32_t joints = 9;
  uint32_t bones = 5;
  uint32_t influences = 4;
  uint32_t body_influences = 3;
  uint32_t static_width = 21;
  uint32_t units = 19;  // k_S; odd, so that the basis has a pad row
  uint32_t feature_width = 16;
  uint32_t layers = 3;
  bool integer_layers = false;  // the layers' products in int8; `numbers` then hold what the integers stand for
  uint32_t mesh_width = 37;
  uint32_t mesh_basis = 13;  // k_M
  uint32_t rank = 0;         // of a reduced basis; 0: not reduced
  // Of a patch stage, which then is in place of the skeleton and the mesh stage; no more patches than segments, and no
  // more points than rings. 0 patches: none.
  uint32_t patches = 0, patch_points = 3, patch_width = 24, patch_neighbours = 2, mixes = 2;
  uint32_t capsules = 5, embedding = 3, sources = 4;
  format::RootMotion root_motion = format::RootMotion_Hips;
  bool skeleton = true;
  bool mesh = true;
  bool parents = false;  // of joints: a chain from the hips
  bool body = false;     // the egg of test_body.h, small
  bool touch = false;    // with a body: three classes that touch all, its upper half and nothing of it
  bool coarse = false;   // a coarse mesh: every second vertex
  bool texture = false;  // around the tube once, with a seam at segment 0
  uint32_t seed = 1;
  // Names and places of the joints in the bind pose, in place of `joints` random ones; the first is the hips.
  std::vector<std::pair<std::string, std::array<double, 3>>> skeleton_joints = {};
};

struct Linear {
  size_t rows = 0, columns = 0;
  std::vector<double> weights;     // [rows, columns], exactly what the file holds, scales multiplied in
  std::vector<double> bias;        // [columns]
  std::vector<double> row_scales;  // [rows] with int8 weights, ones where the file has none; else empty
};

struct Layer {
  size_t input_width = 0;
  std::vector<double> input_gates, gate_bias, hidden_gates, hidden_candidate, output, output_bias, norm_gain,
      norm_offset;
  double prelu_slope = 0;
};

// The patch stage, in the view's shapes.
struct Patches {
  std::vector<uint8_t> joints, point_joints, capsule_joints, limbs, near;
  std::vector<double> axes, centres, point_parts, capsules, embedding, keep;
  Linear enter, input_gates, hidden_gates, out, map;
  std::vector<Linear> mix;
  std::vector<uint16_t> sources, vertices;
  std::vector<uint32_t> group_starts;
};

// Everything NETWORK.md names, by its name there where that is shorter.
struct Numbers {
  ModelSpec spec;
  size_t n = 0, d = 0;
  double tick_rate = 0;
  size_t hips = 0;
  std::vector<std::array<double, 3>> joint_positions;  // bind
  std::vector<double> inverse_bind;                    // [joints, 12]
  std::vector<size_t> feature_joints, bones;
  std::vector<double> mean, inverse_deviation, low, high;
  std::vector<double> positions;  // [n, 3]
  std::vector<uint16_t> faces;
  std::vector<double> pivots;
  Linear static_hidden, static_increments;
  std::vector<uint8_t> influence_bones;
  std::vector<double> influence_weights;
  Linear gru_input, gru_hidden;
  std::vector<double> body_points, body_weights;
  std::vector<uint8_t> body_joints;
  std::vector<double> input_mean, input_inverse_deviation;
  std::vector<std::vector<size_t>> neighbours;  // N(i), i among them
  std::vector<Layer> layers;
  std::vector<double> embed;
  double embed_bias = 0;
  Linear mesh_hidden, mesh_coefficients;
  size_t skeleton_rows = 0, mesh_rows = 0;
  Linear basis;
  Linear head;  // no rows where the basis is not reduced
  Patches patches;
};

struct TestModel {
  Numbers numbers;
  std::unique_ptr<format::ModelT> tables;

  AlignedBytes Bytes() const;  // the file
};

TestModel BuildModel(const ModelSpec& spec);

// World matrices [joints, 16], row-major, of a character that walks along a curve, turns and bends its joints.
std::vector<float> PoseAt(const Numbers& numbers, double seconds, std::array<double, 3> place = {0, 0, 0});

}  // namespace dcloth::testing

#endif  // DCLOTH_TESTS_UNIT_ENGINE_MODEL_BUILDER_H_

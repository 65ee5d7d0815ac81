// Exact rewrites: what is constant at run time is multiplied out once, in double. Formulas: engine/format/NETWORK.md.
#ifndef DCLOTH_CONVERTER_FOLD_H_
#define DCLOTH_CONVERTER_FOLD_H_

#include <cstdint>
#include <span>
#include <vector>

#include "converter/bundle.h"
#include "converter/prune.h"

namespace dcloth::converter {

// W = normalise(max(W_I + sum_i W_i, 0)) over rows, [n, m]. Throws Error for a row without a positive weight.
MatrixD FoldSkinWeights(const Bundle& bundle);

// Rows divided by their sums, which must be positive.
MatrixD NormaliseRows(const Matrix& weights);

// a W^z = (mean of x) (W^p W^z) + b W^z, and likewise for W^r and W: W^p disappears.
struct FoldedMeshLayer {
  Matrix input_gates;       // [w, 3F]: W^p [W^z | W^r | W]
  Vector gate_bias;         // [3F]: b [W^z | W^r | W]
  Matrix hidden_gates;      // [F, 2F]: [U^z | U^r]
  Matrix hidden_candidate;  // [F, F]: U
};
FoldedMeshLayer FoldMeshLayer(const MeshLayerWeights& layer);

// The joints a host must supply: hips, feature joints, bones, joints that move body points; in the bundle's order.
struct JointSubset {
  std::vector<uint32_t> joints;  // index in the bundle of each kept joint
  std::vector<uint32_t> kept;    // per bundle joint its index in `joints`, or kDropped
  static constexpr uint32_t kDropped = UINT32_MAX;
};
// `body` may be empty (no mesh stage), and so may `surface` (no skin that collides).
JointSubset ChooseJoints(const Bundle& bundle, const PrunedWeights& body, const PrunedWeights& surface = {});

// The nearest kept joint above each kept one, as an index into JointSubset::joints, or format::kNoParent.
std::vector<uint16_t> KeptParents(const Bundle& bundle, const JointSubset& subset);

// B_j^-1 of each joint, three rows of four, [joints, 12].
Matrix InverseBinds(const Bundle& bundle, std::span<const uint32_t> joints);

// Bind position of each joint, [joints, 3].
MatrixD BindPositions(const Bundle& bundle, std::span<const uint32_t> joints);

// S above M as one [rows, 3n] matrix, each padded with zero rows to an even count (schema, Displacement).
struct StackedBasis {
  Matrix basis;
  uint32_t skeleton_rows = 0;
  uint32_t mesh_rows = 0;
};
StackedBasis StackBasis(const Bundle& bundle);

}  // namespace dcloth::converter

#endif  // DCLOTH_CONVERTER_FOLD_H_

// Skin weights reduced to the K strongest influences per vertex, and what that costs in millimetres.
#ifndef DCLOTH_CONVERTER_PRUNE_H_
#define DCLOTH_CONVERTER_PRUNE_H_

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "converter/bundle.h"

namespace dcloth::converter {

struct PrunedWeights {
  uint32_t influences = 0;        // K
  std::vector<uint32_t> columns;  // [n, K] column of the dense matrix, strongest first; unused ones repeat the first
  std::vector<float> weights;     // [n, K], rows sum to 1 within K 2^-24; unused ones are 0

  size_t vertex_count() const { return influences == 0 ? 0 : columns.size() / influences; }
};

struct PruneReport {
  uint32_t influences = 0;
  double removed_mean = 0;  // weight taken away per vertex, of 1
  double removed_worst = 0;
  // While joints stay no further apart than at bind, no vertex moves by more: removed weight times the largest
  // distance that two of its bones' images of it can have.
  double bound_worst_mm = 0;
  // On the calibration poses; both 0 without any.
  bool measured = false;
  double mean_mm = 0;
  double worst_mm = 0;
};

// A weight that moves no vertex of a character-sized garment by more than a micrometre or two.
constexpr double kNegligibleWeight = 1e-6;

// Rows of `dense` [n, columns] are nonnegative and sum to 1. Ties go to the lower column. K is at least 1 and is
// lowered to the most weights above kNegligibleWeight that a row has.
PrunedWeights Prune(const MatrixD& dense, uint32_t influences);

// What pruning does to plain linear blend skinning of `points` [n, 3] (bind pose). `pivots` [columns, 3] are the
// joints' bind positions. `poses` holds per pose one skinning matrix G B^-1 per column.
PruneReport MeasurePruning(const MatrixD& dense, const PrunedWeights& pruned, const Matrix& points,
                           const MatrixD& pivots, std::span<const std::vector<Eigen::Matrix4d>> poses);

}  // namespace dcloth::converter

#endif  // DCLOTH_CONVERTER_PRUNE_H_

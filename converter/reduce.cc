#include "converter/reduce.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <string>

#include "converter/error.h"
#include "kernels/half.h"
#include "kernels/matvec/matvec.h"

namespace dcloth::converter {
namespace {

constexpr double kHalfRounding = 0x1p-11, kFloatRounding = 0x1p-24;
constexpr double kSmallestScale =
    1e-6;  // of the strongest direction's; a displacement of 1 m leaves a micrometre there

bool AllHalves(const Matrix& matrix) {
  return std::all_of(matrix.data(), matrix.data() + matrix.size(),
                     [](float value) { return kernels::FloatFromHalf(kernels::HalfFromFloat(value)) == value; });
}

MatrixD Stack(const Bundle& bundle) {
  const Eigen::Index mesh_rows = bundle.mesh ? bundle.mesh->basis.rows() : 0;
  MatrixD stacked(bundle.skeleton->basis.rows() + mesh_rows, bundle.skeleton->basis.cols());
  stacked.topRows(bundle.skeleton->basis.rows()) = bundle.skeleton->basis.cast<double>();
  if (bundle.mesh) stacked.bottomRows(mesh_rows) = bundle.mesh->basis.cast<double>();
  return stacked;
}

// Of each row, relative to its length.
VectorD Tolerances(const Bundle& bundle) {
  const Eigen::Index k_s = bundle.skeleton->basis.rows(), k_m = bundle.mesh ? bundle.mesh->basis.rows() : 0;
  const double sum_rounding = std::sqrt(static_cast<double>(k_s + k_m)) * kFloatRounding;
  const auto of = [&](const Matrix& basis) { return std::max(sum_rounding, AllHalves(basis) ? kHalfRounding : 0.0); };
  VectorD tolerances(k_s + k_m);
  tolerances.head(k_s).setConstant(of(bundle.skeleton->basis));
  if (bundle.mesh) tolerances.tail(k_m).setConstant(of(bundle.mesh->basis));
  return tolerances;
}

// Eigenpairs of a symmetric matrix, largest first; rounding below zero is zero.
struct Spectrum {
  VectorD values;
  MatrixD vectors;  // columns
};

Spectrum SpectrumOf(const MatrixD& symmetric) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver{Eigen::MatrixXd(symmetric)};
  return {solver.eigenvalues().reverse().cwiseMax(0.0), solver.eigenvectors().rowwise().reverse()};
}

// The smallest r such that what eigenvectors r, r + 1, ... hold of each row is within its tolerance. Summed from the
// smallest up: what is left of a row by subtraction would drown in rounding.
uint32_t NumericalRank(const Spectrum& spectrum, const VectorD& tolerances) {
  const VectorD allowed = tolerances.cwiseAbs2();
  VectorD dropped = VectorD::Zero(allowed.size());
  Eigen::Index rank = spectrum.values.size();
  while (rank > 0) {
    dropped += spectrum.values[rank - 1] * spectrum.vectors.col(rank - 1).cwiseAbs2();
    if ((dropped.array() > allowed.array()).any()) break;
    --rank;
  }
  return static_cast<uint32_t>(rank);
}

uint64_t Width(Precision precision) {
  return precision == Precision::kFp32 ? 4 : precision == Precision::kFp16 ? 2 : 1;
}

}  // namespace

BasisRank::BasisRank(const Bundle& bundle) : bundle_(bundle) {
  const MatrixD stacked = Stack(bundle);
  rows_ = rank_ = static_cast<uint32_t>(stacked.rows());
  if (rows_ > kMostRows) return;
  // Rows at length 1: each is judged by its own size, however small beside the others.
  const VectorD lengths = stacked.rowwise().norm();
  const VectorD inverse = (lengths.array() > 0).select(lengths.cwiseInverse(), 0.0);
  MatrixD gram = MatrixD::Zero(rows_, rows_);
  gram.selfadjointView<Eigen::Lower>().rankUpdate(MatrixD(inverse.asDiagonal() * stacked));
  const Spectrum spectrum = SpectrumOf(gram.selfadjointView<Eigen::Lower>());
  rank_ = std::max(1u, NumericalRank(spectrum, Tolerances(bundle)));
  weights_ = inverse.asDiagonal() * spectrum.vectors.leftCols(rank_);
}

BasisFrame BasisRank::Frame() const {
  if (rows_ > kMostRows) {
    throw Error({bundle_.path, "", std::to_string(rows_) + " rows of skeleton.basis and mesh.basis to reduce",
                 "at most " + std::to_string(kMostRows), "pass --rank full"});
  }
  const MatrixD stacked = Stack(bundle_);
  BasisFrame frame;
  frame.directions = weights_.transpose() * stacked;
  for (Eigen::Index i = 0; i < frame.directions.rows(); ++i) {
    const double length = frame.directions.row(i).norm();
    if (length > 0) frame.directions.row(i) /= length;  // all-zero bases have one direction of length 0
  }
  frame.coordinates = stacked * frame.directions.transpose();
  return frame;
}

MatrixD ExpectedMoment(const BasisFrame& frame) { return frame.coordinates.transpose() * frame.coordinates; }

ReducedBasis Reduce(const Bundle& bundle, const BasisFrame& frame, const MatrixD& moment, uint32_t rank) {
  const Spectrum spectrum = SpectrumOf(moment);
  const Eigen::Index kept = std::min(rank, frame.rank()), stored = StoredRank(rank);
  const Eigen::Index k_s = bundle.skeleton->basis.rows();
  const double largest = std::sqrt(spectrum.values[0]);
  MatrixD basis = MatrixD::Zero(stored, frame.directions.cols()),
          head = MatrixD::Zero(frame.coordinates.rows(), stored);
  for (Eigen::Index i = 0; i < kept; ++i) {
    // The floor keeps 1 / scale in float range for directions that carry nothing; any scale is right for those.
    const double scale = largest > 0 ? std::max(std::sqrt(spectrum.values[i]), kSmallestScale * largest) : 1;
    basis.row(i) = scale * (spectrum.vectors.col(i).transpose() * frame.directions);
    head.col(i) = frame.coordinates * spectrum.vectors.col(i) / scale;
  }
  ReducedBasis reduced;
  reduced.basis = basis.cast<float>();
  reduced.head = head.topRows(k_s).cast<float>();
  if (bundle.mesh) {
    const MatrixD mesh_head = head.bottomRows(head.rows() - k_s).transpose();
    const LinearWeights& full = bundle.mesh->coefficients;
    reduced.coefficients.weight = (mesh_head * full.weight.cast<double>()).cast<float>();
    reduced.coefficients.bias = (mesh_head * full.bias.cast<double>()).cast<float>();
  }
  return reduced;
}

bool ReductionSaves(const Bundle& bundle, uint32_t rank, Precision precision) {
  const auto matrix = [](Eigen::Index rows, Eigen::Index columns, Precision stored) {
    return static_cast<uint64_t>(rows) * kernels::PaddedColumns(static_cast<size_t>(columns)) * Width(stored);
  };
  const Eigen::Index columns = bundle.skeleton->basis.cols(), k_s = bundle.skeleton->basis.rows();
  const Eigen::Index k_m = bundle.mesh ? bundle.mesh->basis.rows() : 0;
  const Eigen::Index width = bundle.mesh ? bundle.mesh->coefficients.weight.cols() : 0, stored = StoredRank(rank);
  const uint64_t before = matrix(k_s + k_s % 2 + k_m + k_m % 2, columns, precision) + matrix(width, k_m, precision);
  const uint64_t after = matrix(stored, columns, precision) + matrix(width, stored, precision) +
                         matrix(k_s, stored, HeadPrecision(precision));
  return after < before;
}

}  // namespace dcloth::converter

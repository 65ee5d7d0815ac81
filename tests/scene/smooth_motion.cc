#include "tests/scene/smooth_motion.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace dcloth::stability {
namespace {

// Gram and Schmidt.
void MakeOrthonormal(Matrix* joint) {
  Eigen::Vector3d x = joint->block<3, 1>(0, 0).normalized(), y = joint->block<3, 1>(0, 1);
  y = (y - x.dot(y) * x).normalized();
  joint->block<3, 1>(0, 0) = x;
  joint->block<3, 1>(0, 1) = y;
  joint->block<3, 1>(0, 2) = x.cross(y);
}

}  // namespace

// Four equal curvatures in a row balance: c[i-1] + 4 c[i] + c[i+1] = 6 (p[i-1] - 2 p[i] + p[i+1]) / step^2, zero at the
// ends.
SmoothMotion::SmoothMotion(Motion poses, double step)
    : poses_(std::move(poses)), curvature_(poses_.size(), Pose(poses_[0].size(), Matrix::Zero())), step_(step) {
  const size_t last = poses_.size() - 1;
  std::vector<double> carried(poses_.size(), 0.0);
  for (size_t i = 1; i < last; ++i) {
    carried[i] = 1 / (4 - carried[i - 1]);
    for (size_t j = 0; j < poses_[0].size(); ++j) {
      const Matrix bend = poses_[i - 1][j] - 2 * poses_[i][j] + poses_[i + 1][j];
      curvature_[i][j] = carried[i] * (6 / (step * step) * bend - curvature_[i - 1][j]);
    }
  }
  for (size_t i = last - 1; i > 0; --i) {
    for (size_t j = 0; j < poses_[0].size(); ++j) curvature_[i][j] -= carried[i] * curvature_[i + 1][j];
  }
}

size_t SmoothMotion::Before(double seconds) const {
  const double at = std::floor(seconds / step_);
  return static_cast<size_t>(std::clamp(at, 0.0, static_cast<double>(poses_.size() - 2)));
}

Pose SmoothMotion::At(double seconds) const {
  const size_t i = Before(seconds);
  const double b = seconds / step_ - static_cast<double>(i), a = 1 - b, unit = step_ * step_ / 6;
  Pose pose(poses_[0].size());
  for (size_t j = 0; j < pose.size(); ++j) {
    pose[j] = a * poses_[i][j] + b * poses_[i + 1][j] +
              unit * ((a * a * a - a) * curvature_[i][j] + (b * b * b - b) * curvature_[i + 1][j]);
    MakeOrthonormal(&pose[j]);
  }
  return pose;
}

double SmoothMotion::LargestJerk(size_t joint, double from, double to) const {
  double largest = 0;
  for (size_t i = Before(from); i <= Before(to); ++i) {
    const Matrix jerk = (curvature_[i + 1][joint] - curvature_[i][joint]) / step_;
    largest = std::max(largest, jerk.block<3, 1>(0, 3).norm());
  }
  return largest;
}

}  // namespace dcloth::stability

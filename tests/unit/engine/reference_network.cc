#include "tests/unit/engine/reference_network.h"

#include <numbers>
#include <stdexcept>

#include "dcloth/dcloth.h"

namespace dcloth::testing {
namespace {

Matrix4 Product(const Matrix4& a, const Matrix4& b) {
  Matrix4 product = {};
  for (size_t r = 0; r < 4; ++r) {
    for (size_t c = 0; c < 4; ++c) {
      for (size_t k = 0; k < 4; ++k) product[r][c] += a[r][k] * b[k][c];
    }
  }
  return product;
}

// A sum over blended matrices, as skinning does it: sum_k w_k A_k first, then times the point. Each matrix element is
// one rounding, the blend K products, the transform four more.
Bounded BlendRow(const std::vector<std::array<double, 4>>& rows, const double* weights, const Bounded* point) {
  Sum sum;
  for (size_t c = 0; c < 4; ++c) {
    Sum blended;
    for (size_t k = 0; k < rows.size(); ++k) blended.Add(Rounded(rows[k][c]), weights[k]);
    const Bounded element = blended.Total();
    const Bounded product = c < 3 ? element * point[c] : element;
    sum.Add(product, 1.0);
  }
  return sum.Total();
}

// (o - mean) / s with s = sqrt(variance + 1e-5). If d = o - mean is off by at most a per element, s, a norm of (d,
// sqrt(eps)), is off by at most A = sqrt(mean a^2), and the quotient by (a + |d| A / s) / (s - A).
Vector LayerNorm(const Vector& o) {
  const auto width = static_cast<double>(o.size());
  Sum total;
  for (const Bounded& element : o) total.Add(element, 1 / width);
  const Bounded mean = total.Total();
  Vector d;
  double squares = 0, errors = 0;
  for (const Bounded& element : o) {
    d.push_back(element - mean);
    squares += d.back().value * d.back().value / width;
    errors += d.back().error * d.back().error / width;
  }
  const double s = std::sqrt(squares + 1e-5), s_error = std::sqrt(errors);
  if (s_error >= s) throw std::logic_error("errors as large as the deviation");
  Vector y;
  for (const Bounded& element : d) {
    const double value = element.value / s;
    const double error = (element.error + std::abs(value) * s_error) / (s - s_error);
    // The sum of squares, its root, the quotient: width + 6 roundings of a positive sum and what follows.
    y.push_back({value, error + Gamma(width + 6) * (std::abs(value) + error)});
  }
  return y;
}

}  // namespace

Vector Apply(const Linear& linear, const Vector& x) {
  if (x.size() > linear.rows) throw std::logic_error("more inputs than rows");
  double half_step = 0;
  if (!linear.row_scales.empty()) {
    // matvec.h: |q| <= 32767 with the smallest step, and steps are a quarter apart at most, so half of one is at most
    // 5/8 max / 32767, and the product with its inverse errs by less than what 0.64 leaves; the limit on sum|q|
    // cannot bind below 512 rows.
    if (x.size() > 512) throw std::logic_error("too many rows for the bound");
    for (size_t j = 0; j < x.size(); ++j) {
      half_step = std::max(half_step, (std::abs(x[j].value) + x[j].error) * linear.row_scales[j] * 0.64 / 32767);
    }
  }
  Vector y(linear.columns);
  for (size_t c = 0; c < linear.columns; ++c) {
    Sum sum;
    for (size_t j = 0; j < x.size(); ++j) {
      const double weight = linear.weights[j * linear.columns + c];
      sum.Add(x[j], weight);
      if (half_step > 0) sum.AddError(std::abs(weight) / linear.row_scales[j] * half_step);
    }
    sum.Add({1, 0}, linear.bias[c]);
    y[c] = sum.Total(5);  // int8: the product with a row scale, int to float, the product with a column scale
  }
  return y;
}

ReferenceNetwork::ReferenceNetwork(const Numbers& numbers) : numbers_(numbers) { Reset(); }

void ReferenceNetwork::Reset() {
  started_ = false;
  yaw_ = 0;
  h_.assign(numbers_.spec.units, {});
  states_.assign(numbers_.layers.size(), Vector(numbers_.n * numbers_.spec.feature_width));
  last_ = before_ = {Vector(3 * numbers_.bones.size()), Vector(3 * numbers_.n)};
  ticks_ = 0;
  last_stages_ = DCLOTH_STAGES_MESH;
}

ReferenceNetwork::Bind ReferenceNetwork::BindOf(const std::vector<float>& pose) const {
  Bind bind;
  for (size_t j = 0; j < numbers_.joint_positions.size(); ++j) {
    Matrix4 world = {}, inverse = {};
    for (size_t r = 0; r < 3; ++r) {
      for (size_t c = 0; c < 4; ++c) {
        world[r][c] = static_cast<double>(pose[16 * j + 4 * r + c]);
        inverse[r][c] = numbers_.inverse_bind[12 * j + 4 * r + c];
      }
    }
    world[3][3] = inverse[3][3] = 1;
    bind.joints.push_back(Product(world, inverse));
    if (j == numbers_.hips) bind.hips = {world[0][3], world[1][3], world[2][3]};
  }
  return bind;
}

Matrix4 ReferenceNetwork::HeadingInverse() const {
  // H = T(hips) Ry(yaw), so that H's X axis is (cos, 0, -sin).
  const double c = std::cos(yaw_), s = std::sin(yaw_);
  const Matrix4 turn_back = {{{c, 0, -s, 0}, {0, 1, 0, 0}, {s, 0, c, 0}, {0, 0, 0, 1}}};
  const Matrix4 move_back = {{{1, 0, 0, -hips_[0]}, {0, 1, 0, -hips_[1]}, {0, 0, 1, -hips_[2]}, {0, 0, 0, 1}}};
  return Product(turn_back, move_back);
}

void ReferenceNetwork::UpdateFeatures(const Bind& bind) {
  const Matrix4& hips = bind.joints[numbers_.hips];
  const double left_x = hips[0][0], left_z = hips[2][0], yaw_before = yaw_;
  const std::array<double, 3> hips_before = hips_;
  if (std::hypot(left_x, left_z) >= 0.2) yaw_ = std::atan2(-left_z, left_x);
  hips_ = bind.hips;
  std::vector<double> raw;
  const Matrix4 inverse = HeadingInverse();
  for (const size_t joint : numbers_.feature_joints) {
    const Matrix4 local = Product(inverse, bind.joints[joint]);
    for (size_t r = 0; r < 3; ++r) {
      for (size_t c = 0; c < 3; ++c) raw.push_back(local[r][c]);
    }
  }
  places_.push_back(hips_);
  const bool air = numbers_.spec.root_motion == format::RootMotion_Air;
  if (numbers_.spec.root_motion != format::RootMotion_None) {
    for (size_t r = 0; r < 3; ++r) {
      double velocity = 0, wind = 0;
      for (size_t c = 0; c < 3; ++c) {
        velocity += inverse[r][c] * (hips_[c] - hips_before[c]) * numbers_.tick_rate;
        wind += inverse[r][c] * wind_[c];
      }
      if (!started_) velocity = 0;
      raw.push_back(air ? wind - velocity : velocity);
    }
    const double turn = std::remainder(yaw_ - yaw_before, 2 * std::numbers::pi);
    raw.push_back(started_ ? turn * numbers_.tick_rate : 0);
  }
  for (size_t r = 0; air && r < 3; ++r) {
    double acceleration = 0;
    for (size_t c = 0; c < 3 && places_.size() > 2; ++c) {
      const double change = places_.end()[-1][c] - 2 * places_.end()[-2][c] + places_.end()[-3][c];
      acceleration += inverse[r][c] * change * numbers_.tick_rate * numbers_.tick_rate;
    }
    raw.push_back(acceleration);
  }
  started_ = true;
  features_.clear();
  for (size_t i = 0; i < raw.size(); ++i) {
    const double x = (raw[i] - numbers_.mean[i]) * numbers_.inverse_deviation[i];
    // Both sides work in double up to here; velocities of a character far out lose up to 1e-9 of it there.
    features_.push_back(Rounded(std::clamp(x, numbers_.low[i], numbers_.high[i]), 1e-9));
  }
}

void ReferenceNetwork::RunGru() {
  const Vector gx = Apply(numbers_.gru_input, features_), gh = Apply(numbers_.gru_hidden, h_);
  const size_t k = h_.size();
  for (size_t i = 0; i < k; ++i) {
    const Bounded r = Sigmoid(gx[i] + gh[i]), z = Sigmoid(gx[k + i] + gh[k + i]);
    const Bounded q = Tanh(gx[2 * k + i] + r * gh[2 * k + i]);
    h_[i] = Mix(q, h_[i], z);
  }
}

Vector ReferenceNetwork::BodyPoints(const Bind& bind) const {
  const Matrix4 inverse = HeadingInverse();
  const size_t width = numbers_.spec.body_influences;
  Vector points;
  for (size_t i = 0; i < numbers_.n; ++i) {
    Bounded point[3];
    for (size_t c = 0; c < 3; ++c) point[c] = {numbers_.body_points[3 * i + c], 0};
    for (size_t r = 0; r < 3; ++r) {
      std::vector<std::array<double, 4>> rows;
      double weight_sum = 0;
      for (size_t k = 0; k < width; ++k) {
        rows.push_back(Product(inverse, bind.joints[numbers_.body_joints[i * width + k]])[r]);
        rows.back()[3] -= numbers_.input_mean[r];
        for (double& element : rows.back()) element *= numbers_.input_inverse_deviation[r];
        weight_sum += numbers_.body_weights[i * width + k];
      }
      // (X - mean) / deviation; the mean inside the blend differs by how far the stored weights' sum is from 1.
      Bounded x = BlendRow(rows, &numbers_.body_weights[i * width], point);
      x.error += std::abs(weight_sum - 1) * std::abs(numbers_.input_mean[r] * numbers_.input_inverse_deviation[r]);
      x.value += (weight_sum - 1) * numbers_.input_mean[r] * numbers_.input_inverse_deviation[r];
      points.push_back(x);
    }
  }
  return points;
}

Vector ReferenceNetwork::RunLayer(size_t index, const Vector& x) {
  const Layer& layer = numbers_.layers[index];
  const size_t width = numbers_.spec.feature_width, in = layer.input_width;
  Vector next;
  for (size_t i = 0; i < numbers_.n; ++i) {
    const std::vector<size_t>& row = numbers_.neighbours[i];
    Bounded* h = &states_[index][i * width];
    Vector mean;
    for (size_t f = 0; f < in; ++f) {
      Sum sum;
      for (const size_t j : row) sum.Add(x[j * in + f], 1.0 / static_cast<double>(row.size()));
      mean.push_back(sum.Total());
    }
    // a W^z + h U^z and so on; column 0 to F of the gates is z, then r, then the candidate.
    const auto gate = [&](size_t column, const std::vector<double>& hidden, size_t hidden_width, size_t hidden_column,
                          const Bounded* state) {
      Sum sum;
      for (size_t f = 0; f < in; ++f) sum.Add(mean[f], layer.input_gates[f * 3 * width + column]);
      for (size_t f = 0; f < width; ++f) sum.Add(state[f], hidden[f * hidden_width + hidden_column]);
      sum.Add({1, 0}, layer.gate_bias[column]);
      return sum.Total();
    };
    Vector z(width), reset(width), output(width);
    for (size_t f = 0; f < width; ++f) {
      z[f] = Sigmoid(gate(f, layer.hidden_gates, 2 * width, f, h));
      reset[f] = Sigmoid(gate(width + f, layer.hidden_gates, 2 * width, width + f, h)) * h[f];
    }
    Vector after(width);
    for (size_t f = 0; f < width; ++f) {
      const Bounded g = Tanh(gate(2 * width + f, layer.hidden_candidate, width, f, reset.data()));
      after[f] = Mix(h[f], g, z[f]);
    }
    std::copy(after.begin(), after.end(), h);
    for (size_t f = 0; f < width; ++f) {
      Sum sum;
      for (size_t j = 0; j < width; ++j) sum.Add(h[j], layer.output[j * width + f]);
      sum.Add({1, 0}, layer.output_bias[f]);
      output[f] = sum.Total();
    }
    const Vector normalised = LayerNorm(output);
    for (size_t f = 0; f < width; ++f) {
      Bounded y = normalised[f] * Bounded{layer.norm_gain[f], 0} + Bounded{layer.norm_offset[f], 0};
      if (y.value < 0) y = Rounded(y.value * layer.prelu_slope, y.error);  // the slope is below 1 on both sides of 0
      next.push_back(y);
    }
  }
  return next;
}

Vector ReferenceNetwork::RunMesh(const Bind& bind) {
  Vector x = BodyPoints(bind);
  for (size_t l = 0; l < numbers_.layers.size(); ++l) x = RunLayer(l, x);
  const size_t width = numbers_.spec.feature_width;
  Vector s;
  for (size_t i = 0; i < numbers_.n; ++i) {
    Sum sum;
    for (size_t f = 0; f < width; ++f) sum.Add(x[i * width + f], numbers_.embed[f]);
    sum.Add({1, 0}, numbers_.embed_bias);
    s.push_back(sum.Total());
  }
  Vector hidden = Apply(numbers_.mesh_hidden, s);
  for (Bounded& unit : hidden) unit = Relu(unit);
  return Apply(numbers_.mesh_coefficients, hidden);
}

// [P, pad, Q, pad]; `q` is empty where the mesh stage rests.
Vector ReferenceNetwork::Stacked(const Vector& q) const {
  Vector coefficients = h_;
  coefficients.resize(numbers_.skeleton_rows);
  coefficients.insert(coefficients.end(), q.begin(), q.end());
  if (!q.empty()) coefficients.resize(numbers_.skeleton_rows + numbers_.mesh_rows);
  return coefficients;
}

// P H_S + Q of a reduced basis.
Vector ReferenceNetwork::Mixed(const Vector& q) const {
  Vector coefficients = Apply(numbers_.head, h_);
  for (size_t i = 0; i < q.size(); ++i) coefficients[i] = coefficients[i] + q[i];
  return coefficients;
}

void ReferenceNetwork::Tick(const std::vector<float>& pose, uint32_t stages) {
  const Bind bind = BindOf(pose);
  UpdateFeatures(bind);
  before_ = last_;
  Vector hidden = Apply(numbers_.static_hidden, features_);
  for (Bounded& unit : hidden) unit = Relu(unit);
  last_.increments = Apply(numbers_.static_increments, hidden);
  last_.displacement.assign(3 * numbers_.n, {});

  if (stages >= DCLOTH_STAGES_SKELETON && last_stages_ < DCLOTH_STAGES_SKELETON)
    std::fill(h_.begin(), h_.end(), Bounded{});
  if (stages >= DCLOTH_STAGES_MESH && last_stages_ < DCLOTH_STAGES_MESH) {
    for (Vector& state : states_) std::fill(state.begin(), state.end(), Bounded{});
  }
  last_stages_ = stages;
  if (stages >= DCLOTH_STAGES_SKELETON) {
    RunGru();
    const Vector q = stages >= DCLOTH_STAGES_MESH ? RunMesh(bind) : Vector();
    last_.displacement = Apply(numbers_.basis, numbers_.head.rows != 0 ? Mixed(q) : Stacked(q));
  }
  if (ticks_++ == 0) before_ = last_;
}

ReferenceNetwork::Frame ReferenceNetwork::Skin(const std::vector<float>& pose, double blend) const {
  const Bind bind = BindOf(pose);
  const size_t width = numbers_.spec.influences;
  const auto mix = [&](const Bounded& from, const Bounded& to) { return from + Bounded{blend, 0} * (to - from); };
  // A_j = [R_j | p_j - R_j (J_j + D_j)], p_j = G_j B_j^-1 J_j, here relative to the hips. The increments' errors enter
  // the translation through |R_j|.
  std::vector<Matrix4> bones;
  std::vector<std::array<double, 3>> bone_errors;
  for (size_t b = 0; b < numbers_.bones.size(); ++b) {
    const Matrix4& joint = bind.joints[numbers_.bones[b]];
    Matrix4 bone = joint;
    std::array<double, 3> errors = {};
    for (size_t r = 0; r < 3; ++r) {
      double posed = joint[r][3], moved = 0;
      for (size_t c = 0; c < 3; ++c) {
        const Bounded d = mix(before_.increments[3 * b + c], last_.increments[3 * b + c]);
        posed += joint[r][c] * numbers_.pivots[3 * b + c];
        moved += joint[r][c] * (numbers_.pivots[3 * b + c] + d.value);
        errors[r] += std::abs(joint[r][c]) * d.error;
      }
      bone[r][3] = posed - moved - bind.hips[r];
    }
    bones.push_back(bone);
    bone_errors.push_back(errors);
  }
  Frame frame;
  for (size_t i = 0; i < numbers_.n; ++i) {
    Bounded point[3];
    for (size_t c = 0; c < 3; ++c) {
      point[c] = Bounded{numbers_.positions[3 * i + c], 0} +
                 mix(before_.displacement[3 * i + c], last_.displacement[3 * i + c]);
    }
    for (size_t r = 0; r < 3; ++r) {
      std::vector<std::array<double, 4>> rows;
      double error = 0;
      for (size_t k = 0; k < width; ++k) {
        const size_t bone = numbers_.influence_bones[i * width + k];
        rows.push_back(bones[bone][r]);
        error += numbers_.influence_weights[i * width + k] * bone_errors[bone][r];
      }
      Bounded position = BlendRow(rows, &numbers_.influence_weights[i * width], point);
      position.error += error;
      frame.relative.push_back(position);
      frame.world.push_back(position + Bounded{bind.hips[r], 0});
    }
  }
  return frame;
}

Vector ReferenceNetwork::Normals(const Vector& relative) const {
  std::vector<std::array<Sum, 3>> sums(numbers_.n);
  for (size_t f = 0; f < numbers_.faces.size(); f += 3) {
    const auto at = [&](size_t corner, size_t axis) { return relative[3 * size_t{numbers_.faces[f + corner]} + axis]; };
    for (size_t axis = 0; axis < 3; ++axis) {
      const size_t u = (axis + 1) % 3, v = (axis + 2) % 3;
      const Bounded cross =
          (at(1, u) - at(0, u)) * (at(2, v) - at(0, v)) - (at(1, v) - at(0, v)) * (at(2, u) - at(0, u));
      for (size_t corner = 0; corner < 3; ++corner) sums[numbers_.faces[f + corner]][axis].Add(cross, 1.0);
    }
  }
  Vector normals;
  for (const auto& sum : sums) {
    const Bounded n[3] = {sum[0].Total(), sum[1].Total(), sum[2].Total()};
    const Bounded inverse = InverseSquareRoot(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    for (const Bounded& component : n) normals.push_back(component * inverse);
  }
  return normals;
}

}  // namespace dcloth::testing

// A small random garment with a patch stage: its numbers in double, and the same as the engine's view of a model.
#ifndef DCLOTH_TESTS_UNIT_ENGINE_NETWORK_PATCH_MODEL_H_
#define DCLOTH_TESTS_UNIT_ENGINE_NETWORK_PATCH_MODEL_H_

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <numeric>
#include <random>
#include <vector>

#include "engine/format/view.h"
#include "kernels/half.h"
#include "kernels/matvec/matvec_pack.h"
#include "tests/unit/engine/cloth_fixture.h"

namespace dcloth::testing {

struct PatchSpec {
  uint32_t patches = 5, points = 3, width = 16, neighbours = 2, layers = 2, embedding = 3, capsules = 4, sources = 4;
  format::WeightType type = format::WeightType::kF32;
  uint32_t rings = 6, segments = 10;  // of the tube
  uint32_t seed = 1;

  uint32_t inputs() const { return format::PatchInputs(points, embedding); }
  uint32_t all_points() const { return patches * points; }
};

class PatchModel {
 public:
  explicit PatchModel(const PatchSpec& given) : spec(given), tube_(Tube(given)), opened_(tube_), random_(given.seed) {
    using format::kCapsulesALimb, format::kLimbsAPatch, format::kPointInfluences;
    const uint32_t joints = tube_.numbers.spec.joints, all = spec.all_points();
    const uint32_t n = static_cast<uint32_t>(tube_.numbers.n);
    stage_.patch_count = spec.patches;
    stage_.point_count = spec.points;
    stage_.width = spec.width;
    stage_.neighbour_count = spec.neighbours;
    stage_.layer_count = spec.layers;
    stage_.embedding_size = spec.embedding;
    stage_.capsule_count = spec.capsules;
    stage_.source_count = spec.sources;
    stage_.joints = Indices<uint8_t>(spec.patches, joints);
    stage_.axes = Axes();
    stage_.centres = Floats(size_t{3} * spec.patches, -0.5, 0.5);
    stage_.point_joints = Indices<uint8_t>(size_t{kPointInfluences} * all, joints);
    stage_.point_parts = Parts(all);
    stage_.capsule_joints = Indices<uint8_t>(spec.capsules, joints);
    stage_.capsules = Capsules();
    stage_.limbs = Indices<uint8_t>(size_t{kLimbsAPatch} * kCapsulesALimb * spec.patches, spec.capsules);
    stage_.near = Indices<uint8_t>(size_t{spec.layers} * spec.neighbours * spec.patches, spec.patches);
    stage_.embedding = spec.embedding != 0 ? Floats(size_t{spec.patches} * spec.embedding, -1, 1) : nullptr;
    stage_.keep = Floats(spec.points, 0.3, 0.7);
    stage_.sources = Sources(all);
    AddGroups(n, all);
    stage_.enter = Dense(spec.inputs(), spec.width, 0.5, true);
    for (uint32_t l = 0; l < spec.layers; ++l)
      stage_.mix[l] = Dense((1 + spec.neighbours) * spec.width, spec.width, 0.5, true);
    stage_.input_gates = Dense(spec.width, 3 * spec.width, 1, true);
    stage_.hidden_gates = Dense(spec.width, 3 * spec.width, 1, false);
    stage_.out = Dense(spec.width + spec.inputs(), 3 * spec.points, 0.4, true);
    stage_.map = Dense(3 * spec.sources, map_columns_, 1, true);
    // Only the verifier makes a view of a file; here the stage is put into one.
    const_cast<format::ModelView*>(&view())->patch_stage = stage_;
  }

  const OpenedModel& opened() const { return opened_; }
  const format::ModelView& view() const { return *reinterpret_cast<const format::ModelView*>(opened_.get()); }
  const format::PatchStageView& stage() const { return stage_; }
  const Numbers& numbers() const { return tube_.numbers; }

  // y = x W + b of a layer's own numbers, rounded as the model holds them.
  std::vector<double> Apply(const format::LinearView& linear, const std::vector<double>& x) const {
    const Layer& layer = *std::find_if(layers_.begin(), layers_.end(),
                                       [&](const Layer& l) { return l.weights == linear.weights; });
    EXPECT_EQ(x.size(), linear.rows);
    std::vector<double> y(layer.bias);
    for (size_t j = 0; j < x.size(); ++j) {
      for (size_t c = 0; c < y.size(); ++c) y[c] += x[j] * layer.numbers[j * y.size() + c];
    }
    return y;
  }

  const PatchSpec spec;

 private:
  struct Layer {
    const void* weights;
    std::vector<double> numbers, bias;  // [rows, columns], [columns]
  };

  static TestModel Tube(const PatchSpec& spec) {
    ModelSpec tube;
    tube.skeleton = tube.mesh = false;
    tube.rings = spec.rings;
    tube.segments = spec.segments;
    return BuildModel(tube);
  }

  double Uniform(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random_); }

  template <typename T>
  const T* Keep(const std::vector<T>& values) {
    memory_.emplace_back(values.data(), values.size() * sizeof(T));
    return reinterpret_cast<const T*>(memory_.back().data());
  }
  const float* Floats(size_t count, double low, double high) {
    std::vector<float> values(count);
    for (float& value : values) value = static_cast<float>(Uniform(low, high));
    return Keep(values);
  }
  template <typename T>
  const T* Indices(size_t count, uint32_t limit) {
    std::vector<T> values(count);
    for (T& value : values) value = static_cast<T>(random_() % limit);
    return Keep(values);
  }

  // A turn about a tilted axis for each patch, columns out, up, along.
  const float* Axes() {
    std::vector<float> axes;
    for (uint32_t k = 0; k < spec.patches; ++k) {
      const double a = Uniform(-3, 3), b = Uniform(-1, 1), ca = std::cos(a), sa = std::sin(a), cb = std::cos(b),
                   sb = std::sin(b);
      for (const double value : {ca, -sa * cb, sa * sb, sa, ca * cb, -ca * sb, 0.0, sb, cb})
        axes.push_back(static_cast<float>(value));
    }
    return Keep(axes);
  }
  const float* Parts(uint32_t all) {
    std::vector<float> parts;
    for (uint32_t g = 0; g < all; ++g) {
      double weights[format::kPointInfluences], sum = 0;
      for (double& weight : weights) sum += weight = Uniform(0, 1);
      const double place[3] = {Uniform(-0.4, 0.4), Uniform(0, 1), Uniform(-0.4, 0.4)};
      for (const double weight : weights) {
        for (const double x : place) parts.push_back(static_cast<float>(x * weight / sum));
        parts.push_back(static_cast<float>(weight / sum));
      }
    }
    return Keep(parts);
  }
  const float* Capsules() {
    std::vector<float> capsules;
    for (uint32_t i = 0; i < spec.capsules; ++i) {
      for (int c = 0; c < 6; ++c) capsules.push_back(static_cast<float>(Uniform(-0.4, 0.8)));
      for (int end = 0; end < 2; ++end) capsules.push_back(static_cast<float>(Uniform(0.1, 0.3)));
    }
    return Keep(capsules);
  }
  const uint16_t* Sources(uint32_t all) {
    std::vector<uint16_t> order(all), sources;
    std::iota(order.begin(), order.end(), uint16_t{0});
    for (uint32_t g = 0; g < all; ++g) {
      std::shuffle(order.begin(), order.end(), random_);
      sources.insert(sources.end(), order.begin(), order.begin() + spec.sources);
    }
    return Keep(sources);
  }
  // Groups of uneven size, at least one vertex each.
  void AddGroups(uint32_t n, uint32_t all) {
    std::vector<uint16_t> vertices(n);
    std::iota(vertices.begin(), vertices.end(), uint16_t{0});
    std::shuffle(vertices.begin(), vertices.end(), random_);
    std::vector<uint32_t> sizes(all, 1), starts = {0};
    for (uint32_t v = all; v < n; ++v) ++sizes[std::min<uint32_t>(random_() % all, random_() % all)];
    for (const uint32_t size : sizes) {
      starts.push_back(starts.back() + size);
      map_columns_ += static_cast<uint32_t>(kernels::PaddedColumns(3 * size));
    }
    stage_.vertices = Keep(vertices);
    stage_.group_starts = Keep(starts);
  }

  format::LinearView Dense(uint32_t rows, uint32_t columns, double gain, bool biased) {
    const size_t padded = kernels::PaddedColumns(columns);
    std::vector<float> weights(size_t{rows} * columns), bias(padded);
    const double reach = gain * std::sqrt(3.0 / rows);
    for (float& weight : weights) weight = static_cast<float>(Uniform(-reach, reach));
    for (uint32_t c = 0; biased && c < columns; ++c) bias[c] = static_cast<float>(Uniform(-0.1, 0.1));
    format::LinearView view = {};
    view.rows = rows;
    view.columns = columns;
    view.type = spec.type;
    if (biased) view.bias = Keep(bias);
    Layer layer;
    layer.numbers.assign(weights.begin(), weights.end());
    layer.bias.assign(bias.begin(), bias.begin() + columns);
    const kernels::MatrixShape shape = {rows, columns, columns, 1};
    if (spec.type == format::WeightType::kI8) {
      std::vector<float> scales(padded, 1.0f);
      std::vector<int8_t> levels(weights.size()), packed(kernels::PairPanelElements(rows, columns));
      for (uint32_t c = 0; c < columns; ++c) {
        double largest = 0;
        for (uint32_t j = 0; j < rows; ++j) largest = std::max(largest, std::abs(layer.numbers[j * columns + c]));
        scales[c] = static_cast<float>(largest / 127);
        for (uint32_t j = 0; j < rows; ++j) {
          double& number = layer.numbers[j * columns + c];
          const double level = std::round(number / static_cast<double>(scales[c]));
          levels[j * columns + c] = static_cast<int8_t>(std::clamp(level, -127.0, 127.0));
          number = levels[j * columns + c] * static_cast<double>(scales[c]);
        }
      }
      kernels::PackPairPanelsI8(levels.data(), shape, packed.data());
      view.weights = Keep(packed);
      view.column_scales = Keep(scales);
    } else if (spec.type == format::WeightType::kF16) {
      std::vector<uint16_t> packed(kernels::PanelElements(rows, columns));
      kernels::PackPanelsF16(weights.data(), shape, packed.data());
      view.weights = Keep(packed);
      for (double& number : layer.numbers)
        number = static_cast<double>(kernels::FloatFromHalf(kernels::HalfFromFloat(static_cast<float>(number))));
    } else {
      std::vector<float> packed(kernels::PanelElements(rows, columns));
      kernels::PackPanelsF32(weights.data(), shape, packed.data());
      view.weights = Keep(packed);
    }
    layer.weights = view.weights;
    layers_.push_back(std::move(layer));
    return view;
  }

  TestModel tube_;
  OpenedModel opened_;
  std::mt19937 random_;
  std::deque<AlignedBytes> memory_;
  std::deque<Layer> layers_;
  format::PatchStageView stage_ = {};
  uint32_t map_columns_ = 0;
};

}  // namespace dcloth::testing

#endif  // DCLOTH_TESTS_UNIT_ENGINE_NETWORK_PATCH_MODEL_H_

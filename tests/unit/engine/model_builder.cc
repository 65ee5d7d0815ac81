#include "tests/unit/engine/model_builder.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include "tests/unit/engine/tensor_writer.h"
#include "tests/unit/engine/test_body.h"
#include "tests/unit/engine/test_patches.h"

namespace dcloth::testing {
namespace {

void AddCoarseMesh(uint32_t n, TensorWriter* writer, format::GarmentT* garment) {
  std::vector<uint16_t> vertices, faces;
  for (uint32_t v = 0; v < n; v += 2) vertices.push_back(static_cast<uint16_t>(v));
  for (uint16_t v = 2; v < vertices.size(); ++v) {
    for (const int corner : {0, 1, 2}) faces.push_back(static_cast<uint16_t>(v - corner));
  }
  garment->coarse_vertices = writer->Add(format::DType_U16, {static_cast<uint32_t>(vertices.size())}, vertices);
  garment->coarse_faces = writer->Add(format::DType_U16, {static_cast<uint32_t>(faces.size() / 3), 3}, faces);
}

void AddTexture(const Numbers& numbers, TensorWriter* writer, format::GarmentT* garment) {
  const uint32_t segments = numbers.spec.segments, rings = numbers.spec.rings, n = rings * segments;
  std::vector<float> places;
  std::vector<uint16_t> seam, faces = numbers.faces;
  const auto place = [&](uint32_t ring, uint32_t segment) {  // leaning, so that neither axis runs along the mesh
    places.push_back((static_cast<float>(segment) + 0.2f * static_cast<float>(ring)) / static_cast<float>(segments));
    places.push_back((static_cast<float>(ring) - 0.3f * static_cast<float>(segment)) / static_cast<float>(rings));
  };
  for (uint32_t v = 0; v < n; ++v) place(v / segments, v % segments);
  for (uint32_t ring = 0; ring < rings; ++ring) {
    seam.push_back(static_cast<uint16_t>(ring * segments));
    place(ring, segments);
  }
  for (size_t t = 0; t < faces.size(); t += 3) {
    const auto last = [&](uint16_t v) { return v % segments == segments - 1; };
    if (std::none_of(&faces[t], &faces[t] + 3, last)) continue;
    for (size_t k = t; k < t + 3; ++k) {
      if (faces[k] % segments == 0) faces[k] = static_cast<uint16_t>(n + faces[k] / segments);
    }
  }
  const auto triangles = static_cast<uint32_t>(faces.size() / 3);
  garment->texture_coordinates = writer->Add(format::DType_F32, {n + rings, 2}, places);
  garment->seam_vertices = writer->Add(format::DType_U16, {rings}, seam);
  garment->textured_faces = writer->Add(format::DType_U16, {triangles, 3}, faces);
}

// A tube of 1 m around the hips, open at both ends.
void AddTube(const ModelSpec& spec, Numbers* numbers) {
  numbers->n = size_t{spec.rings} * spec.segments;
  const auto index = [&](uint32_t ring, uint32_t segment) {
    return static_cast<uint16_t>(ring * spec.segments + segment % spec.segments);
  };
  std::vector<std::set<size_t>> neighbours(numbers->n);
  for (uint32_t ring = 0; ring < spec.rings; ++ring) {
    for (uint32_t segment = 0; segment < spec.segments; ++segment) {
      const double angle = 2 * std::numbers::pi * segment / spec.segments;
      const double radius = 0.2 + 0.3 * ring / spec.rings;
      numbers->positions.insert(numbers->positions.end(),
                                {radius * std::cos(angle), 1.0 - 1.0 * ring / spec.rings, radius * std::sin(angle)});
      neighbours[index(ring, segment)].insert(index(ring, segment));
      if (ring + 1 == spec.rings) continue;
      const uint16_t a = index(ring, segment), b = index(ring, segment + 1), c = index(ring + 1, segment),
                     e = index(ring + 1, segment + 1);
      numbers->faces.insert(numbers->faces.end(), {a, b, c, b, e, c});
    }
  }
  for (size_t f = 0; f < numbers->faces.size(); f += 3) {
    for (size_t corner = 0; corner < 3; ++corner) {
      for (size_t other = 0; other < 3; ++other)
        neighbours[numbers->faces[f + corner]].insert(numbers->faces[f + other]);
    }
  }
  for (const auto& row : neighbours) numbers->neighbours.emplace_back(row.begin(), row.end());
}

// Joint j's bind matrix: a turn about +Y and a place; stored is the inverse.
void AddSkeleton(const ModelSpec& spec, TensorWriter* writer, Numbers* numbers, format::CharacterT* character) {
  std::vector<float> inverse;
  for (uint32_t j = 0; j < spec.joints; ++j) {
    const double turn = writer->Uniform(-3, 3), c = std::cos(turn), s = std::sin(turn);
    std::array<double, 3> p = {writer->Uniform(-0.4, 0.4), writer->Uniform(0.1, 1.5), writer->Uniform(-0.2, 0.2)};
    if (!spec.skeleton_joints.empty()) p = spec.skeleton_joints[j].second;
    numbers->joint_positions.push_back(p);
    const double rows[12] = {c, 0, -s, -(c * p[0] - s * p[2]), 0, 1, 0, -p[1], s, 0, c, -(s * p[0] + c * p[2])};
    for (const double value : rows) inverse.push_back(static_cast<float>(value));
    character->joint_names.push_back(spec.skeleton_joints.empty() ? "joint_" + std::to_string(j)
                                                                  : spec.skeleton_joints[j].first);
  }
  numbers->hips = spec.skeleton_joints.empty() ? spec.joints / 2 : 0;
  character->hips = static_cast<uint16_t>(numbers->hips);
  for (uint32_t j = 0; j < (spec.parents ? spec.joints : 0); ++j) {
    const auto above = static_cast<uint16_t>(j == 0 ? character->hips : j - 1);
    character->parents.push_back(j == character->hips ? 65535 : above);
  }
  character->inverse_bind = writer->Floats({spec.joints, 12}, inverse, &numbers->inverse_bind);
}

void AddFeatures(const ModelSpec& spec, TensorWriter* writer, Numbers* numbers, format::FeaturesT* features) {
  for (uint32_t j = 0; j < spec.joints; j += 2) features->joints.push_back(static_cast<uint16_t>(spec.joints - 1 - j));
  numbers->feature_joints.assign(features->joints.begin(), features->joints.end());
  features->root_motion = spec.root_motion;
  const auto d =
      static_cast<uint32_t>(9 * features->joints.size() + (spec.root_motion == format::RootMotion_Air    ? 7
                                                           : spec.root_motion == format::RootMotion_Hips ? 4
                                                                                                         : 0));
  numbers->d = d;
  features->mean = writer->RandomFloats({d}, -0.3, 0.3, &numbers->mean);
  features->inverse_deviation = writer->RandomFloats({d}, 0.5, 2, &numbers->inverse_deviation);
  features->low = writer->RandomFloats({d}, -2, -0.6, &numbers->low);  // tight enough that some features clamp
  features->high = writer->RandomFloats({d}, 0.6, 2, &numbers->high);
}

// Rows of `width` weights that sum to 1.
std::unique_ptr<format::TensorT> WeightRows(TensorWriter* writer, size_t rows, uint32_t width,
                                            std::vector<double>* values) {
  std::vector<float> weights;
  for (size_t i = 0; i < rows; ++i) {
    std::vector<double> row(width);
    double sum = 0;
    for (double& weight : row) sum += weight = writer->Uniform(0, 1);
    for (const double weight : row) weights.push_back(static_cast<float>(weight / sum));
  }
  return writer->Floats({static_cast<uint32_t>(rows), width}, weights, values);
}

std::unique_ptr<format::StaticStageT> StaticStage(const ModelSpec& spec, TensorWriter* writer, Numbers* numbers) {
  auto stage = std::make_unique<format::StaticStageT>();
  std::vector<float> pivots;
  for (uint32_t b = 0; b < spec.bones; ++b) {
    const size_t joint = spec.joints - 1 - b;
    stage->bones.push_back(static_cast<uint16_t>(joint));
    numbers->bones.push_back(joint);
    for (const double value : numbers->joint_positions[joint]) pivots.push_back(static_cast<float>(value));
  }
  const auto n = static_cast<uint32_t>(numbers->n), d = static_cast<uint32_t>(numbers->d);
  stage->pivots = writer->Floats({spec.bones, 3}, pivots, &numbers->pivots);
  stage->hidden = writer->RandomLinear(d, spec.static_width, 1.0, 0.2, &numbers->static_hidden);
  stage->increments = writer->RandomLinear(spec.static_width, 3 * spec.bones, 0.1, 0.02, &numbers->static_increments);
  stage->influences = static_cast<uint8_t>(spec.influences);
  stage->influence_bones = writer->RandomBytes({n, spec.influences}, spec.bones, &numbers->influence_bones);
  stage->influence_weights = WeightRows(writer, n, spec.influences, &numbers->influence_weights);
  return stage;
}

std::unique_ptr<format::MeshLayerT> MeshLayer(uint32_t input_width, uint32_t width, TensorWriter* writer,
                                              Layer* layer) {
  auto table = std::make_unique<format::MeshLayerT>();
  layer->input_width = input_width;
  // Magnitudes sum to 1 over a column of the input and to a quarter or a half over the recurrent ones, so that a bound
  // on rounding errors shrinks from tick to tick; the output's bias keeps the norm away from dividing by little.
  const double in = 1.0 / input_width, hidden = 1.0 / width;
  table->input_gates = writer->RandomFloats({input_width, 3 * width}, -2 * in, 2 * in, &layer->input_gates);
  table->gate_bias = writer->RandomFloats({3 * width}, -0.5, 0.5, &layer->gate_bias);
  table->hidden_gates = writer->RandomFloats({width, 2 * width}, -hidden, hidden, &layer->hidden_gates);
  table->hidden_candidate = writer->RandomFloats({width, width}, -hidden / 2, hidden / 2, &layer->hidden_candidate);
  table->output = writer->RandomFloats({width, width}, -hidden, hidden, &layer->output);
  table->output_bias = writer->RandomFloats({width}, -1, 1, &layer->output_bias);
  table->norm_gain = writer->RandomFloats({width}, 0.25, 0.5, &layer->norm_gain);
  table->norm_offset = writer->RandomFloats({width}, -0.3, 0.3, &layer->norm_offset);
  table->prelu_slope = 0.25f;
  layer->prelu_slope = 0.25;
  return table;
}

// The layer's float matrices as integers: each column's largest weight is 127 steps. Steps of inputs reach past what
// the norm before gives, 0.5 sqrt(15) + 0.3.
void MakeIntegers(uint32_t width, bool first, TensorWriter* writer, format::MeshLayerT* table, Layer* layer) {
  std::vector<float> inverse_steps;
  for (uint32_t f = 0; f < width; ++f) inverse_steps.push_back(static_cast<float>(writer->Uniform(12000, 14000)));
  std::vector<int8_t> integers(size_t{width} * (first ? 4 : 7) * width);
  std::vector<float> scales;
  const size_t stride = integers.size() / width;
  const auto add = [&](std::vector<double>* matrix, bool inputs) {
    const size_t columns = matrix->size() / width;
    for (size_t c = 0; c < columns; ++c) {
      const auto step = [&](size_t k) { return 1.0 / (inputs ? static_cast<double>(inverse_steps[k]) : 32767.0); };
      double largest = 0;
      for (size_t k = 0; k < width; ++k) largest = std::max(largest, std::abs((*matrix)[k * columns + c]) * step(k));
      const auto scale = static_cast<float>(largest / 127);
      for (size_t k = 0; k < width; ++k) {
        double& weight = (*matrix)[k * columns + c];
        const double level = std::clamp(std::nearbyint(weight * step(k) / static_cast<double>(scale)), -127.0, 127.0);
        integers[k * stride + scales.size()] = static_cast<int8_t>(level);
        weight = level * static_cast<double>(scale) / step(k);
      }
      scales.push_back(scale);
    }
  };
  if (!first) {
    add(&layer->input_gates, true);
    table->input_gates.reset();
    table->input_inverse_steps = writer->Add(format::DType_F32, {width}, inverse_steps);
  }
  for (std::vector<double>* matrix : {&layer->hidden_gates, &layer->hidden_candidate, &layer->output})
    add(matrix, false);
  table->hidden_gates.reset();
  table->hidden_candidate.reset();
  table->output.reset();
  table->weights = writer->Add(format::DType_I8, {width, static_cast<uint32_t>(stride)}, integers);
  table->column_scales = writer->Add(format::DType_F32, {static_cast<uint32_t>(stride)}, scales);
}

std::unique_ptr<format::MeshStageT> MeshStage(const ModelSpec& spec, TensorWriter* writer, Numbers* numbers) {
  auto stage = std::make_unique<format::MeshStageT>();
  const auto n = static_cast<uint32_t>(numbers->n), width = spec.feature_width;
  stage->body_influences = static_cast<uint8_t>(spec.body_influences);
  stage->body_points = writer->RandomFloats({n, 3}, -0.5, 0.5, &numbers->body_points);
  stage->body_joints = writer->RandomBytes({n, spec.body_influences}, spec.joints, &numbers->body_joints);
  stage->body_weights = WeightRows(writer, n, spec.body_influences, &numbers->body_weights);
  stage->input_mean = writer->RandomFloats({3}, -0.2, 0.2, &numbers->input_mean);
  stage->input_inverse_deviation = writer->RandomFloats({3}, 1, 3, &numbers->input_inverse_deviation);
  std::vector<uint32_t> starts = {0};
  std::vector<uint16_t> columns;
  for (const std::vector<size_t>& row : numbers->neighbours) {
    for (const size_t j : row) columns.push_back(static_cast<uint16_t>(j));
    starts.push_back(static_cast<uint32_t>(columns.size()));
  }
  stage->row_starts = writer->Add(format::DType_U32, {n + 1}, starts);
  stage->columns = writer->Add(format::DType_U16, {starts.back()}, columns);
  stage->feature_width = static_cast<uint16_t>(width);
  for (uint32_t l = 0; l < spec.layers; ++l) {
    numbers->layers.emplace_back();
    stage->layers.push_back(MeshLayer(l == 0 ? 3 : width, width, writer, &numbers->layers.back()));
    if (spec.integer_layers) MakeIntegers(width, l == 0, writer, stage->layers.back().get(), &numbers->layers.back());
  }
  stage->embed = writer->RandomFloats({width}, -2.0 / width, 2.0 / width, &numbers->embed);
  stage->embed_bias = 0.125f;
  numbers->embed_bias = 0.125;
  stage->hidden = writer->RandomLinear(n, spec.mesh_width, 1.0, 0.3, &numbers->mesh_hidden);
  stage->coefficients = writer->RandomLinear(spec.mesh_width, spec.rank != 0 ? spec.rank : spec.mesh_basis, 1.0, 0.3,
                                             &numbers->mesh_coefficients);
  return stage;
}

void AddDisplacement(const ModelSpec& spec, TensorWriter* writer, Numbers* numbers, format::ModelT* model) {
  const auto even = [](uint32_t count) { return count + (count & 1u); };
  model->displacement = std::make_unique<format::DisplacementT>();
  LinearKind kind;
  if (spec.rank != 0) {
    numbers->skeleton_rows = spec.rank;
    model->displacement->head = writer->RandomLinear(spec.units, spec.rank, 0.5, 0, &numbers->head);
  } else {
    numbers->skeleton_rows = even(spec.units);
    numbers->mesh_rows = spec.mesh ? even(spec.mesh_basis) : 0;
    if (spec.units % 2 != 0) kind.zero_rows.insert(spec.units);
    if (spec.mesh && spec.mesh_basis % 2 != 0) kind.zero_rows.insert(numbers->skeleton_rows + spec.mesh_basis);
  }
  model->displacement->skeleton_rows = static_cast<uint32_t>(numbers->skeleton_rows);
  model->displacement->mesh_rows = static_cast<uint32_t>(numbers->mesh_rows);
  const auto rows = static_cast<uint32_t>(numbers->skeleton_rows + numbers->mesh_rows);
  model->displacement->basis =
      writer->RandomLinear(rows, static_cast<uint32_t>(3 * numbers->n), 0.3, 0, &numbers->basis, kind);
}

}  // namespace

AlignedBytes TestModel::Bytes() const {
  flatbuffers::FlatBufferBuilder builder;
  builder.Finish(format::Model::Pack(builder, tables.get()), format::ModelIdentifier());
  return AlignedBytes(builder.GetBufferPointer(), builder.GetSize());
}

TestModel BuildModel(const ModelSpec& spec) {
  TestModel model;
  Numbers& numbers = model.numbers;
  numbers.spec = spec;
  model.tables = std::make_unique<format::ModelT>();
  format::ModelT& tables = *model.tables;
  TensorWriter writer(spec.precision, spec.seed, &tables.weights);
  tables.format_major = 1;
  tables.producer = "model_builder";
  tables.precision = "test";
  tables.tick_rate = 30;
  numbers.tick_rate = 30;
  AddTube(spec, &numbers);
  const auto n = static_cast<uint32_t>(numbers.n);
  tables.garment = std::make_unique<format::GarmentT>();
  tables.garment->name = "tube";
  tables.garment->vertices = n;
  tables.garment->template_positions =
      writer.Floats({n, 3}, std::vector<float>(numbers.positions.begin(), numbers.positions.end()), &numbers.positions);
  tables.garment->faces =
      writer.Add(format::DType_U16, {static_cast<uint32_t>(numbers.faces.size() / 3), 3}, numbers.faces);
  if (spec.coarse) AddCoarseMesh(n, &writer, tables.garment.get());
  if (spec.texture) AddTexture(numbers, &writer, tables.garment.get());
  tables.character = std::make_unique<format::CharacterT>();
  AddSkeleton(spec, &writer, &numbers, tables.character.get());
  tables.features = std::make_unique<format::FeaturesT>();
  AddFeatures(spec, &writer, &numbers, tables.features.get());
  tables.static_stage = StaticStage(spec, &writer, &numbers);
  if (spec.patches != 0) {
    tables.patch_stage = PatchStage(spec, &writer, &numbers);
  } else if (spec.skeleton) {
    const auto d = static_cast<uint32_t>(numbers.d), k = spec.units;
    tables.skeleton_stage = std::make_unique<format::SkeletonStageT>();
    tables.skeleton_stage->input = writer.RandomLinear(d, 3 * k, 2.0, 0.3, &numbers.gru_input);
    tables.skeleton_stage->hidden = writer.RandomLinear(k, 3 * k, 0.25, 0.3, &numbers.gru_hidden);
    if (spec.mesh) tables.mesh_stage = MeshStage(spec, &writer, &numbers);
    AddDisplacement(spec, &writer, &numbers, &tables);
  }
  if (spec.body) AddBody(&model, 3, 5);
  if (spec.touch) {
    std::vector<uint8_t> classes(n), touched_by(17, 1);  // rings of 5, the pole above, the one below
    for (uint32_t i = 0; i < n; ++i) classes[i] = static_cast<uint8_t>(i % 3);
    for (const size_t upper : {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 15}) touched_by[upper] = 1 | 2;
    AddTouch(&model, classes, touched_by);
  }
  if (spec.body) AddOrders(&model);
  return model;
}

std::vector<float> PoseAt(const Numbers& numbers, double seconds, std::array<double, 3> place) {
  std::vector<float> matrices;
  const double yaw = 0.8 * std::sin(1.3 * seconds) + 0.5 * seconds, c = std::cos(yaw), s = std::sin(yaw);
  const std::array<double, 3> root = {place[0] + 1.1 * seconds, place[1] + 0.03 * std::sin(9 * seconds),
                                      place[2] + std::sin(0.7 * seconds)};
  for (size_t j = 0; j < numbers.joint_positions.size(); ++j) {
    // G_j B_j^-1 bends by `bend` about the joint's own place, then the character stands at `root` and faces `yaw`.
    const double bend = 0.4 * std::sin(2.0 * seconds + static_cast<double>(j)), cb = std::cos(bend),
                 sb = std::sin(bend);
    const std::array<double, 3>& p = numbers.joint_positions[j];
    const double turn[3][3] = {{c, 0, s}, {0, 1, 0}, {-s, 0, c}}, tilt[3][3] = {{1, 0, 0}, {0, cb, -sb}, {0, sb, cb}};
    // B_j's linear part is the transpose of the inverse's.
    double bind[3][3], local[3][3] = {}, world[3][3] = {};
    for (size_t row = 0; row < 3; ++row) {
      for (size_t k = 0; k < 3; ++k) bind[row][k] = numbers.inverse_bind[12 * j + 4 * k + row];
    }
    for (size_t row = 0; row < 3; ++row) {
      for (size_t k = 0; k < 3; ++k) {
        for (size_t i = 0; i < 3; ++i) local[row][k] += tilt[row][i] * bind[i][k];
      }
    }
    for (size_t row = 0; row < 3; ++row) {
      for (size_t k = 0; k < 3; ++k) {
        for (size_t i = 0; i < 3; ++i) world[row][k] += turn[row][i] * local[i][k];
        matrices.push_back(static_cast<float>(world[row][k]));
      }
      matrices.push_back(
          static_cast<float>(turn[row][0] * p[0] + turn[row][1] * p[1] + turn[row][2] * p[2] + root[row]));
    }
    matrices.insert(matrices.end(), {0, 0, 0, 1});
  }
  return matrices;
}

}  // namespace dcloth::testing

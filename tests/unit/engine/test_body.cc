#include "tests/unit/engine/test_body.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>

#include "kernels/nearest/nearest_order.h"
#include "tests/unit/engine/tensor_writer.h"

namespace dcloth::testing {
namespace {

Point Minus(const Point& a, const Point& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
double Dot(const Point& a, const Point& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
Point Cross(const Point& a, const Point& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
Point Unit(const Point& a) {
  const double length = std::sqrt(Dot(a, a));
  return {a[0] / length, a[1] / length, a[2] / length};
}

// The nearest of a triangle's plane where the foot lies inside, its three edges and its corners; barycentric.
std::array<double, 3> ClosestBarycentric(const Point& p, const Point corner[3]) {
  std::array<double, 3> best = {1, 0, 0};
  double least = 1e30;
  const auto offer = [&](const std::array<double, 3>& weights) {
    Point d = p;
    for (size_t k = 0; k < 3; ++k) {
      for (size_t c = 0; c < 3; ++c) d[c] -= weights[k] * corner[k][c];
    }
    if (Dot(d, d) < least) {
      least = Dot(d, d);
      best = weights;
    }
  };
  const Point ab = Minus(corner[1], corner[0]), ac = Minus(corner[2], corner[0]), ap = Minus(p, corner[0]);
  const Point normal = Cross(ab, ac);
  const double square = Dot(normal, normal);
  const double v = Dot(Cross(ap, ac), normal) / square, w = Dot(Cross(ab, ap), normal) / square;
  if (v >= 0 && w >= 0 && v + w <= 1) offer({1 - v - w, v, w});
  for (size_t k = 0; k < 3; ++k) {
    const Point edge = Minus(corner[(k + 1) % 3], corner[k]);
    const double t = std::clamp(Dot(Minus(p, corner[k]), edge) / Dot(edge, edge), 0.0, 1.0);
    std::array<double, 3> weights = {};
    weights[k] = 1 - t;
    weights[(k + 1) % 3] = t;
    offer(weights);
  }
  return best;
}

struct Triangle {
  size_t index[3];
  Point corner[3];
};

Triangle TriangleAt(const EggBody& body, const std::vector<Point>& posed, size_t face) {
  Triangle triangle;
  for (size_t k = 0; k < 3; ++k) {
    triangle.index[k] = body.faces[3 * face + k];
    triangle.corner[k] = posed[triangle.index[k]];
  }
  return triangle;
}

// Sum over the faces that hold all of `feature`'s vertices, weighted by the angle where the feature is one vertex.
Point PseudoNormal(const EggBody& body, const std::vector<Point>& posed, const std::vector<size_t>& feature) {
  Point sum = {};
  for (size_t f = 0; f < body.faces.size() / 3; ++f) {
    const Triangle t = TriangleAt(body, posed, f);
    const bool holds = std::all_of(feature.begin(), feature.end(), [&](size_t vertex) {
      return std::find(t.index, t.index + 3, vertex) != t.index + 3;
    });
    if (!holds) continue;
    double weight = 1;
    if (feature.size() == 1) {
      const size_t at = static_cast<size_t>(std::find(t.index, t.index + 3, feature[0]) - t.index);
      const Point a = Unit(Minus(t.corner[(at + 1) % 3], t.corner[at]));
      const Point b = Unit(Minus(t.corner[(at + 2) % 3], t.corner[at]));
      weight = std::acos(std::clamp(Dot(a, b), -1.0, 1.0));
    }
    const Point normal = Unit(Cross(Minus(t.corner[1], t.corner[0]), Minus(t.corner[2], t.corner[0])));
    for (size_t c = 0; c < 3; ++c) sum[c] += weight * normal[c];
  }
  return sum;
}

// A vertex that the hips carry, and joint 0 the more, the lower it lies.
void AddVertex(const Numbers& numbers, double x, double y, double z, EggBody* body) {
  const double share = 0.5 - 0.5 * (y - 0.6) / 0.45;
  for (const double value : {x, y, z}) body->positions.push_back(static_cast<float>(value));
  body->joints.insert(body->joints.end(), {static_cast<uint8_t>(numbers.hips), 0});
  body->weights.push_back(static_cast<float>(1 - share * share));
  body->weights.push_back(1 - body->weights.back());
}

// Rings of `segments` vertices from the top down, joined; `first` is their first vertex.
void JoinRings(uint32_t first, uint32_t rings, uint32_t segments, EggBody* body) {
  const auto index = [&](uint32_t r, uint32_t s) { return static_cast<uint16_t>(first + r * segments + s % segments); };
  for (uint32_t s = 0; s < segments; ++s) {
    for (uint32_t r = 0; r + 1 < rings; ++r) {
      body->faces.insert(body->faces.end(), {index(r, s), index(r, s + 1), index(r + 1, s + 1)});
      body->faces.insert(body->faces.end(), {index(r, s), index(r + 1, s + 1), index(r + 1, s)});
    }
  }
}

void AddEgg(const Numbers& numbers, uint32_t rings, uint32_t segments, EggBody* body) {
  const auto add = [&](double across, double up, double turn) {
    AddVertex(numbers, 0.3 * across * std::cos(turn), 0.6 + 0.45 * up, 0.26 * across * std::sin(turn), body);
  };
  for (uint32_t r = 0; r < rings; ++r) {
    const double down = std::numbers::pi * (r + 1) / (rings + 1);
    for (uint32_t s = 0; s < segments; ++s) add(std::sin(down), std::cos(down), 2 * std::numbers::pi * s / segments);
  }
  add(0, 1, 0);
  add(0, -1, 0);
  const auto index = [&](uint32_t r, uint32_t s) { return static_cast<uint16_t>(r * segments + s % segments); };
  const auto top = static_cast<uint16_t>(rings * segments), bottom = static_cast<uint16_t>(top + 1);
  JoinRings(0, rings, segments, body);
  for (uint32_t s = 0; s < segments; ++s) {
    body->faces.insert(body->faces.end(), {top, index(0, s + 1), index(0, s)});
    body->faces.insert(body->faces.end(), {bottom, index(rings - 1, s), index(rings - 1, s + 1)});
  }
}

void Store(const EggBody& body, TestModel* model) {
  const auto b = static_cast<uint32_t>(body.positions.size() / 3), f = static_cast<uint32_t>(body.faces.size() / 3);
  std::vector<uint32_t> starts = {0};
  std::vector<uint16_t> columns;
  for (uint32_t i = 0; i < b; ++i) {
    for (size_t c = 0; c < body.faces.size(); ++c) {
      if (body.faces[c] == i) columns.push_back(static_cast<uint16_t>(c / 3));
    }
    starts.push_back(static_cast<uint32_t>(columns.size()));
  }
  TensorWriter writer(model->numbers.spec.precision, 1, &model->tables->weights);
  auto table = std::make_unique<format::BodyT>();
  table->influences = 2;
  table->positions = writer.Add(format::DType_F32, {b, 3}, body.positions);
  table->joints = writer.Add(format::DType_U8, {b, 2}, body.joints);
  table->weights = writer.Add(format::DType_F32, {b, 2}, body.weights);
  table->faces = writer.Add(format::DType_U16, {f, 3}, body.faces);
  table->row_starts = writer.Add(format::DType_U32, {b + 1}, starts);
  table->columns = writer.Add(format::DType_U16, {3 * f}, columns);
  table->clearance = static_cast<float>(body.clearance);
  table->reach = static_cast<float>(body.reach);
  model->tables->body = std::move(table);
}

}  // namespace

EggBody AddBody(TestModel* model, uint32_t rings, uint32_t segments, float clearance, float reach) {
  EggBody body;
  body.clearance = static_cast<double>(clearance);
  body.reach = static_cast<double>(reach);
  AddEgg(model->numbers, rings, segments, &body);
  Store(body, model);
  return body;
}

EggBody AddTrunkAndArm(TestModel* model, uint32_t rings, uint32_t segments, size_t* trunk_vertices) {
  EggBody body;
  body.clearance = static_cast<double>(0.002f);
  body.reach = 1;
  AddEgg(model->numbers, rings, segments, &body);
  *trunk_vertices = body.positions.size() / 3;
  for (uint32_t r = 0; r < rings; ++r) {
    for (uint32_t s = 0; s < segments; ++s) {
      const double turn = 2 * std::numbers::pi * s / segments, height = 0.85 - 0.5 * r / (rings - 1);
      AddVertex(model->numbers, 0.08 + 0.16 * std::cos(turn), height, 0.16 * std::sin(turn), &body);
    }
  }
  JoinRings(static_cast<uint32_t>(*trunk_vertices), rings, segments, &body);
  Store(body, model);
  return body;
}

void AddTouch(TestModel* model, const std::vector<uint8_t>& classes, const std::vector<uint8_t>& touched_by) {
  TensorWriter writer(model->numbers.spec.precision, 1, &model->tables->weights);
  format::BodyT& body = *model->tables->body;
  body.touch_classes = writer.Add(format::DType_U8, {static_cast<uint32_t>(classes.size())}, classes);
  body.touched_by = writer.Add(format::DType_U8, {static_cast<uint32_t>(touched_by.size())}, touched_by);
}

void AddOrders(TestModel* model) {
  TensorWriter writer(model->numbers.spec.precision, 1, &model->tables->weights);
  format::BodyT& body = *model->tables->body;
  const uint8_t* const weights = model->tables->weights.data();
  const auto bytes_of = [&](const format::TensorT& tensor) { return weights + tensor.offset; };
  std::vector<float> cloth(3 * model->numbers.n), skin(3 * size_t{body.positions->shape[0]});
  std::memcpy(cloth.data(), bytes_of(*model->tables->garment->template_positions), cloth.size() * sizeof(float));
  std::memcpy(skin.data(), bytes_of(*body.positions), skin.size() * sizeof(float));
  std::vector<uint8_t> classes, touched_by;
  if (body.touch_classes) {
    classes.assign(bytes_of(*body.touch_classes), bytes_of(*body.touch_classes) + body.touch_classes->shape[0]);
    touched_by.assign(bytes_of(*body.touched_by), bytes_of(*body.touched_by) + body.touched_by->shape[0]);
  }
  std::vector<uint16_t> order(model->numbers.n);
  kernels::OrderPoints(cloth.data(), classes.empty() ? nullptr : classes.data(), order.size(), order.data());
  if (body.touch_classes) {
    const size_t groups = kernels::CountSiteGroups(touched_by.data(), touched_by.size());
    std::vector<uint16_t> sites(groups * kernels::kNearestGroup);
    kernels::OrderSites(skin.data(), touched_by.data(), touched_by.size(), sites.data());
    body.sites =
        writer.Add(format::DType_U16, {static_cast<uint32_t>(groups), uint32_t{kernels::kNearestGroup}}, sites);
  }
  body.garment_order = writer.Add(format::DType_U16, {static_cast<uint32_t>(order.size())}, order);
}

std::vector<Point> PoseBody(const EggBody& body, const Numbers& numbers, const std::vector<float>& pose) {
  std::vector<Point> posed(body.positions.size() / 3, Point{});
  for (size_t i = 0; i < posed.size(); ++i) {
    for (size_t k = 0; k < 2; ++k) {
      const size_t joint = body.joints[2 * i + k];
      const double* inverse = &numbers.inverse_bind[12 * joint];
      const float* world = &pose[16 * joint];
      Point local;
      for (size_t r = 0; r < 3; ++r) {
        local[r] = inverse[4 * r + 3];
        for (size_t c = 0; c < 3; ++c) local[r] += inverse[4 * r + c] * static_cast<double>(body.positions[3 * i + c]);
      }
      for (size_t r = 0; r < 3; ++r) {
        double value = static_cast<double>(world[4 * r + 3]);
        for (size_t c = 0; c < 3; ++c) value += static_cast<double>(world[4 * r + c]) * local[c];
        posed[i][r] += static_cast<double>(body.weights[2 * i + k]) * value;
      }
    }
  }
  return posed;
}

double SignedDistance(const EggBody& body, const std::vector<Point>& posed, const Point& point) {
  double least = 1e30;
  std::array<double, 3> weights = {};
  Point closest = {};
  size_t face = 0;
  for (size_t f = 0; f < body.faces.size() / 3; ++f) {
    const Triangle t = TriangleAt(body, posed, f);
    const std::array<double, 3> found = ClosestBarycentric(point, t.corner);
    Point at = {};
    for (size_t k = 0; k < 3; ++k) {
      for (size_t c = 0; c < 3; ++c) at[c] += found[k] * t.corner[k][c];
    }
    const Point away = Minus(point, at);
    if (Dot(away, away) >= least) continue;
    least = Dot(away, away);
    weights = found;
    closest = at;
    face = f;
  }
  std::vector<size_t> feature;
  for (size_t k = 0; k < 3; ++k) {
    if (weights[k] > 1e-9) feature.push_back(body.faces[3 * face + k]);
  }
  const double side = Dot(Minus(point, closest), PseudoNormal(body, posed, feature));
  return side < 0 ? -std::sqrt(least) : std::sqrt(least);
}

}  // namespace dcloth::testing

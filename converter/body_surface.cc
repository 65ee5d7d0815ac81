#include "converter/body_surface.h"

#include <algorithm>
#include <numeric>
#include <set>
#include <string>

#include "converter/error.h"
#include "converter/fold.h"
#include "engine/format/limits.h"
#include "kernels/nearest/nearest_order.h"

namespace dcloth::converter {
namespace {

constexpr double kCarried = 0.999;  // of a vertex' weight, for "alone"

std::vector<bool> Colliding(const Bundle& bundle) {
  std::vector<bool> collides(static_cast<size_t>(bundle.body_positions.rows()));
  for (size_t i = 0; i < collides.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(i);
    if (bundle.body_collides.size() != 0) {
      collides[i] = bundle.body_collides[row] != 0;
      continue;
    }
    double carried = 0;
    for (const uint32_t bone : bundle.bones) carried += static_cast<double>(bundle.body_joint_weights(row, bone));
    collides[i] = carried >= kCarried;
  }
  return collides;
}

struct Touch {
  std::vector<uint8_t> classes;     // [n]; empty where the bundle has no masks
  std::vector<uint8_t> touched_by;  // [bundle's body vertices]
};

Touch ReduceMasks(const Bundle& bundle) {
  Touch touch;
  if (bundle.touches.empty()) return touch;
  const std::set<uint32_t> masks(bundle.touches.begin(), bundle.touches.end());
  if (masks.size() > format::kMaxTouchClasses) {
    throw Error({bundle.path, "template.touches", std::to_string(masks.size()) + " different masks",
                 "at most " + std::to_string(format::kMaxTouchClasses),
                 "give vertices that touch nearly the same parts the same mask"});
  }
  for (const uint32_t mask : bundle.touches) {
    touch.classes.push_back(static_cast<uint8_t>(std::distance(masks.begin(), masks.find(mask))));
  }
  for (const uint32_t parts : bundle.body_parts) {
    uint32_t bits = 0, bit = 1;
    for (const uint32_t mask : masks) {
      if ((mask & parts) != 0) bits |= bit;
      bit <<= 1;
    }
    touch.touched_by.push_back(static_cast<uint8_t>(bits));
  }
  return touch;
}

// Classes that touch the whole of a face, all bits where there are none.
uint8_t TouchedBy(const Touch& touch, const uint32_t* corners) {
  if (touch.classes.empty()) return 0xFF;
  const auto& bits = touch.touched_by;
  return static_cast<uint8_t>(bits[corners[0]] & bits[corners[1]] & bits[corners[2]]);
}

bool IsNearTemplate(const Bundle& bundle, int32_t vertex) {
  const Eigen::RowVector3f p = bundle.body_positions.row(vertex);
  constexpr auto kSquared = static_cast<float>(kBodyReach * kBodyReach);
  return ((bundle.template_positions.rowwise() - p).rowwise().squaredNorm().array() < kSquared).any();
}

// Corners in the bundle's vertices.
std::vector<uint32_t> CollidingFaces(const Bundle& bundle, const Touch& touch) {
  const std::vector<bool> collides = Colliding(bundle);
  std::vector<int> near(collides.size(), -1);  // not known yet
  std::vector<uint32_t> corners;
  for (Eigen::Index f = 0; f < bundle.body_faces.rows(); ++f) {
    const auto corner = [&](int c) { return static_cast<uint32_t>(bundle.body_faces(f, c)); };
    const uint32_t face[3] = {corner(0), corner(1), corner(2)};
    bool all = TouchedBy(touch, face) != 0, any = false;
    for (int c = 0; c < 3; ++c) all = all && collides[face[c]];
    for (int c = 0; c < 3 && all && !any; ++c) {
      int& known = near[face[c]];
      if (known < 0) known = IsNearTemplate(bundle, bundle.body_faces(f, c)) ? 1 : 0;
      any = known == 1;
    }
    if (!all || !any) continue;
    corners.insert(corners.end(), face, face + 3);
  }
  return corners;
}

// Each kNearestGroup in a row close together.
void OrderByPlace(const Matrix& positions, std::vector<uint32_t>* vertices) {
  if (vertices->size() > format::kMaxBodyVertices) return;  // refused later
  const Matrix own = positions(*vertices, Eigen::all);
  std::vector<uint16_t> order(vertices->size());
  std::iota(order.begin(), order.end(), uint16_t{0});
  kernels::OrderByPlace(own.data(), order.data(), order.size());
  const std::vector<uint32_t> before = *vertices;
  std::transform(order.begin(), order.end(), vertices->begin(), [&](uint16_t i) { return before[i]; });
}

void AddRings(BodySurface* surface) {
  const size_t b = surface->vertices.size();
  surface->row_starts.assign(b + 1, 0);
  for (const uint32_t corner : surface->faces) ++surface->row_starts[corner + 1];
  std::partial_sum(surface->row_starts.begin(), surface->row_starts.end(), surface->row_starts.begin());
  std::vector<uint32_t> next = surface->row_starts;
  surface->columns.resize(surface->faces.size());
  for (size_t c = 0; c < surface->faces.size(); ++c) {
    surface->columns[next[surface->faces[c]]++] = static_cast<uint32_t>(c / 3);
  }
}

// Only bits that a whole face around the vertex has, which is what the format allows.
void AddTouch(const Touch& touch, BodySurface* surface) {
  if (touch.classes.empty()) return;
  surface->touch_classes = touch.classes;
  surface->touched_by.assign(surface->vertices.size(), 0);
  for (size_t f = 0; f < surface->faces.size(); f += 3) {
    const uint32_t* face = &surface->faces[f];
    const uint32_t corners[3] = {surface->vertices[face[0]], surface->vertices[face[1]], surface->vertices[face[2]]};
    for (size_t c = 0; c < 3; ++c) surface->touched_by[face[c]] |= TouchedBy(touch, corners);
  }
}

// Empty where the format holds the surface.
std::string Excess(const BodySurface& surface) {
  const size_t b = surface.vertices.size(), f = surface.faces.size() / 3;
  if (b > format::kMaxBodyVertices || f > format::kMaxBodyFaces) {
    return std::to_string(b) + " colliding vertices and " + std::to_string(f) + " faces";
  }
  for (size_t i = 0; i < b; ++i) {
    const uint32_t around = surface.row_starts[i + 1] - surface.row_starts[i];
    if (around <= format::kMaxBodyRing) continue;
    return std::to_string(around) + " faces around vertex " + std::to_string(surface.vertices[i]);
  }
  return "";
}

}  // namespace

BodySurface MakeBodySurface(const Bundle& bundle, uint32_t influences) {
  BodySurface surface;
  const Touch touch = ReduceMasks(bundle);
  surface.faces = CollidingFaces(bundle, touch);
  if (surface.faces.empty()) return {};
  surface.vertices = surface.faces;
  std::sort(surface.vertices.begin(), surface.vertices.end());
  surface.vertices.erase(std::unique(surface.vertices.begin(), surface.vertices.end()), surface.vertices.end());
  OrderByPlace(bundle.body_positions, &surface.vertices);
  std::vector<uint32_t> place(static_cast<size_t>(bundle.body_positions.rows()));
  for (size_t i = 0; i < surface.vertices.size(); ++i) place[surface.vertices[i]] = static_cast<uint32_t>(i);
  for (uint32_t& corner : surface.faces) corner = place[corner];
  AddRings(&surface);
  AddTouch(touch, &surface);
  if (const std::string excess = Excess(surface); !excess.empty()) {
    if (bundle.body_collides.size() == 0) return {};
    throw Error({bundle.path, "body.collides", excess,
                 "at most 8192 vertices, 16384 faces and 32 faces around a vertex",
                 "mark fewer vertices, or give the body a coarser mesh"});
  }
  MatrixD weights(static_cast<Eigen::Index>(surface.vertices.size()), bundle.body_joint_weights.cols());
  Eigen::RowVectorXd carries = Eigen::RowVectorXd::Ones(weights.cols());
  if (bundle.body_collides.size() == 0) {
    carries.setZero();
    for (const uint32_t bone : bundle.bones) carries[bone] = 1;
  }
  for (Eigen::Index i = 0; i < weights.rows(); ++i) {
    const uint32_t vertex = surface.vertices[static_cast<size_t>(i)];
    weights.row(i) = bundle.body_joint_weights.row(vertex).cast<double>().cwiseProduct(carries);
    weights.row(i) /= weights.row(i).sum();
  }
  surface.skin = Prune(weights, influences);
  return surface;
}

}  // namespace dcloth::converter

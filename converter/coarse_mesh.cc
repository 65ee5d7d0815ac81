#include "converter/coarse_mesh.h"

#include <Eigen/Geometry>  // cross
#include <algorithm>
#include <array>
#include <iterator>
#include <numeric>
#include <queue>
#include <tuple>

namespace dcloth::converter {
namespace {

using Point = Eigen::Vector3d;
using Face = std::array<uint32_t, 3>;

constexpr double kBorderWeight = 10;  // of a plane through a border edge, beside the triangle's own
constexpr double kNearWeight = 1e-3;  // of a vertex's own place: in a plane, short edges merge first
constexpr double kLeastTurn = 0.25;   // cosine between a triangle's normals before and after

// Squared distances to planes and points, summed: x A x + 2 b x + c.
struct Quadric {
  Eigen::Matrix3d a = Eigen::Matrix3d::Zero();
  Point b = Point::Zero();
  double c = 0;

  void AddPlane(const Point& normal, const Point& on, double weight) {
    const double d = -normal.dot(on);
    a += weight * normal * normal.transpose();
    b += weight * d * normal;
    c += weight * d * d;
  }
  void AddPoint(const Point& p, double weight) {
    a += weight * Eigen::Matrix3d::Identity();
    b -= weight * p;
    c += weight * p.squaredNorm();
  }
  void Add(const Quadric& other) {
    a += other.a;
    b += other.b;
    c += other.c;
  }
  double At(const Point& x) const { return x.dot(a * x) + 2 * b.dot(x) + c; }
};

// `from` goes, `to` stays. `age` tells whether the quadrics are still those that `cost` was taken of.
struct Merge {
  double cost;
  uint32_t from, to, age;

  bool operator<(const Merge& other) const {  // the largest comes out of a queue first
    return std::tie(other.cost, other.from, other.to) < std::tie(cost, from, to);
  }
};

class Simplifier {
 public:
  Simplifier(const Matrix& positions, const Faces& faces) : positions_(positions.cast<double>()) {
    const auto n = static_cast<size_t>(positions.rows());
    around_.resize(n);
    quadrics_.resize(n);
    locked_.assign(n, false);
    ages_.assign(n, 0);
    for (Eigen::Index f = 0; f < faces.rows(); ++f) {
      const Face face = {static_cast<uint32_t>(faces(f, 0)), static_cast<uint32_t>(faces(f, 1)),
                         static_cast<uint32_t>(faces(f, 2))};
      faces_.push_back(face);
      for (const uint32_t corner : face) around_[corner].push_back(static_cast<uint32_t>(f));
    }
    LockSharedPlaces();
    for (uint32_t v = 0; v < n; ++v) left_ += around_[v].empty() ? 0 : 1;
    for (size_t f = 0; f < faces_.size(); ++f) AddFace(f);
  }

  void Run(size_t kept) {
    for (uint32_t v = 0; v < around_.size(); ++v) {
      for (const uint32_t neighbour : Neighbours(v)) Offer(v, neighbour);
    }
    while (left_ > kept && !queue_.empty()) {
      const Merge merge = queue_.top();
      queue_.pop();
      if (merge.age != ages_[merge.from] + ages_[merge.to] || !IsSound(merge.from, merge.to)) continue;
      Apply(merge.from, merge.to);
    }
  }

  CoarseMesh Result() const {
    CoarseMesh mesh;
    std::vector<uint32_t> place(around_.size());
    for (uint32_t v = 0; v < around_.size(); ++v) {
      if (around_[v].empty()) continue;
      place[v] = static_cast<uint32_t>(mesh.vertices.size());
      mesh.vertices.push_back(v);
    }
    if (mesh.vertices.size() == around_.size()) return {};
    for (uint32_t f = 0; f < faces_.size(); ++f) {
      const std::vector<uint32_t>& ring = around_[faces_[f][0]];
      if (std::find(ring.begin(), ring.end(), f) == ring.end()) continue;
      for (const uint32_t corner : faces_[f]) mesh.faces.push_back(place[corner]);
    }
    return mesh;
  }

 private:
  Point At(uint32_t v) const { return positions_.row(v).transpose(); }

  static bool Has(const Face& face, uint32_t v) { return face[0] == v || face[1] == v || face[2] == v; }

  // Twice the area long.
  Point NormalOf(const Face& face) const { return (At(face[1]) - At(face[0])).cross(At(face[2]) - At(face[0])); }

  size_t SharedFaces(uint32_t a, uint32_t b) const {
    return static_cast<size_t>(
        std::count_if(around_[a].begin(), around_[a].end(), [&](uint32_t f) { return Has(faces_[f], b); }));
  }

  std::vector<uint32_t> Neighbours(uint32_t v) const {
    std::vector<uint32_t> found;
    for (const uint32_t f : around_[v]) {
      for (const uint32_t corner : faces_[f]) {
        if (corner != v) found.push_back(corner);
      }
    }
    std::sort(found.begin(), found.end());
    found.erase(std::unique(found.begin(), found.end()), found.end());
    return found;
  }

  void LockSharedPlaces() {
    std::vector<uint32_t> order(around_.size());
    std::iota(order.begin(), order.end(), 0u);
    const auto key = [this](uint32_t v) {
      return std::make_tuple(positions_(v, 0), positions_(v, 1), positions_(v, 2));
    };
    std::sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) { return key(a) < key(b); });
    for (size_t i = 1; i < order.size(); ++i) {
      if (key(order[i - 1]) == key(order[i])) locked_[order[i - 1]] = locked_[order[i]] = true;
    }
  }

  void AddFace(size_t f) {
    const Face& face = faces_[f];
    const Point normal = NormalOf(face);
    const double area = 0.5 * normal.norm();
    const Point unit = area > 0 ? Point(normal / (2 * area)) : Point::Zero();
    for (int c = 0; c < 3; ++c) {
      const uint32_t a = face[static_cast<size_t>(c)], b = face[static_cast<size_t>((c + 1) % 3)];
      quadrics_[a].AddPlane(unit, At(a), area);
      quadrics_[a].AddPoint(At(a), kNearWeight * area);
      const size_t shared = SharedFaces(a, b);
      if (shared > 2) locked_[a] = locked_[b] = true;  // not a surface there
      if (shared != 1) continue;
      const Point side = (At(b) - At(a)).cross(unit);
      if (!(side.norm() > 0)) continue;
      for (const uint32_t end : {a, b}) quadrics_[end].AddPlane(side.normalized(), At(a), kBorderWeight * area);
    }
  }

  bool IsBorder(uint32_t v) const {
    const std::vector<uint32_t> neighbours = Neighbours(v);
    return std::any_of(neighbours.begin(), neighbours.end(), [&](uint32_t o) { return SharedFaces(v, o) == 1; });
  }

  void Offer(uint32_t from, uint32_t to) {
    if (locked_[from]) return;
    Quadric sum = quadrics_[from];
    sum.Add(quadrics_[to]);
    queue_.push({sum.At(At(to)), from, to, ages_[from] + ages_[to]});
  }

  bool IsSound(uint32_t from, uint32_t to) const {
    const size_t shared = SharedFaces(from, to);
    if (shared == 0) return false;
    if (IsBorder(from) && shared != 1) return false;  // along the border alone
    // The link condition: nobody else neighbours both, or two sheets would meet in an edge.
    const std::vector<uint32_t> a = Neighbours(from), b = Neighbours(to);
    std::vector<uint32_t> both;
    std::set_intersection(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(both));
    if (both.size() != shared) return false;
    if (around_[from].size() <= shared && around_[to].size() <= shared) return false;  // the last of a piece
    for (const uint32_t f : around_[from]) {
      if (Has(faces_[f], to)) continue;
      Face moved = faces_[f];
      std::replace(moved.begin(), moved.end(), from, to);
      const Point before = NormalOf(faces_[f]), after = NormalOf(moved);
      if (!(before.dot(after) > kLeastTurn * before.norm() * after.norm())) return false;
    }
    return true;
  }

  void Apply(uint32_t from, uint32_t to) {
    for (const uint32_t f : around_[from]) {
      if (Has(faces_[f], to)) {
        for (const uint32_t corner : faces_[f]) {
          if (corner == from) continue;
          std::vector<uint32_t>& ring = around_[corner];
          ring.erase(std::find(ring.begin(), ring.end(), f));
        }
      } else {
        std::replace(faces_[f].begin(), faces_[f].end(), from, to);
        around_[to].push_back(f);
      }
    }
    around_[from].clear();
    quadrics_[to].Add(quadrics_[from]);
    --left_;
    ++ages_[to];
    for (const uint32_t neighbour : Neighbours(to)) {
      Offer(to, neighbour);
      Offer(neighbour, to);
    }
  }

  MatrixD positions_;
  std::vector<Face> faces_;
  std::vector<std::vector<uint32_t>> around_;  // faces of each vertex; none where it has gone
  std::vector<Quadric> quadrics_;
  std::vector<bool> locked_;
  std::vector<uint32_t> ages_;  // how often another vertex has merged into each
  std::priority_queue<Merge> queue_;
  size_t left_ = 0;
};

}  // namespace

CoarseMesh MakeCoarseMesh(const Matrix& positions, const Faces& faces, size_t kept) {
  Simplifier simplifier(positions, faces);
  simplifier.Run(kept);
  return simplifier.Result();
}

}  // namespace dcloth::converter

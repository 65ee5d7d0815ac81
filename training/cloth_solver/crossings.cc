#include "crossings.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

namespace {

__extension__ typedef __int128 Wide;

constexpr double kCells = 1 << 26;  // a metre
constexpr double kLargest = 16;     // m from the origin: differences of coordinates then stay below 2^31
constexpr int32_t kLeaf = 4;        // triangles

using Point = std::array<int32_t, 3>;

struct Box {
  Point low, high;
};

bool Overlap(const Box& a, const Box& b) {
  return (a.low[0] <= b.high[0]) & (b.low[0] <= a.high[0]) & (a.low[1] <= b.high[1]) & (b.low[1] <= a.high[1]) &
         (a.low[2] <= b.high[2]) & (b.low[2] <= a.high[2]);
}

Box Join(const Box& a, const Box& b) {
  Box out;
  for (int k = 0; k < 3; ++k) out.low[k] = std::min(a.low[k], b.low[k]), out.high[k] = std::max(a.high[k], b.high[k]);
  return out;
}

struct Triangle {
  Point corner[3];
  int32_t vertex[3];  // index of the place, the same for all vertices that lie there
  int32_t number;
  Box box;
};

template <typename T>
int Sign(T value) {
  return (value > 0) - (value < 0);
}

// The side of the plane through a, b, c on which d lies; 0: in it.
int Side(const Point& a, const Point& b, const Point& c, const Point& d) {
  int64_t u[3], v[3], w[3];
  for (int k = 0; k < 3; ++k) {
    u[k] = int64_t{a[k]} - d[k], v[k] = int64_t{b[k]} - d[k], w[k] = int64_t{c[k]} - d[k];
  }
  // In double first. Differences are exact; the bound is that of Shewchuk, "Adaptive precision floating-point
  // arithmetic and fast robust geometric predicates", 1997, for orient3d without rounded differences, generously.
  constexpr double kBound = 1e-15;
  double determinant = 0, permanent = 0;
  for (int k = 0; k < 3; ++k) {
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    const double p = static_cast<double>(v[i]) * static_cast<double>(w[j]);
    const double q = static_cast<double>(v[j]) * static_cast<double>(w[i]);
    determinant += static_cast<double>(u[k]) * (p - q);
    permanent += std::abs(static_cast<double>(u[k])) * (std::abs(p) + std::abs(q));
  }
  if (std::abs(determinant) > kBound * permanent) return Sign(determinant);
  Wide exact = 0;  // below 2^31 each: a product of three is below 2^93
  for (int k = 0; k < 3; ++k) {
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    exact += Wide{u[k]} * (Wide{v[i]} * w[j] - Wide{v[j]} * w[i]);
  }
  return Sign(exact);
}

// The same in a plane of two axes.
int Turn(const Point& a, const Point& b, const Point& c, int i, int j) {
  return Sign(Wide{int64_t{b[i]} - a[i]} * (int64_t{c[j]} - a[j]) -
              Wide{int64_t{b[j]} - a[j]} * (int64_t{c[i]} - a[i]));
}

// Axes of the projection in which a triangle keeps its area; false: it has none.
bool Projection(const Triangle& t, int* i, int* j) {
  for (int k = 0; k < 3; ++k) {
    *i = (k + 1) % 3, *j = (k + 2) % 3;
    if (Turn(t.corner[0], t.corner[1], t.corner[2], *i, *j) != 0) return true;
  }
  return false;
}

bool Within(const Point& p, const Triangle& t, int i, int j) {
  const int a = Turn(t.corner[0], t.corner[1], p, i, j), b = Turn(t.corner[1], t.corner[2], p, i, j);
  const int c = Turn(t.corner[2], t.corner[0], p, i, j);
  return (a >= 0 && b >= 0 && c >= 0) || (a <= 0 && b <= 0 && c <= 0);
}

// A segment against a triangle that has area, both in one plane.
bool SegmentInPlane(const Point& p, const Point& q, const Triangle& t) {
  int i, j;
  if (!Projection(t, &i, &j)) return false;
  if (Within(p, t, i, j) || Within(q, t, i, j)) return true;
  // With both ends outside, the segment meets the triangle where it meets two sides; by the signs it meets none that is
  // parallel to it and apart, and one collinear with it has an end within the segment, which meets another side.
  for (int k = 0; k < 3; ++k) {
    const Point &a = t.corner[k], &b = t.corner[(k + 1) % 3];
    const int pa = Turn(a, b, p, i, j), qa = Turn(a, b, q, i, j), ap = Turn(p, q, a, i, j), bp = Turn(p, q, b, i, j);
    if (pa == 0 && qa == 0) continue;
    if (pa * qa <= 0 && ap * bp <= 0) return true;
  }
  return false;
}

// p and q lie on sides sp and sq of t's plane.
bool SegmentMeets(const Point& p, const Point& q, int sp, int sq, const Triangle& t) {
  if (sp * sq > 0) return false;
  if (sp == 0 && sq == 0) return SegmentInPlane(p, q, t);
  const int a = Side(p, q, t.corner[0], t.corner[1]), b = Side(p, q, t.corner[1], t.corner[2]);
  if (a * b < 0) return false;
  const int c = Side(p, q, t.corner[2], t.corner[0]);
  return a * c >= 0 && b * c >= 0;
}

bool Apart(const int (&side)[3]) { return side[0] * side[1] > 0 && side[1] * side[2] > 0; }

bool Meet(const Triangle& a, const Triangle& b) {
  int of_b[3], of_a[3];
  for (int k = 0; k < 3; ++k) of_b[k] = Side(a.corner[0], a.corner[1], a.corner[2], b.corner[k]);
  if (Apart(of_b)) return false;
  for (int k = 0; k < 3; ++k) of_a[k] = Side(b.corner[0], b.corner[1], b.corner[2], a.corner[k]);
  if (Apart(of_a)) return false;
  for (int k = 0; k < 3; ++k) {
    const int n = (k + 1) % 3;
    if (SegmentMeets(a.corner[k], a.corner[n], of_a[k], of_a[n], b)) return true;
    if (SegmentMeets(b.corner[k], b.corner[n], of_b[k], of_b[n], a)) return true;
  }
  return false;
}

bool ShareVertex(const Triangle& a, const Triangle& b) {
  for (const int32_t v : a.vertex)
    if (v == b.vertex[0] || v == b.vertex[1] || v == b.vertex[2]) return true;
  return false;
}

// A balanced tree of boxes over the triangles, which it sorts. Node k has children 2k+1 and 2k+2; first[k] to last[k]
// are its triangles.
class Tree {
 public:
  explicit Tree(std::vector<Triangle> triangles) : triangles_(std::move(triangles)) {
    if (!triangles_.empty()) Build(0, 0, static_cast<int32_t>(triangles_.size()));
  }

  bool empty() const { return triangles_.empty(); }

  template <typename Found>
  void Self(int32_t node, Found found) const {
    if (IsLeaf(node)) {
      for (int32_t i = nodes_[node].first; i < nodes_[node].last; ++i)
        for (int32_t j = i + 1; j < nodes_[node].last; ++j) Pair(triangles_[i], triangles_[j], found);
      return;
    }
    Self(2 * node + 1, found);
    Self(2 * node + 2, found);
    Cross(2 * node + 1, *this, 2 * node + 2, found);
  }

  template <typename Found>
  void Cross(int32_t node, const Tree& other, int32_t theirs, Found found) const {
    const Node &a = nodes_[node], &b = other.nodes_[theirs];
    if (!Overlap(a.box, b.box)) return;
    const bool leaf = IsLeaf(node), their_leaf = other.IsLeaf(theirs);
    if (leaf && their_leaf) {
      for (int32_t i = a.first; i < a.last; ++i) {
        if (!Overlap(triangles_[i].box, b.box)) continue;
        for (int32_t j = b.first; j < b.last; ++j) Pair(triangles_[i], other.triangles_[j], found);
      }
    } else if (their_leaf || (!leaf && a.last - a.first >= b.last - b.first)) {
      Cross(2 * node + 1, other, theirs, found);
      Cross(2 * node + 2, other, theirs, found);
    } else {
      Cross(node, other, 2 * theirs + 1, found);
      Cross(node, other, 2 * theirs + 2, found);
    }
  }

 private:
  struct Node {
    Box box;
    int32_t first, last;
  };

  template <typename Found>
  static void Pair(const Triangle& a, const Triangle& b, Found found) {
    if (Overlap(a.box, b.box)) found(a, b);
  }

  bool IsLeaf(int32_t node) const { return nodes_[node].last - nodes_[node].first <= kLeaf; }

  void Build(int32_t node, int32_t first, int32_t last) {
    if (static_cast<size_t>(node) >= nodes_.size()) nodes_.resize(2 * node + 1);
    Box box = triangles_[first].box;
    for (int32_t i = first + 1; i < last; ++i) box = Join(box, triangles_[i].box);
    nodes_[node] = {box, first, last};
    if (last - first <= kLeaf) return;
    int axis = 0;
    for (int k = 1; k < 3; ++k)
      if (int64_t{box.high[k]} - box.low[k] > int64_t{box.high[axis]} - box.low[axis]) axis = k;
    const int32_t middle = first + (last - first) / 2;
    std::nth_element(triangles_.begin() + first, triangles_.begin() + middle, triangles_.begin() + last,
                     [axis](const Triangle& a, const Triangle& b) {
                       return int64_t{a.box.low[axis]} + a.box.high[axis] < int64_t{b.box.low[axis]} + b.box.high[axis];
                     });
    Build(2 * node + 1, first, middle);
    Build(2 * node + 2, middle, last);
  }

  std::vector<Triangle> triangles_;
  std::vector<Node> nodes_;
};

// The points on the grid; false: not finite, or too far from `origin`.
bool Snap(const double* vertex, int32_t vertices, const double* origin, std::vector<Point>* out) {
  out->resize(static_cast<size_t>(vertices));
  for (int32_t i = 0; i < vertices; ++i) {
    for (int k = 0; k < 3; ++k) {
      const double away = vertex[3 * i + k] - origin[k];
      if (!(std::abs(away) < kLargest)) return false;
      (*out)[i][k] = static_cast<int32_t>(std::lround(away * kCells));
    }
  }
  return true;
}

// For each point the first one in sorted order at the same place.
std::vector<int32_t> Places(const std::vector<Point>& points) {
  std::vector<int32_t> order(points.size()), place(points.size());
  for (size_t i = 0; i < order.size(); ++i) order[i] = static_cast<int32_t>(i);
  std::sort(order.begin(), order.end(), [&](int32_t a, int32_t b) { return points[a] < points[b]; });
  for (size_t i = 0; i < order.size(); ++i) {
    const bool same = i > 0 && points[order[i]] == points[order[i - 1]];
    place[order[i]] = same ? place[order[i - 1]] : order[i];
  }
  return place;
}

// places: as Places() returns them, or empty where nobody asks for shared vertices.
bool Triangles(const std::vector<Point>& points, const std::vector<int32_t>& places, const int32_t* face, int32_t faces,
               std::vector<Triangle>* out) {
  out->resize(static_cast<size_t>(faces));
  for (int32_t f = 0; f < faces; ++f) {
    Triangle& t = (*out)[f];
    t.number = f;
    for (int k = 0; k < 3; ++k) {
      const int32_t v = face[3 * f + k];
      if (v < 0 || static_cast<size_t>(v) >= points.size()) return false;
      t.corner[k] = points[v], t.vertex[k] = places.empty() ? v : places[v];
    }
    t.box = {t.corner[0], t.corner[0]};
    for (int k = 1; k < 3; ++k) t.box = Join(t.box, {t.corner[k], t.corner[k]});
  }
  return true;
}

}  // namespace

extern "C" int64_t cloth_crossings(const double* vertex, int32_t vertices, const int32_t* face, int32_t faces,
                                   const double* other, int32_t other_vertices, const int32_t* other_face,
                                   int32_t other_faces, int32_t* pair, int64_t capacity) {
  if (vertices <= 0 || faces <= 0) return 0;
  // The middle of the mesh, on the grid, so that a float that lies on the grid stays where it is.
  double origin[3];
  for (int k = 0; k < 3; ++k) {
    double low = vertex[k], high = vertex[k];
    for (int32_t i = 1; i < vertices; ++i) {
      low = std::min(low, vertex[3 * i + k]), high = std::max(high, vertex[3 * i + k]);
    }
    origin[k] = std::round((low + high) / 2 * kCells) / kCells;
  }
  std::vector<Point> points;
  std::vector<Triangle> triangles;
  if (!Snap(vertex, vertices, origin, &points)) return -1;
  const std::vector<int32_t> places = other == nullptr ? Places(points) : std::vector<int32_t>();
  if (!Triangles(points, places, face, faces, &triangles)) return -1;
  const Tree tree(std::move(triangles));
  std::vector<std::pair<int32_t, int32_t>> found;
  if (other == nullptr) {
    tree.Self(0, [&](const Triangle& a, const Triangle& b) {
      if (!ShareVertex(a, b) && Meet(a, b))
        found.emplace_back(std::min(a.number, b.number), std::max(a.number, b.number));
    });
  } else {
    std::vector<Triangle> theirs;
    if (!Snap(other, other_vertices, origin, &points)) return -1;
    if (!Triangles(points, {}, other_face, other_faces, &theirs)) return -1;
    const Tree other_tree(std::move(theirs));
    if (!other_tree.empty()) {
      tree.Cross(0, other_tree, 0, [&](const Triangle& a, const Triangle& b) {
        if (Meet(a, b)) found.emplace_back(a.number, b.number);
      });
    }
  }
  std::sort(found.begin(), found.end());
  const int64_t written = std::min<int64_t>(capacity, static_cast<int64_t>(found.size()));
  for (int64_t k = 0; k < written; ++k) pair[2 * k] = found[k].first, pair[2 * k + 1] = found[k].second;
  return static_cast<int64_t>(found.size());
}

#include "engine/src/body/body_search.h"

#include <cmath>

#include "engine/src/body/vec.h"

namespace dcloth::engine {
namespace {

constexpr uint32_t kMaxSteps = 8;
constexpr double kSame = 1e-9;  // of squared distances to one point over two faces, which round apart
constexpr double kClearlyFurther = 1e-6;
constexpr size_t kMostSeen = 1 + 3 * kMaxSteps;  // vertices that a walk looks around
constexpr size_t kBlock = 16;        // groups whose boxes are looked at together; their rows are padded to it
constexpr float kRounding = 1e-6f;   // of coordinates: more than floats round what is between them by
constexpr float kMore = 1 + 1e-5f;   // more than what floats round a squared distance by
constexpr float kLeast = 1e-30f;     // a squared distance that floats still tell from zero
constexpr double kTouching = 1e-14;  // of a face's area: a squared distance below it gives no direction

constexpr uint8_t kA = 1, kB = 2, kC = 4;

struct OnTriangle {
  Vec point;
  uint8_t corners;  // that it lies between
};

// By the Voronoi region of the triangle that p lies in (Ericson, Real-Time Collision Detection, 5.1.5).
OnTriangle ClosestOnTriangle(Vec p, Vec a, Vec b, Vec c) {
  const Vec ab = b - a, ac = c - a;
  const double d1 = Dot(ab, p - a), d2 = Dot(ac, p - a);
  if (d1 <= 0 && d2 <= 0) return {a, kA};
  const double d3 = Dot(ab, p - b), d4 = Dot(ac, p - b);
  if (d3 >= 0 && d4 <= d3) return {b, kB};
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return {a + (d1 / (d1 - d3)) * ab, kA | kB};
  const double d5 = Dot(ab, p - c), d6 = Dot(ac, p - c);
  if (d6 >= 0 && d5 <= d6) return {c, kC};
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return {a + (d2 / (d2 - d6)) * ac, kA | kC};
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
    return {b + ((d4 - d3) / ((d4 - d3) + (d5 - d6))) * (c - b), kB | kC};
  }
  const double sum = va + vb + vc;
  return {a + (vb / sum) * ab + (vc / sum) * ac, kA | kB | kC};
}

bool Counts(const PosedBody& posed, const uint16_t* face) {
  if (posed.touch_bit == 0) return true;
  const uint8_t* touched = posed.body->touched_by;
  return (touched[face[0]] & touched[face[1]] & touched[face[2]] & posed.touch_bit) != 0;
}

bool Has(const uint16_t* face, uint32_t vertex) { return face[0] == vertex || face[1] == vertex || face[2] == vertex; }

// Whether one face alone counts at the edge.
bool IsRim(const PosedBody& posed, uint32_t vertex, uint32_t other) {
  const format::BodyView& body = *posed.body;
  size_t count = 0;
  for (uint32_t i = body.row_starts[vertex]; i < body.row_starts[vertex + 1]; ++i) {
    const uint16_t* face = body.faces + size_t{3} * body.columns[i];
    count += Has(face, other) && Counts(posed, face) ? 1 : 0;
  }
  return count < 2;
}

bool IsOnRim(const PosedBody& posed, uint32_t vertex) {
  const format::BodyView& body = *posed.body;
  for (uint32_t i = body.row_starts[vertex]; i < body.row_starts[vertex + 1]; ++i) {
    const uint16_t* face = body.faces + size_t{3} * body.columns[i];
    if (!Counts(posed, face)) continue;
    for (size_t c = 0; c < 3; ++c) {
      if (face[c] != vertex && IsRim(posed, vertex, face[c])) return true;
    }
  }
  return false;
}

// The larger one.
float OrZero(float value) { return 0.5f * (value + std::fabs(value)); }

class Walk {
 public:
  Walk(const PosedBody& posed, Vec point) : posed_(posed), point_(point) {}

  void From(uint32_t start) {
    LookAround(start);
    for (uint32_t step = 0; step < kMaxSteps && found_; ++step) {
      const uint16_t* corners = posed_.body->faces + size_t{3} * face_;
      bool nearer = false;
      for (size_t c = 0; c < 3; ++c) nearer |= LookAround(corners[c]);
      if (!nearer) break;
    }
  }

  // A corner of a face is at most that face's distance and the corner's slack away (body_sites.cc).
  void Everywhere(const kernels::NearestJob& job, const TouchLists& lists) {
    const size_t stride = kernels::NearestBoundStride(job.groups);
    for (size_t block = 0; block < job.groups; block += kBlock) {
      if (found_ && !BlockMayHoldNearer(job.bounds + block, stride)) continue;
      const size_t end = block + kBlock < job.groups ? block + kBlock : job.groups;
      LookAroundGroups(job, lists, block, end);
    }
  }

  bool HasSeen(uint32_t vertex) const {
    for (size_t i = 0; i < seen_count_; ++i) {
      if (seen_[i] == vertex) return true;
    }
    return false;
  }

  ClosestPoint Result() const {
    ClosestPoint result = {};
    result.faces_seen = faces_seen_;
    result.found = found_;
    if (!found_) return result;
    const double distance = std::sqrt(squared_), side = square_on_ < 0 ? -1 : 1;
    const bool touching = squared_ <= kTouching * extent_;
    const Vec direction = touching ? normal_ : (side / distance) * away_;
    const Vec point = closest_;
    result = {{point.x, point.y, point.z},
              {direction.x, direction.y, direction.z},
              side * distance,
              face_,
              faces_seen_,
              corners_,
              true};
    return result;
  }

 private:
  void LookAroundGroups(const kernels::NearestJob& job, const TouchLists& lists, size_t begin, size_t end) {
    constexpr size_t kSites = kernels::kNearestGroup;
    const size_t stride = kernels::NearestBoundStride(job.groups);
    for (size_t g = begin; g < end; ++g) {
      const float* bounds = job.bounds + g;
      if (!MayHoldNearer(Beyond(bounds, stride), bounds[kernels::kSlack * stride])) continue;
      const size_t place = kernels::GroupPlace(job, g);
      const float* site = job.sites + place * kernels::kNearestSiteFloats * kSites;
      for (size_t k = 0; k < kSites; ++k, ++site) {
        const Vec at = {static_cast<double>(site[0]), static_cast<double>(site[kSites]),
                        static_cast<double>(site[2 * kSites])};
        const Vec apart = point_ - at;
        if (!MayHoldNearer(Dot(apart, apart), site[(kernels::kNearestSiteFloats - 1) * kSites])) continue;
        LookAround(static_cast<uint32_t>(BodyVertexAt(*posed_.body, lists, place * kSites + k)));
      }
    }
  }

  // Squared, all of them; slacks are rounded to floats.
  bool MayHoldNearer(double distance, float slack) const {
    return !found_ || distance <= squared_ + (1 + kClearlyFurther) * static_cast<double>(slack);
  }

  // MayHoldNearer of any of kBlock groups, or a little more: floats, of boxes a little larger. Without a comparison, so
  // that compilers compute groups side by side.
  bool BlockMayHoldNearer(const float* bounds, size_t stride) const {
    const float p[3] = {static_cast<float>(point_.x), static_cast<float>(point_.y), static_cast<float>(point_.z)};
    const float most = static_cast<float>(squared_) * kMore + kLeast, *slack = bounds + kernels::kSlack * stride;
    float nearer[kBlock];
    for (size_t i = 0; i < kBlock; ++i) nearer[i] = most + kMore * slack[i];
    for (size_t c = 0; c < 3; ++c) {
      const float* low = bounds + (kernels::kLow + c) * stride;
      const float* high = bounds + (kernels::kHigh + c) * stride;
      const float at = p[c];
      for (size_t i = 0; i < kBlock; ++i) {
        const float margin = kRounding * (std::fabs(at) + std::fabs(low[i]) + std::fabs(high[i]));
        const float gap = OrZero(std::fabs(at - 0.5f * (low[i] + high[i])) - 0.5f * (high[i] - low[i]) - margin);
        nearer[i] -= gap * gap;
      }
    }
    for (float& by : nearer) by = OrZero(by);
    for (size_t half = kBlock / 2; half > 0; half /= 2) {
      for (size_t i = 0; i < half; ++i) nearer[i] += nearer[i + half];
    }
    return !(nearer[0] <= 0);  // what is not a number may
  }

  // How far the point is from a group's box, squared.
  double Beyond(const float* bounds, size_t stride) const {
    const double p[3] = {point_.x, point_.y, point_.z};
    double squared = 0;
    for (size_t c = 0; c < 3; ++c) {
      const double below = static_cast<double>(bounds[(kernels::kLow + c) * stride]) - p[c];
      const double above = p[c] - static_cast<double>(bounds[(kernels::kHigh + c) * stride]);
      const double gap = below > above ? below : above;
      squared += gap > 0 ? gap * gap : 0;
    }
    return squared;
  }

  // True where a face around `vertex` is nearer than all before. A vertex that was looked around has nothing new.
  bool LookAround(uint32_t vertex) {
    if (HasSeen(vertex)) return false;
    if (seen_count_ < kMostSeen) seen_[seen_count_++] = vertex;
    const format::BodyView& body = *posed_.body;
    const uint32_t begin = body.row_starts[vertex], end = body.row_starts[vertex + 1];
    faces_seen_ += end - begin;
    bool nearer = false;
    for (uint32_t i = begin; i < end; ++i) nearer |= LookAt(body.columns[i]);
    return nearer;
  }

  Vec Corner(uint32_t vertex) const { return VecAt(posed_.positions + size_t{3} * vertex); }

  // Where the best face is seen squarely, a face beyond its plane holds nothing nearer, nor is it seen more squarely:
  // all faces around, where the body is convex.
  bool LiesBeyond(Vec a, Vec b, Vec c) const {
    const double reached = squared_ * (1 - kSame);
    return square_on_ * square_on_ >= reached && Dot(away_, point_ - a) >= reached &&
           Dot(away_, point_ - b) >= reached && Dot(away_, point_ - c) >= reached;
  }

  bool LookAt(uint32_t face) {
    const uint16_t* const corners = posed_.body->faces + size_t{3} * face;
    if (!Counts(posed_, corners)) return false;
    const Vec a = Corner(corners[0]), b = Corner(corners[1]), c = Corner(corners[2]);
    if (found_ && LiesBeyond(a, b, c)) return false;
    const Vec area = Cross(b - a, c - a);
    const double square = Dot(area, area);
    if (!(square > 0)) return false;
    // The face's plane alone is further than what was found.
    const double height = Dot(area, point_ - a);
    if (found_ && height * height > squared_ * square * (1 + kClearlyFurther)) return false;
    const OnTriangle closest = ClosestOnTriangle(point_, a, b, c);
    const Vec away = point_ - closest.point;
    const double squared = Dot(away, away);
    if (found_ && squared > squared_ * (1 + kSame)) return false;
    const Vec normal = (posed_.outward / std::sqrt(square)) * area;
    const double square_on = Dot(normal, away);
    const bool nearer = !found_ ? squared == squared : squared < squared_ * (1 - kSame);
    const bool shared = found_ && squared <= squared_ * (1 + kSame) && std::fabs(square_on) > std::fabs(square_on_);
    if (!nearer && !shared) return false;
    found_ = true;
    squared_ = squared;
    square_on_ = square_on;
    closest_ = closest.point;
    corners_ = closest.corners;
    away_ = away;
    normal_ = normal;
    extent_ = std::sqrt(square);
    face_ = face;
    return nearer;
  }

  const PosedBody& posed_;
  Vec point_, closest_ = {}, away_ = {}, normal_ = {};
  double squared_ = 0, square_on_ = 0, extent_ = 0;
  uint32_t face_ = 0, faces_seen_ = 0;
  uint8_t corners_ = 0;
  bool found_ = false;
  size_t seen_count_ = 0;
  uint32_t seen_[kMostSeen];
};

}  // namespace

ClosestPoint SearchBody(const PosedBody& posed, uint32_t first, uint32_t second, const double point[3]) {
  const Vec from = {point[0], point[1], point[2]};
  Walk walk(posed, from);
  walk.From(first);
  const ClosestPoint closest = walk.Result();
  if (walk.HasSeen(second)) return closest;
  Walk other(posed, from);
  other.From(second);
  const ClosestPoint found = other.Result();
  const bool nearer = found.found && (!closest.found || std::fabs(found.distance) < std::fabs(closest.distance));
  ClosestPoint result = nearer ? found : closest;
  result.faces_seen = closest.faces_seen + found.faces_seen;
  return result;
}

ClosestPoint SearchWholeBody(const PosedBody& posed, const kernels::NearestJob& job, const TouchLists& lists,
                             uint32_t start, const double point[3]) {
  Walk walk(posed, {point[0], point[1], point[2]});
  walk.From(start);
  walk.Everywhere(job, lists);
  return walk.Result();
}

bool EndsAt(const PosedBody& posed, const ClosestPoint& closest) {
  if (posed.touch_bit == 0 || closest.corners == (kA | kB | kC)) return false;
  const uint16_t* face = posed.body->faces + size_t{3} * closest.face;
  const uint32_t a = face[0], b = face[1], c = face[2];
  switch (closest.corners) {
    case kA:
      return IsOnRim(posed, a);
    case kB:
      return IsOnRim(posed, b);
    case kC:
      return IsOnRim(posed, c);
    case kA | kB:
      return IsRim(posed, a, b);
    case kA | kC:
      return IsRim(posed, a, c);
    default:
      return IsRim(posed, b, c);
  }
}

}  // namespace dcloth::engine

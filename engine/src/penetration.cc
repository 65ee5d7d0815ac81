#include "engine/src/penetration.h"

#include <cmath>
#include <cstdint>

#include "engine/src/body_search.h"

namespace dcloth::engine {
namespace {

using format::BodyView;
using kernels::kNearestGroup;
using kernels::kNearestSiteFloats;

// A push may lead under another part of the body: in a fold, between two legs.
constexpr int kMaxPushes = 4;
constexpr double kPushedFar = 0.99;    // of the clearance: rounded to floats, a vertex that was pushed stays put
constexpr float kNoGroup = 1e18f;      // where groups lie that only fill a row up
constexpr float kRounding = 1.00001f;  // of a bound
constexpr float kFar = 1e18f;          // squared
constexpr float kThird = 0.33334f;

size_t Groups(const BodyView& body) { return (body.vertex_count + kNearestGroup - 1) / kNearestGroup; }

void PoseBody(const kernels::KernelTable& kernels, const format::ModelView& model, const Space& space,
              const BoundPose& bound, const BodyMemory& memory) {
  const BodyView& body = model.body;
  for (size_t j = 0; j < model.joint_count; ++j) StoreFloats(ToHost(space, bound.joints[j]), memory.matrices + 12 * j);
  kernels::SkinningJob skinning = {};
  skinning.matrices = memory.matrices;
  skinning.positions = body.positions;
  skinning.bones = body.joints;
  skinning.weights = body.weights;
  skinning.out = memory.positions;
  skinning.out_stride_bytes = 3 * sizeof(float);
  skinning.vertices = body.vertex_count;
  skinning.influences = body.influences;
  kernels.skinning(skinning);
  kernels::NormalsJob normals = {};
  normals.positions = memory.positions;
  normals.position_stride_bytes = normals.normal_stride_bytes = 3 * sizeof(float);
  normals.triangles = body.faces;
  normals.normals = memory.normals;
  normals.vertices = body.vertex_count;
  normals.triangle_count = body.face_count;
  kernels.normals(normals);
  if (!space.mirrored) return;
  for (size_t i = 0; i < size_t{3} * body.vertex_count; ++i) memory.normals[i] = -memory.normals[i];
}

// Planes over the faces around each vertex, and its slack: the squared distance of a point to the nearest corner of its
// closest face is at most that to the surface and slack^2, as every point of a triangle is within longest edge /
// sqrt(3) of a corner. Rejected: one slack for the whole body, its longest edge's, which makes most of the waist
// suspect.
void PlaceFaces(const BodyView& body, float clearance, const BodyMemory& memory) {
  for (size_t i = 0; i < body.vertex_count; ++i) {
    memory.offsets[i] = -3e38f;
    memory.slacks[i] = 0;
  }
  for (size_t f = 0; f < body.face_count; ++f) {
    const uint16_t* face = body.faces + 3 * f;
    const float* p[3] = {memory.positions + size_t{3} * face[0], memory.positions + size_t{3} * face[1],
                         memory.positions + size_t{3} * face[2]};
    float longest = 0;
    for (size_t c = 0; c < 3; ++c) {
      const float* n = memory.normals + size_t{3} * face[c];
      float highest = memory.offsets[face[c]];
      for (const float* corner : p) {
        const float height = n[0] * corner[0] + n[1] * corner[1] + n[2] * corner[2];
        highest = height > highest ? height : highest;
      }
      memory.offsets[face[c]] = highest;
      const float* q = p[c == 2 ? 0 : c + 1];
      const float edge[3] = {q[0] - p[c][0], q[1] - p[c][1], q[2] - p[c][2]};
      const float squared = edge[0] * edge[0] + edge[1] * edge[1] + edge[2] * edge[2];
      longest = squared > longest ? squared : longest;
    }
    const float slack = longest < kFar ? kThird * longest : kFar;
    for (size_t c = 0; c < 3; ++c) {
      float& widest = memory.slacks[face[c]];
      widest = slack > widest ? slack : widest;
    }
  }
  for (size_t i = 0; i < body.vertex_count; ++i) memory.offsets[i] += clearance;
}

// The sphere of a group whose sites are in place, and its slack.
void PlaceBounds(const float* site, float* bounds, size_t stride) {
  const auto at = [&](size_t row, size_t k) { return site[row * kNearestGroup + k]; };
  float centre[3], furthest = 0, slack = 0;
  for (size_t c = 0; c < 3; ++c) {
    float low = at(c, 0), high = low;
    for (size_t k = 0; k < kNearestGroup; ++k) {
      low = at(c, k) < low ? at(c, k) : low;
      high = at(c, k) > high ? at(c, k) : high;
    }
    centre[c] = 0.5f * low + 0.5f * high;
    bounds[(kernels::kCentre + c) * stride] = centre[c];
  }
  for (size_t k = 0; k < kNearestGroup; ++k) {
    float apart = 0;
    for (size_t c = 0; c < 3; ++c) {
      const float d = at(c, k) - centre[c];
      apart += d * d;
    }
    furthest = apart > furthest ? apart : furthest;
    slack = at(7, k) > slack ? at(7, k) : slack;
  }
  bounds[kernels::kRadius * stride] = static_cast<float>(std::sqrt(static_cast<double>(furthest))) * kRounding;
  bounds[kernels::kSlack * stride] = static_cast<float>(std::sqrt(static_cast<double>(slack))) * kRounding;
}

void PlaceSites(const BodyView& body, const BodyMemory& memory) {
  const size_t groups = Groups(body), stride = kernels::NearestBoundStride(groups), b = body.vertex_count;
  for (size_t g = 0; g < groups; ++g) {
    float* site = memory.sites + g * kNearestSiteFloats * kNearestGroup;
    for (size_t k = 0; k < kNearestGroup; ++k) {
      const size_t i = g * kNearestGroup + k < b ? g * kNearestGroup + k : b - 1;
      for (size_t c = 0; c < 3; ++c) {
        site[c * kNearestGroup + k] = memory.positions[3 * i + c];
        site[(3 + c) * kNearestGroup + k] = memory.normals[3 * i + c];
      }
      site[6 * kNearestGroup + k] = memory.offsets[i];
      site[7 * kNearestGroup + k] = memory.slacks[i];
    }
    PlaceBounds(site, memory.bounds + g, stride);
  }
  for (size_t g = groups; g < stride; ++g) {
    for (size_t row = 0; row < kernels::kNearestBounds; ++row) memory.bounds[row * stride + g] = 0;
    memory.bounds[g] = kNoGroup;
  }
}

// The nearer of the walks from both vertices.
ClosestPoint Closest(const PosedBody& posed, uint16_t nearest, uint16_t suspect, const double v[3]) {
  ClosestPoint closest = SearchBody(posed, suspect, v);
  if (nearest == suspect) return closest;
  const ClosestPoint other = SearchBody(posed, nearest, v);
  const bool nearer = other.found && (!closest.found || std::fabs(other.distance) < std::fabs(closest.distance));
  return nearer ? other : closest;
}

void PushOut(const PosedBody& posed, uint16_t nearest, uint16_t suspect, double clearance, float* position) {
  double v[3] = {static_cast<double>(position[0]), static_cast<double>(position[1]), static_cast<double>(position[2])};
  bool moved = false;
  for (int push = 0; push < kMaxPushes; ++push) {
    const ClosestPoint closest = Closest(posed, nearest, suspect, v);
    if (!closest.found || closest.distance >= kPushedFar * clearance) break;
    for (size_t c = 0; c < 3; ++c) v[c] = closest.point[c] + clearance * closest.direction[c];
    moved = true;
  }
  if (!moved) return;
  for (size_t c = 0; c < 3; ++c) position[c] = static_cast<float>(v[c]);
}

}  // namespace

BodyMemory PlaceBodyMemory(const format::ModelView& model, Arena* arena) {
  const size_t b = model.body.vertex_count, groups = Groups(model.body);
  BodyMemory memory = {};
  if (b == 0) return memory;
  memory.matrices = arena->Take<float>(size_t{12} * model.joint_count);
  memory.positions = arena->Take<float>(3 * b);
  memory.normals = arena->Take<float>(3 * b);
  memory.offsets = arena->Take<float>(b);
  memory.slacks = arena->Take<float>(b);
  memory.sites = arena->Take<float>(groups * kNearestSiteFloats * kNearestGroup);
  memory.bounds = arena->Take<float>(kernels::kNearestBounds * kernels::NearestBoundStride(groups));
  memory.nearest = arena->Take<uint16_t>(model.vertex_count);
  memory.suspect = arena->Take<uint16_t>(model.vertex_count);
  return memory;
}

void KeepOutside(const kernels::KernelTable& kernels, const format::ModelView& model, const Space& space,
                 const BoundPose& bound, const BodyMemory& memory, const Surface& surface) {
  const BodyView& body = model.body;
  if (body.vertex_count == 0) return;
  const double units_per_metre = 1 / space.metres_per_unit;
  const double clearance = static_cast<double>(body.clearance) * units_per_metre;
  PoseBody(kernels, model, space, bound, memory);
  PlaceFaces(body, static_cast<float>(clearance), memory);
  PlaceSites(body, memory);
  kernels::NearestJob job = {};
  job.points = surface.positions;
  job.point_stride_bytes = surface.position_stride_bytes;
  job.points_count = model.vertex_count;
  job.sites = memory.sites;
  job.bounds = memory.bounds;
  job.groups = Groups(body);
  job.reach = static_cast<float>(static_cast<double>(body.reach) * units_per_metre);
  job.nearest = memory.nearest;
  job.suspect = memory.suspect;
  kernels.nearest(job);
  const PosedBody posed = {&body, memory.positions, space.mirrored ? -1.0 : 1.0};
  for (size_t i = 0; i < model.vertex_count; ++i) {
    if (memory.suspect[i] == kernels::kNoSite) continue;
    auto* bytes = reinterpret_cast<uint8_t*>(surface.positions) + i * surface.position_stride_bytes;
    PushOut(posed, memory.nearest[i], memory.suspect[i], clearance, reinterpret_cast<float*>(bytes));
  }
}

}  // namespace dcloth::engine

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
constexpr double kPushedFar = 0.99;  // of the clearance: rounded to floats, a vertex that was pushed stays put
constexpr float kFar = 1e18f;        // squared
constexpr float kThird = 0.33334f;

size_t Groups(size_t sites) { return (sites + kNearestGroup - 1) / kNearestGroup; }

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

float Height(const float* normal, const float* point) {
  return normal[0] * point[0] + normal[1] * point[1] + normal[2] * point[2];
}

float Larger(float a, float b) { return a > b ? a : b; }

// Planes over the faces around each vertex, and its slack: the squared distance of a point to the nearest corner of its
// closest face is at most that to the surface and slack^2, as every point of a triangle is within longest edge /
// sqrt(3) of a corner. They serve every class, as both only grow with the faces around. Rejected: one slack for the
// whole body, its longest edge's, which makes most of the waist suspect.
void PlaceFaces(const BodyView& body, float clearance, const BodyMemory& memory) {
  const float *positions = memory.positions, *normals = memory.normals;
  for (size_t i = 0; i < body.vertex_count; ++i) {
    const bool has_faces = body.row_starts[i + 1] != body.row_starts[i];
    memory.offsets[i] = has_faces ? Height(normals + 3 * i, positions + 3 * i) : -3e38f;
    memory.slacks[i] = 0;
  }
  for (size_t f = 0; f < body.face_count; ++f) {
    const uint16_t* face = body.faces + 3 * f;
    const float* const p[3] = {positions + size_t{3} * face[0], positions + size_t{3} * face[1],
                               positions + size_t{3} * face[2]};
    float longest = 0;
    for (size_t c = 0; c < 3; ++c) {
      const float *n = normals + size_t{3} * face[c], *next = p[(c + 1) % 3], *last = p[(c + 2) % 3];
      const float highest = Larger(Height(n, next), Height(n, last));
      memory.offsets[face[c]] = Larger(highest, memory.offsets[face[c]]);
      const float edge[3] = {next[0] - p[c][0], next[1] - p[c][1], next[2] - p[c][2]};
      longest = Larger(Height(edge, edge), longest);
    }
    const float slack = longest < kFar ? kThird * longest : kFar;
    for (size_t c = 0; c < 3; ++c) memory.slacks[face[c]] = Larger(slack, memory.slacks[face[c]]);
  }
  for (size_t i = 0; i < body.vertex_count; ++i) memory.offsets[i] += clearance;
}

// The box of a group whose sites are in place, and its slack.
void PlaceBounds(const float* site, float* bounds, size_t stride) {
  for (size_t c = 0; c < 3; ++c, site += kNearestGroup) {
    float low = site[0], high = low;
    for (size_t k = 1; k < kNearestGroup; ++k) {
      low = site[k] < low ? site[k] : low;
      high = site[k] > high ? site[k] : high;
    }
    bounds[(kernels::kLow + c) * stride] = low;
    bounds[(kernels::kHigh + c) * stride] = high;
  }
  float slack = 0;
  for (size_t k = 0; k < kNearestGroup; ++k) slack = Larger(site[4 * kNearestGroup + k], slack);
  bounds[kernels::kSlack * stride] = slack;
}

size_t BodyVertex(const TouchClass& touch, size_t site) {
  return touch.touched == nullptr ? site : touch.touched[site];
}

// Of the body vertices that a class touches, at least one.
void PlaceSites(const TouchClass& touch, const BodyMemory& memory) {
  const size_t last = touch.touched_count - 1, groups = Groups(touch.touched_count);
  const size_t stride = kernels::NearestBoundStride(groups);
  for (size_t g = 0; g < groups; ++g) {
    float* site = memory.sites + g * kNearestSiteFloats * kNearestGroup;
    for (size_t k = 0; k < kNearestGroup; ++k) {
      const size_t s = g * kNearestGroup + k, i = BodyVertex(touch, s < last ? s : last);
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
    for (size_t row = 0; row < kernels::kSlack; ++row) memory.bounds[row * stride + g] = kernels::kNoGroup;
    memory.bounds[kernels::kSlack * stride + g] = 0;
  }
}

void PushOut(const PosedBody& posed, size_t nearest, size_t suspect, double clearance, float* position) {
  double v[3] = {static_cast<double>(position[0]), static_cast<double>(position[1]), static_cast<double>(position[2])};
  bool moved = false;
  for (int push = 0; push < kMaxPushes; ++push) {
    const ClosestPoint closest = SearchBody(posed, static_cast<uint32_t>(suspect), static_cast<uint32_t>(nearest), v);
    if (!closest.found || closest.distance >= kPushedFar * clearance || EndsAt(posed, closest)) break;
    for (size_t c = 0; c < 3; ++c) v[c] = closest.point[c] + clearance * closest.direction[c];
    moved = true;
  }
  if (!moved) return;
  for (size_t c = 0; c < 3; ++c) position[c] = static_cast<float>(v[c]);
}

}  // namespace

BodyMemory PlaceBodyMemory(const format::ModelView& model, Arena* arena) {
  const size_t b = model.body.vertex_count, groups = Groups(b);
  BodyMemory memory = {};
  if (b == 0) return memory;
  memory.matrices = arena->Take<float>(size_t{12} * model.joint_count);
  memory.positions = arena->Take<float>(3 * b);
  memory.normals = arena->Take<float>(3 * b);
  memory.offsets = arena->Take<float>(b);
  memory.slacks = arena->Take<float>(b);
  memory.sites = arena->Take<float>(groups * kNearestSiteFloats * kNearestGroup);
  memory.bounds = arena->Take<float>(kernels::kNearestBounds * kernels::NearestBoundStride(groups));
  memory.touch = PlaceTouchLists(model, arena);
  return memory;
}

void OrderGarment(const format::ModelView& model, const BodyMemory& memory) {
  if (memory.touch.order != nullptr) FillTouchLists(model, memory.touch);
}

void KeepOutside(const kernels::KernelTable& kernels, const format::ModelView& model, const Space& space,
                 const BoundPose& bound, const BodyMemory& memory, const Surface& surface) {
  const BodyView& body = model.body;
  if (body.vertex_count == 0) return;
  const double units_per_metre = 1 / space.metres_per_unit;
  const double clearance = static_cast<double>(body.clearance) * units_per_metre;
  PoseBody(kernels, model, space, bound, memory);
  PlaceFaces(body, static_cast<float>(clearance), memory);
  kernels::NearestJob job = {};
  uint16_t nearest[kernels::kNearestPatch], suspect[kernels::kNearestPatch];
  job.points = surface.positions;
  job.point_stride_bytes = surface.position_stride_bytes;
  job.sites = memory.sites;
  job.bounds = memory.bounds;
  job.reach = static_cast<float>(static_cast<double>(body.reach) * units_per_metre);
  job.nearest = nearest;
  job.suspect = suspect;
  for (size_t c = 0; c < ClassCount(model); ++c) {
    const TouchClass touch = ClassAt(model, memory.touch, c);
    if (touch.vertex_count == 0 || touch.touched_count == 0) continue;
    PlaceSites(touch, memory);
    job.groups = Groups(touch.touched_count);
    const PosedBody posed = {&body, memory.positions, space.mirrored ? -1.0 : 1.0, touch.bit};
    for (size_t begin = 0; begin < touch.vertex_count; begin += job.points_count) {
      const size_t left = touch.vertex_count - begin;
      job.order = touch.vertices + begin;
      job.points_count = left < kernels::kNearestPatch ? left : kernels::kNearestPatch;
      kernels.nearest(job);
      for (size_t i = 0; i < job.points_count; ++i) {
        if (suspect[i] == kernels::kNoSite) continue;
        auto* bytes = reinterpret_cast<uint8_t*>(surface.positions) + job.order[i] * surface.position_stride_bytes;
        PushOut(posed, BodyVertex(touch, nearest[i]), BodyVertex(touch, suspect[i]), clearance,
                reinterpret_cast<float*>(bytes));
      }
    }
  }
}

}  // namespace dcloth::engine

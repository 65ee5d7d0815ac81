#include "engine/src/contact/body_sites.h"

namespace dcloth::engine {
namespace {

using format::BodyView;
using kernels::kNearestGroup;
using kernels::kNearestSiteFloats;

constexpr float kFar = 1e18f;  // squared
constexpr float kThird = 0.33334f;

float Height(const float* normal, const float* point) {
  return normal[0] * point[0] + normal[1] * point[1] + normal[2] * point[2];
}

float Larger(float a, float b) { return a > b ? a : b; }

// Planes over the faces around each vertex, and its slack: the squared distance of a point to the nearest corner of its
// closest face is at most that to the surface and slack^2, as every point of a triangle is within longest edge /
// sqrt(3) of a corner. They serve every class, as both only grow with the faces around. Rejected: one slack for the
// whole body, its longest edge's, which makes most of the waist suspect.
void PlaceFaces(const BodyView& body, const float* positions, const float* normals, float clearance,
                const BodySites& sites) {
  for (size_t i = 0; i < body.vertex_count; ++i) {
    const bool has_faces = body.row_starts[i + 1] != body.row_starts[i];
    sites.offsets[i] = has_faces ? Height(normals + 3 * i, positions + 3 * i) : -3e38f;
    sites.slacks[i] = 0;
  }
  for (size_t f = 0; f < body.face_count; ++f) {
    // Corners are read before anything is written, which for all that the compiler knows may be one of them.
    const uint16_t* face = body.faces + 3 * f;
    const size_t corners[3] = {face[0], face[1], face[2]};
    float p[3][3], highest[3], longest = 0;
    for (size_t c = 0; c < 3; ++c) {
      for (size_t axis = 0; axis < 3; ++axis) p[c][axis] = positions[3 * corners[c] + axis];
    }
    for (size_t c = 0; c < 3; ++c) {
      const float *n = normals + 3 * corners[c], *next = p[(c + 1) % 3], *last = p[(c + 2) % 3];
      highest[c] = Larger(Height(n, next), Height(n, last));
      const float edge[3] = {next[0] - p[c][0], next[1] - p[c][1], next[2] - p[c][2]};
      longest = Larger(Height(edge, edge), longest);
    }
    const float slack = longest < kFar ? kThird * longest : kFar;
    for (size_t c = 0; c < 3; ++c) {
      sites.offsets[corners[c]] = Larger(highest[c], sites.offsets[corners[c]]);
      sites.slacks[corners[c]] = Larger(slack, sites.slacks[corners[c]]);
    }
  }
  for (size_t i = 0; i < body.vertex_count; ++i) sites.offsets[i] += clearance;
}

// By halves: a chain of comparisons would wait for each.
template <size_t kCount, typename Better>
float Best(const float* row, Better better) {
  if constexpr (kCount == 1) {
    return row[0];
  } else {
    float best[kCount / 2];
    for (size_t k = 0; k < kCount / 2; ++k)
      best[k] = better(row[k], row[k + kCount / 2]) ? row[k] : row[k + kCount / 2];
    return Best<kCount / 2>(best, better);
  }
}

// The box of a group whose sites are in place, and its slack.
void PlaceBounds(const float* site, float* bounds, size_t stride) {
  const auto smaller = [](float a, float b) { return a < b; };
  const auto larger = [](float a, float b) { return a > b; };
  for (size_t c = 0; c < 3; ++c) {
    bounds[(kernels::kLow + c) * stride] = Best<kNearestGroup>(site + c * kNearestGroup, smaller);
    bounds[(kernels::kHigh + c) * stride] = Best<kNearestGroup>(site + c * kNearestGroup, larger);
  }
  bounds[kernels::kSlack * stride] = Best<kNearestGroup>(site + (kNearestSiteFloats - 1) * kNearestGroup, larger);
}

void PlacePadding(float* bounds, size_t groups) {
  const size_t stride = kernels::NearestBoundStride(groups);
  for (size_t g = groups; g < stride; ++g) {
    for (size_t row = 0; row < kernels::kSlack; ++row) bounds[row * stride + g] = kernels::kNoGroup;
    bounds[kernels::kSlack * stride + g] = 0;
  }
}

size_t BoundFloats(size_t groups) { return kernels::kNearestBounds * kernels::NearestBoundStride(groups); }

}  // namespace

BodySites PlaceBodySites(const BodyView& body, Arena* arena) {
  const size_t b = body.vertex_count, groups = SiteGroupCount(body);
  BodySites sites = {};
  sites.groups = groups;
  sites.offsets = arena->Take<float>(b);
  sites.slacks = arena->Take<float>(b);
  sites.sites = arena->Take<float>(groups * kNearestSiteFloats * kNearestGroup);
  sites.bounds = arena->Take<float>(BoundFloats(groups));
  if (body.touch_classes != nullptr) sites.class_bounds = arena->Take<float>(BoundFloats(MostGroupCount(body)));
  return sites;
}

void FillBodySites(const BodyView& body, const TouchLists& lists, const float* positions, const float* normals,
                   float clearance, const BodySites& sites) {
  PlaceFaces(body, positions, normals, clearance, sites);
  const size_t stride = kernels::NearestBoundStride(sites.groups);
  for (size_t g = 0; g < sites.groups; ++g) {
    float* site = sites.sites + g * kNearestSiteFloats * kNearestGroup;
    for (size_t k = 0; k < kNearestGroup; ++k) {
      const size_t i = BodyVertexAt(body, lists, g * kNearestGroup + k);
      for (size_t c = 0; c < 3; ++c) {
        site[c * kNearestGroup + k] = positions[3 * i + c];
        site[(3 + c) * kNearestGroup + k] = normals[3 * i + c];
      }
      site[6 * kNearestGroup + k] = sites.offsets[i];
      site[7 * kNearestGroup + k] = sites.slacks[i];
    }
    PlaceBounds(site, sites.bounds + g, stride);
  }
  PlacePadding(sites.bounds, sites.groups);
}

void UseSites(const TouchClass& touch, const BodySites& sites, kernels::NearestJob* job) {
  job->sites = sites.sites;
  job->groups = touch.group_count;
  job->group_places = touch.groups;
  job->bounds = sites.bounds;
  if (touch.groups == nullptr) return;
  const size_t from = kernels::NearestBoundStride(sites.groups);
  const size_t stride = kernels::NearestBoundStride(touch.group_count);
  for (size_t row = 0; row < kernels::kNearestBounds; ++row) {
    for (size_t g = 0; g < touch.group_count; ++g)
      sites.class_bounds[row * stride + g] = sites.bounds[row * from + touch.groups[g]];
  }
  PlacePadding(sites.class_bounds, touch.group_count);
  job->bounds = sites.class_bounds;
}

}  // namespace dcloth::engine

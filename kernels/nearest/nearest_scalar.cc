#include "kernels/kernels.h"
#include "kernels/scalar_math.h"

namespace dcloth::kernels::scalar {
namespace {

struct Search {
  float point[3];
  float nearest_squared, suspect_excess;  // squared distances, less slack^2 for the suspect
  uint16_t nearest, suspect;
};

float SquaredDistance(const NearestJob& job, const float* point, size_t group) {
  const size_t stride = NearestBoundStride(job.groups);
  float sum = 0;
  for (size_t c = 0; c < 3; ++c) {
    const float d = point[c] - job.bounds[(kCentre + c) * stride + group];
    sum += d * d;
  }
  return sum;
}

void LookInto(const NearestJob& job, size_t group, Search* search) {
  const float* site = job.sites + group * kNearestSiteFloats * kNearestGroup;
  const float* v = search->point;
  for (size_t k = 0; k < kNearestGroup; ++k, ++site) {
    const float x = v[0] - site[0], y = v[1] - site[kNearestGroup], z = v[2] - site[2 * kNearestGroup];
    const float squared = x * x + y * y + z * z;
    const float* normal = site + 3 * kNearestGroup;
    const float height = normal[0] * v[0] + normal[kNearestGroup] * v[1] + normal[2 * kNearestGroup] * v[2];
    const auto index = static_cast<uint16_t>(group * kNearestGroup + k);
    if (squared < search->nearest_squared) {
      search->nearest_squared = squared;
      search->nearest = index;
    }
    const float excess = squared - site[7 * kNearestGroup];
    if (height < site[6 * kNearestGroup] && excess < search->suspect_excess) {
      search->suspect_excess = excess;
      search->suspect = index;
    }
  }
}

float Bound(const NearestJob& job, size_t row, size_t group) {
  return job.bounds[row * NearestBoundStride(job.groups) + group];
}

bool MayMatter(const NearestJob& job, const Search& search, float squared, size_t group) {
  const float slack = Bound(job, kSlack, group);
  const float bound = SquareRoot(search.nearest_squared + slack * slack) + Bound(job, kRadius, group);
  return squared <= bound * bound;
}

// The group with the nearest centre: it rules out most of the others.
size_t FirstGroup(const NearestJob& job, const float* point) {
  size_t first = 0;
  float least = SquaredDistance(job, point, 0);
  for (size_t g = 1; g < job.groups; ++g) {
    const float squared = SquaredDistance(job, point, g);
    if (!(squared < least)) continue;
    least = squared;
    first = g;
  }
  return first;
}

}  // namespace

void Nearest(const NearestJob& job) {
  for (size_t i = 0; i < job.points_count; ++i) {
    const auto* bytes = reinterpret_cast<const char*>(job.points) + i * job.point_stride_bytes;
    const auto* point = reinterpret_cast<const float*>(bytes);
    job.nearest[i] = job.suspect[i] = kNoSite;
    Search search = {{point[0], point[1], point[2]}, job.reach * job.reach, 3e38f, kNoSite, kNoSite};
    const size_t first = FirstGroup(job, search.point);
    LookInto(job, first, &search);
    for (size_t g = 0; g < job.groups; ++g) {
      if (g != first && MayMatter(job, search, SquaredDistance(job, search.point, g), g)) LookInto(job, g, &search);
    }
    if (search.nearest == kNoSite || !(search.suspect_excess <= search.nearest_squared)) continue;
    job.nearest[i] = search.nearest;
    job.suspect[i] = search.suspect;
  }
}

}  // namespace dcloth::kernels::scalar

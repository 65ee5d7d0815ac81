#include "kernels/kernels.h"

namespace dcloth::kernels::scalar {
namespace {

constexpr float kMore = 1.00001f;  // for the rounding of a difference of squares

struct Search {
  float point[3];
  float nearest_squared, suspect_excess;  // squared distances, less slack^2 for the suspect
  uint16_t nearest, suspect;
};

void LookInto(const NearestJob& job, size_t group, Search* search) {
  const size_t place = GroupPlace(job, group);
  const float* site = job.sites + place * kNearestSiteFloats * kNearestGroup;
  const float* v = search->point;
  for (size_t k = 0; k < kNearestGroup; ++k, ++site) {
    const float x = v[0] - site[0], y = v[1] - site[kNearestGroup], z = v[2] - site[2 * kNearestGroup];
    const float squared = x * x + y * y + z * z;
    const float* normal = site + 3 * kNearestGroup;
    const float height = normal[0] * v[0] + normal[kNearestGroup] * v[1] + normal[2 * kNearestGroup] * v[2];
    const auto index = static_cast<uint16_t>(place * kNearestGroup + k);
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

bool MayMatter(const NearestJob& job, const Search& search, size_t group) {
  const size_t stride = NearestBoundStride(job.groups);
  float apart[3];
  for (size_t c = 0; c < 3; ++c) {
    const float below = job.bounds[(kLow + c) * stride + group] - search.point[c];
    const float above = search.point[c] - job.bounds[(kHigh + c) * stride + group];
    apart[c] = below > 0 ? below : above > 0 ? above : 0;
  }
  const float squared = apart[0] * apart[0] + apart[1] * apart[1] + apart[2] * apart[2];
  return squared <= (search.nearest_squared + job.bounds[kSlack * stride + group]) * kMore;
}

}  // namespace

void Nearest(const NearestJob& job) {
  for (size_t i = 0; i < job.points_count; ++i) {
    const auto* bytes = reinterpret_cast<const char*>(job.points) + job.order[i] * job.point_stride_bytes;
    const auto* point = reinterpret_cast<const float*>(bytes);
    job.nearest[i] = job.suspect[i] = kNoSite;
    Search search = {{point[0], point[1], point[2]}, job.reach * job.reach, 3e38f, kNoSite, kNoSite};
    size_t looks = 0;
    for (size_t g = 0; g < job.groups; ++g) {
      if (!MayMatter(job, search, g)) continue;
      LookInto(job, g, &search);
      ++looks;
    }
    CountLooks(job, looks);
    if (search.nearest == kNoSite || !(search.suspect_excess <= search.nearest_squared)) continue;
    job.nearest[i] = search.nearest;
    job.suspect[i] = search.suspect;
  }
}

}  // namespace dcloth::kernels::scalar

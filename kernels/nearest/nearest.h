// For each of many points a site near it whose plane the point is not above, and the nearest of all sites: where a
// garment may lie under a body (NETWORK.md, "Penetration"). Exact but for rounding; bounds of groups of sites only save
// work: a point is looked up in the few groups that may hold its nearest site or a suspect.
#ifndef DCLOTH_KERNELS_NEAREST_NEAREST_H_
#define DCLOTH_KERNELS_NEAREST_NEAREST_H_

#include <cstddef>
#include <cstdint>

namespace dcloth::kernels {

constexpr size_t kNearestGroup = 16;      // sites in a group
constexpr size_t kNearestSiteFloats = 8;  // position, plane normal, plane offset, slack^2
constexpr size_t kMaxNearestGroups = 512;
constexpr uint16_t kNoSite = 0xFFFF;

// Rows of `bounds`: a sphere around each group's sites, and the largest slack of them.
enum NearestBound { kCentre = 0, kRadius = 3, kSlack = 4, kNearestBounds = 5 };

// Floats between the rows of `bounds`.
constexpr size_t NearestBoundStride(size_t groups) { return (groups + 15) / 16 * 16; }

// Site s is lane s % 16 of group s / 16. A point v is not above its plane where normal . v < offset; the site is
// suspect where moreover distance^2 - slack^2 is at most the squared distance of the nearest site.
struct NearestJob {
  const float* points;        // first point's three floats; the next one lies point_stride_bytes further
  size_t point_stride_bytes;  // at least 12, a multiple of 4
  size_t points_count;
  const float* sites;   // [groups][8][16]: x, y, z, normal x, y, z, offset, slack^2; filled up with the last one
  const float* bounds;  // [kNearestBounds][NearestBoundStride]; padding at x = 1e18, all else 0
  size_t groups;        // 1 to kMaxNearestGroups
  float reach;          // points with no site nearer than this have none; 0 to 1e9
  uint16_t* nearest;    // [points_count]; kNoSite where there is no suspect
  uint16_t* suspect;    // [points_count]; the suspect of least distance^2 - slack^2, or kNoSite; of a point that
                        // is no number, and of those near one in this order, kNoSite
};

}  // namespace dcloth::kernels

#endif  // DCLOTH_KERNELS_NEAREST_NEAREST_H_

// For each of many points the nearest of many sites whose plane the point is not above, and the nearest of all: where a
// garment may lie under a body (NETWORK.md, "Penetration"). Exact but for rounding; bounds of groups of sites only save
// work: points that are above everything near them, almost all, are looked up in one group.
#ifndef DCLOTH_KERNELS_NEAREST_NEAREST_H_
#define DCLOTH_KERNELS_NEAREST_NEAREST_H_

#include <cstddef>
#include <cstdint>

namespace dcloth::kernels {

constexpr size_t kNearestGroup = 16;         // sites in a group
constexpr size_t kNearestSiteFloats = 7;     // position, plane normal, plane offset
constexpr size_t kMaxNearestGroups = 512;
constexpr uint16_t kNoSite = 0xFFFF;

// Rows of `bounds`: a sphere around each group's sites, and a cone around their normals: with a the axis, each normal n
// is within `spread` of a, and offset - n . centre is at most `rise`: v is above all planes of the group where
// a . (v - centre) - spread |v - centre| > rise.
enum NearestBound { kCentre = 0, kRadius = 3, kAxis = 4, kSpread = 7, kRise = 8, kNearestBounds = 9 };

// Floats between the rows of `bounds`.
constexpr size_t NearestBoundStride(size_t groups) { return (groups + 15) / 16 * 16; }

// Site s is lane s % 16 of group s / 16. A point v is not above its plane where normal . v < offset.
struct NearestJob {
  const float* points;        // first point's three floats; the next one lies point_stride_bytes further
  size_t point_stride_bytes;  // at least 12, a multiple of 4
  size_t points_count;
  const float* sites;         // [groups][7][16]: x, y, z, normal x, y, z, offset; filled up with the last site
  const float* bounds;        // [kNearestBounds][NearestBoundStride]; padding at x = 1e18, all else 0
  size_t groups;              // 1 to kMaxNearestGroups
  float reach;                // points with no site nearer than this have none; 0 to 1e9
  float slack;                // a site s is suspect up to distance^2 <= nearest^2 + slack^2; 0 to 1e9
  uint16_t* nearest;          // [points_count]; kNoSite where there is no suspect
  uint16_t* suspect;          // [points_count]; nearest suspect whose plane the point is not above, or kNoSite; of
                              // a point that is no number, and those next to one, kNoSite
};

}  // namespace dcloth::kernels

#endif  // DCLOTH_KERNELS_NEAREST_NEAREST_H_

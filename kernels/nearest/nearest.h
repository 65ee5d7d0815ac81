// For each point of a patch a site near it whose plane the point is not above, and the nearest of all sites: where a
// garment may lie under a body (NETWORK.md, "Contact"). Exact but for rounding and for runs of points that are
// clear of the surface as a whole; boxes around groups of sites and around the points only save work, as a distance to
// a box, rounded like one to a site within, is never above it.
#ifndef DCLOTH_KERNELS_NEAREST_NEAREST_H_
#define DCLOTH_KERNELS_NEAREST_NEAREST_H_

#include <cstddef>
#include <cstdint>

namespace dcloth::kernels {

constexpr size_t kNearestGroup = 16;      // sites in a group
constexpr size_t kNearestPatch = 64;      // most points of a patch
constexpr size_t kNearestSiteFloats = 8;  // position, plane normal, plane offset, slack^2
constexpr size_t kMaxNearestGroups = 768;
constexpr uint16_t kNoSite = 0xFFFF;

// Rows of `bounds`: the box around each group's sites, and their largest slack^2.
enum NearestBound { kLow = 0, kHigh = 3, kSlack = 6, kNearestBounds = 7 };
constexpr float kNoGroup = 1e18f;  // where the boxes of padding lie

// Floats between the rows of `bounds`.
constexpr size_t NearestBoundStride(size_t groups) { return (groups + 15) / 16 * 16; }

// Site s is lane s % 16 of group s / 16 of `sites`, of which a job may be about some. A point v is not above its plane
// where normal . v < offset; the site is suspect where moreover distance^2 - slack^2 is at most the squared distance of
// the nearest site. Of equals the first counts.
//
// A run of four points from the start may go without suspects where a ball around it, wider by `clearance`, is free of
// the surface that the sites stand for (distance^2 - slack^2 of every site from the ball's middle is above the square
// of its radius) and the middle itself has no suspect: where no surface lies between, all are on the side of the
// middle.
struct NearestJob {
  const float* points;        // point p's three floats lie at p point_stride_bytes
  size_t point_stride_bytes;  // at least 12, a multiple of 4
  const uint16_t* order;      // [points_count], the p to look up: work grows with how far they spread, and so it does
                              // for each run of 4, 8 and 16 from the start
  size_t points_count;        // 1 to kNearestPatch
  const float* sites;         // [groups or more][8][16]: x, y, z, unit normal x, y, z, offset, slack^2; filled up with
                              // the last one
  const float* bounds;        // [kNearestBounds][NearestBoundStride]; padding at kNoGroup, slack 0
  size_t groups;              // of `bounds`, 1 to kMaxNearestGroups
  float reach;                // points with no site nearer than this have none; 0 to 1e9
  uint16_t* nearest;          // [points_count]; kNoSite where there is no suspect
  uint16_t* suspect;          // [points_count]; the suspect of least distance^2 - slack^2, or kNoSite; of a point that
                              // is no number, and of others of its patch, kNoSite or any site
  float clearance = 0;        // 0 or more
  const uint16_t* group_places = nullptr;  // [groups], which group of `sites` each is; null: in order
  uint32_t* looks = nullptr;  // grows by what the call took: a point, or a ball that stands for four, against a group's
                              // sixteen sites is one, some 8 ns. How many differs between instruction sets; may be null
};

inline void CountLooks(const NearestJob& job, size_t count) {
  if (job.looks != nullptr) *job.looks += static_cast<uint32_t>(count);
}

inline size_t GroupPlace(const NearestJob& job, size_t group) {
  return job.group_places == nullptr ? group : job.group_places[group];
}

}  // namespace dcloth::kernels

#endif  // DCLOTH_KERNELS_NEAREST_NEAREST_H_

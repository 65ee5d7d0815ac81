#include "fit/body_fit.h"

#include <cmath>
#include <cstring>
#include <initializer_list>

#include "kernels/kernels.h"

namespace dcloth::fit {
namespace {

using engine::kMaxPoseMagnitude;
using engine::StoreFloats;
using format::Diagnostic;
using format::kNoOffset;
using format::ModelView;
using format::Path;

// All lengths in the figure's metres.
constexpr float kNoHeight = -1e9f;
constexpr double kReach = 0.12;        // of skin over or under the figure's
constexpr double kBeside = 0.013;      // between a vertex's normal and a sample
constexpr double kFacing = 0.5;        // cosine between the normals of a vertex and of skin that it may move to
constexpr float kLayerGap = 0.008f;    // to the next layer of clothes over the skin; the next toe is further
constexpr float kFar = 1e9f;           // height of what is not there
constexpr double kSampleStep = 0.012;  // between samples of a triangle
constexpr int kMostSteps = 64;         // along an edge of a triangle
constexpr double kSkinReach = 0.03;    // of the skin that holds a vertex of the surface
constexpr double kCovered = 0.002;     // that skin may stand out of a face of the surface: the clearance hides it
constexpr float kMostUnheld = 0.3f;    // of the skin's weight, with joints that the model has not
constexpr uint16_t kNoMover = 0xFFFF;
constexpr float kHeld = -1;  // in place of a distance
constexpr double kClothReach = 0.04, kClothBeside = 0.010;
constexpr double kOnSkin = 0.010;      // over what is closest to the figure's skin; counts as lying on it
constexpr double kFollows = 0.08;      // distance at which cloth follows the skin by half
constexpr double kClothBlur = 0.035;   // over which moves of the cloth are averaged, as a standard deviation
constexpr double kClothSearch = 0.25;  // further from the skin cloth stays
constexpr uint32_t kCells = 4096;
// In looks into a cell: of a visit to a vertex, and of a sample or a corner of a triangle beside its influences.
constexpr uint64_t kVisitWork = 2, kSampleWork = 8;
constexpr double kCell = 0.06;
// Between the places along its normal at which a vertex is found, and how many of them body and garment have.
constexpr double kPlaceStep = 0.04;
constexpr uint32_t kBodyPlaces = 6, kGarmentPlaces = 2;
constexpr double kFarthest = 1e12;
constexpr double kTurned = 0.3;  // cosine between a face and its vertices, under which it is smoothed
constexpr int kUntangleSteps = 30, kFillSteps = 40, kSmoothSteps = 3, kMostClothSteps = 64;
// Heights of slices over the hip joints on the figure; and how far around them girth needs the skin.
constexpr double kWaist[2] = {0.15, 0.22}, kHips[2] = {-0.03, 0.05}, kAroundSlices = 0.1;
constexpr double kMostGirth = 1.18, kLeastGirth = 0.85;  // that the scale takes up; the rest is moved

enum Region : uint8_t { kTrunkRegion, kLeftArm, kRightArm, kLeftLeg, kRightLeg };

uint8_t RegionOf(uint32_t role) {
  if (role >= DCLOTH_ROLE_LEFT_UPPER_ARM && role <= DCLOTH_ROLE_LEFT_HAND) return kLeftArm;
  if (role >= DCLOTH_ROLE_RIGHT_UPPER_ARM && role <= DCLOTH_ROLE_RIGHT_HAND) return kRightArm;
  if (role >= DCLOTH_ROLE_LEFT_UPPER_LEG && role <= DCLOTH_ROLE_LEFT_TOES) return kLeftLeg;
  return role >= DCLOTH_ROLE_RIGHT_UPPER_LEG ? kRightLeg : kTrunkRegion;
}

// The trunk ends in the legs nowhere in particular; the other leg and an arm that hangs are other parts.
bool Meet(uint8_t a, uint8_t b) {
  return a == b || (a == kTrunkRegion && b >= kLeftLeg) || (b == kTrunkRegion && a >= kLeftLeg);
}

// Takes work off the budget; false once it is used up.
bool Spend(uint64_t work, uint64_t* work_left) {
  *work_left -= work < *work_left ? work : *work_left;
  return *work_left != 0;
}

uint32_t CellOf(int64_t x, int64_t y, int64_t z) {
  const uint64_t mixed = static_cast<uint64_t>(x) * 73856093u ^ static_cast<uint64_t>(y) * 19349663u ^
                         static_cast<uint64_t>(z) * 83492791u;
  return static_cast<uint32_t>(mixed % kCells);
}
int64_t CellAt(double x) {
  if (!(std::fabs(x) < kFarthest)) return 0;          // nothing is beside it, and no integer holds it
  const auto cell = static_cast<int64_t>(x / kCell);  // towards zero
  return x < 0 ? cell - 1 : cell;
}

// Vertices by the cell that they lie in, and the box around all of them. With more than one place, a vertex lies in the
// cells along its normal: a sample finds there what it lies over, without a look at all around.
template <uint32_t kPlaces>
class Grid {
 public:
  // `heads` [kCells], `next` [kPlaces * count], `normals` [count, 3], null with one place. Vertices that are not
  // `wanted` are left out. Each look into a cell takes of `work_left`; at 0 nothing is found any more.
  template <typename Wanted>
  Grid(const float* positions, const float* normals, uint32_t count, uint32_t* heads, uint32_t* next,
       uint64_t* work_left, Wanted wanted)
      : heads_(heads), next_(next), work_left_(work_left) {
    for (uint32_t i = 0; i < kCells; ++i) heads[i] = UINT32_MAX;
    for (uint32_t v = 0; v < count; ++v) {
      if (!wanted(v)) continue;
      for (uint32_t place = kPlaces * v; place < kPlaces * (v + 1); ++place) {
        const double along = (static_cast<double>(place % kPlaces) - 0.5 * (kPlaces - 1)) * kPlaceStep;
        int64_t cell[3];
        for (size_t a = 0; a < 3; ++a) {
          auto at = static_cast<double>(positions[size_t{3} * v + a]);
          if constexpr (kPlaces > 1) at += along * static_cast<double>(normals[size_t{3} * v + a]);
          cell[a] = CellAt(at);
          low_[a] = at < low_[a] ? at : low_[a];
          high_[a] = at > high_[a] ? at : high_[a];
        }
        uint32_t* head = heads + CellOf(cell[0], cell[1], cell[2]);
        next[place] = *head;
        *head = place;
      }
    }
  }

  // Calls visit(v) for all with a place within `reach`, for some further and for some twice.
  template <typename Visit>
  void VisitNear(const double (&at)[3], double reach, Visit visit) const {
    int64_t low[3], high[3];
    uint64_t work = 1;
    for (size_t a = 0; a < 3; ++a) {
      if (!(at[a] >= low_[a] - reach - kCell && at[a] <= high_[a] + reach + kCell)) return;
      low[a] = CellAt(at[a] - reach), high[a] = CellAt(at[a] + reach);
      if (high[a] < low[a]) return;  // around kFarthest
      work *= static_cast<uint64_t>(high[a] - low[a] + 1);
    }
    if (!Spend(work, work_left_)) return;
    work = 0;
    for (int64_t x = low[0]; x <= high[0]; ++x) {
      for (int64_t y = low[1]; y <= high[1]; ++y) {
        for (int64_t z = low[2]; z <= high[2]; ++z) {
          for (uint32_t place = heads_[CellOf(x, y, z)]; place != UINT32_MAX; place = next_[place], ++work)
            visit(place / kPlaces);
        }
      }
    }
    Spend(kVisitWork * work, work_left_);
  }

 private:
  const uint32_t *heads_, *next_;
  uint64_t* work_left_;
  double low_[3] = {1e300, 1e300, 1e300}, high_[3] = {-1e300, -1e300, -1e300};
};

// A point of the character's skin.
struct Sample {
  double at[3];
  double normal[3];  // outward, unit; 0 where the skin has no triangles
  double spread;     // times as wide as where it has some
  uint8_t region;
  uint32_t corners[3];  // of the character's body
  double shares[3];
};

double Dot3(const double (&a)[3], const double (&b)[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

// take(v, height, alike, plane) for the vertices that have the sample within `reach` along their normal and `beside`
// from it. `alike` is the cosine between their normals, `plane` the height of the sample's plane over the vertex.
template <uint32_t kPlaces, typename Take>
void VisitBeside(const PlacedSurface& surface, const Grid<kPlaces>& grid, const Sample& sample, double reach,
                 double beside, Take take) {
  const double aside = sample.spread * beside;
  grid.VisitNear(sample.at, std::sqrt(0.25 * kPlaceStep * kPlaceStep + aside * aside), [&](uint32_t v) {
    if (!Meet(sample.region, surface.regions[v])) return;
    const float *at = surface.positions + size_t{3} * v, *n = surface.normals + size_t{3} * v;
    const double normal[3] = {static_cast<double>(n[0]), static_cast<double>(n[1]), static_cast<double>(n[2])};
    const double d[3] = {sample.at[0] - static_cast<double>(at[0]), sample.at[1] - static_cast<double>(at[1]),
                         sample.at[2] - static_cast<double>(at[2])};
    const double height = Dot3(d, normal);
    if (height > reach || height < -reach || Dot3(d, d) - height * height > aside * aside) return;
    const double alike = Dot3(normal, sample.normal);
    take(v, static_cast<float>(height), alike, alike > 0 ? static_cast<float>(Dot3(d, sample.normal) / alike) : kFar);
  });
}

void Cross(const double (&a)[3], const double (&b)[3], double (&out)[3]) {
  for (size_t i = 0; i < 3; ++i) out[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
}

// Twice the area of a triangle, as a vector along its normal.
void AreaOf(const double (&a)[3], const double (&b)[3], const double (&c)[3], double (&area)[3]) {
  double edge[3], other[3];
  for (size_t i = 0; i < 3; ++i) edge[i] = b[i] - a[i], other[i] = c[i] - a[i];
  Cross(edge, other, area);
}

void CornersOf(const float* positions, const uint16_t* face, double (&corner)[3][3]) {
  for (size_t k = 0; k < 3; ++k) {
    for (size_t a = 0; a < 3; ++a) corner[k][a] = static_cast<double>(positions[size_t{3} * face[k] + a]);
  }
}

struct Corner {
  double at[3];
  uint8_t region;
};

Corner CornerAt(const dcloth_character& character, const Space& space, const uint8_t* regions, uint32_t v) {
  float host[3];
  std::memcpy(host, character.body_positions + size_t{3} * v, sizeof(host));
  Corner corner = {};
  VectorFromHost(space, host, corner.at);
  float weights[5] = {};
  for (uint32_t k = 0; k < character.body_influences; ++k) {
    const size_t i = size_t{v} * character.body_influences + k;
    weights[regions[character.body_joints[i]]] += character.body_weights[i];
  }
  for (uint8_t r = 1; r < 5; ++r) {
    if (weights[r] > weights[corner.region]) corner.region = r;
  }
  return corner;
}

struct SkinTriangle {
  Corner corners[3];
  double area[3];  // twice, a vector
};

SkinTriangle TriangleAt(const dcloth_character& character, const Space& space, const uint8_t* regions, size_t t) {
  SkinTriangle triangle = {};
  for (size_t k = 0; k < 3; ++k)
    triangle.corners[k] = CornerAt(character, space, regions, character.body_triangles[3 * t + k]);
  AreaOf(triangle.corners[0].at, triangle.corners[1].at, triangle.corners[2].at, triangle.area);
  return triangle;
}

size_t TriangleCount(const dcloth_character& character) {
  return character.body_triangles != nullptr ? character.body_triangle_count : 0;
}

// 1 where triangles are counter-clockwise seen from outside in the model's axes, else -1: files and spaces turn them.
double WindingOf(const dcloth_character& character, const Space& space, const uint8_t* regions) {
  double middle[3] = {}, volume = 0;
  for (uint32_t v = 0; v < character.body_vertex_count; ++v) {
    const Corner corner = CornerAt(character, space, regions, v);
    for (size_t c = 0; c < 3; ++c) middle[c] += corner.at[c] / character.body_vertex_count;
  }
  for (size_t t = 0; t < character.body_triangle_count; ++t) {
    const SkinTriangle triangle = TriangleAt(character, space, regions, t);
    double from_middle[3];
    for (size_t c = 0; c < 3; ++c) from_middle[c] = triangle.corners[0].at[c] - middle[c];
    volume += Dot3(from_middle, triangle.area);
  }
  return volume < 0 ? -1 : 1;
}

// All of the skin, as samples about kSampleStep apart where it has triangles; some of it where the work runs out.
template <typename Visit>
void SampleSkin(const dcloth_character& character, const Space& space, const uint8_t* regions, uint64_t* work_left,
                Visit visit) {
  Sample sample = {};
  const uint64_t corner_work = kSampleWork + character.body_influences;
  if (!Spend(corner_work * (character.body_vertex_count + uint64_t{6} * TriangleCount(character)), work_left)) return;
  if (character.body_triangles == nullptr) {
    sample.spread = 2;
    for (uint32_t v = 0; v < character.body_vertex_count; ++v) {
      const Corner corner = CornerAt(character, space, regions, v);
      std::memcpy(sample.at, corner.at, sizeof(sample.at));
      sample.region = corner.region;
      sample.corners[0] = v, sample.shares[0] = 1;
      if (*work_left == 0) return;
      visit(sample);
    }
    return;
  }
  sample.spread = 1;
  const double winding = WindingOf(character, space, regions);
  for (size_t t = 0; t < character.body_triangle_count; ++t) {
    const SkinTriangle triangle = TriangleAt(character, space, regions, t);
    const Corner(&c)[3] = triangle.corners;
    for (size_t k = 0; k < 3; ++k) sample.corners[k] = character.body_triangles[3 * t + k];
    double longest = 0;
    for (size_t k = 0; k < 3; ++k) {
      double squared = 0;
      for (int a = 0; a < 3; ++a) {
        const double d = c[k].at[a] - c[(k + 1) % 3].at[a];
        squared += d * d;
      }
      longest = squared > longest ? squared : longest;
    }
    const double area = std::sqrt(Dot3(triangle.area, triangle.area));
    for (size_t a = 0; a < 3; ++a) sample.normal[a] = area > 0 ? winding * triangle.area[a] / area : 0;
    const double wanted = std::sqrt(longest) / kSampleStep;
    const auto take = [&](double u, double w) {
      for (int a = 0; a < 3; ++a)
        sample.at[a] = c[0].at[a] + u * (c[1].at[a] - c[0].at[a]) + w * (c[2].at[a] - c[0].at[a]);
      sample.region = c[u > 0.5 ? 1 : w > 0.5 ? 2 : 0].region;
      sample.shares[0] = 1 - u - w, sample.shares[1] = u, sample.shares[2] = w;
      visit(sample);
    };
    // One of a triangle within a step: those of its corners would be the next triangles' too.
    const int steps = wanted < 1 ? 0 : wanted < kMostSteps ? static_cast<int>(wanted) + 1 : kMostSteps;
    if (!Spend(kSampleWork * static_cast<uint64_t>((steps + 1) * (steps + 2) / 2), work_left)) return;
    if (steps == 0) take(1.0 / 3, 1.0 / 3);
    for (int i = 0; i <= steps && steps != 0; ++i) {
      for (int j = 0; i + j <= steps; ++j) take(static_cast<double>(i) / steps, static_cast<double>(j) / steps);
    }
  }
}

// The outermost skin beside each vertex of a garment, whichever way it faces: pleats do not face as skin does.
void FindOutermost(const dcloth_character& character, const Space& space, const uint8_t* regions,
                   const PlacedSurface& surface, uint32_t* cells, uint64_t* work_left) {
  const Grid<kGarmentPlaces> grid(surface.positions, surface.normals, surface.count, cells, surface.next, work_left,
                                  [](uint32_t) { return true; });
  static_assert(kClothReach <= 0.5 * kPlaceStep * kGarmentPlaces);
  for (uint32_t v = 0; v < surface.count; ++v) surface.heights[v] = kNoHeight;
  SampleSkin(character, space, regions, work_left, [&](const Sample& sample) {
    VisitBeside(surface, grid, sample, kClothReach, kClothBeside, [&](uint32_t v, float height, double, float) {
      if (height > surface.heights[v]) surface.heights[v] = height;
    });
  });
}

bool IsEmpty(const Layers& layers, size_t k) { return layers.low[k] > layers.high[k]; }

float FromSurface(const Layers& layers, size_t k) {
  return layers.low[k] > 0 ? layers.low[k] : layers.high[k] < 0 ? -layers.high[k] : 0;
}

// Joins the layers within kLayerGap. Where there is no place for one more, those nearest to the surface stay.
void AddToLayers(float height, Layers* layers) {
  for (size_t k = 0; k < kMostLayers; ++k) {
    if (height >= layers->low[k] && height <= layers->high[k]) return;
  }
  size_t into = kMostLayers, place = 0;
  for (size_t k = 0; k < kMostLayers; ++k) {
    if (IsEmpty(*layers, k) || height < layers->low[k] - kLayerGap || height > layers->high[k] + kLayerGap) continue;
    if (into == kMostLayers) {
      into = k;
      layers->low[k] = height < layers->low[k] ? height : layers->low[k];
      layers->high[k] = height > layers->high[k] ? height : layers->high[k];
    } else {
      layers->low[into] = layers->low[k] < layers->low[into] ? layers->low[k] : layers->low[into];
      layers->high[into] = layers->high[k] > layers->high[into] ? layers->high[k] : layers->high[into];
      layers->low[k] = kFar, layers->high[k] = kNoHeight;
    }
  }
  if (into != kMostLayers) return;
  for (size_t k = 1; k < kMostLayers; ++k) {
    if (!IsEmpty(*layers, place) && (IsEmpty(*layers, k) || FromSurface(*layers, k) > FromSurface(*layers, place)))
      place = k;
  }
  if (!IsEmpty(*layers, place) && FromSurface(*layers, place) <= std::fabs(height)) return;
  layers->low[place] = layers->high[place] = height;
}

// The outside of the layer nearest to the surface, or of a further one that stands over it: a robot's shell, a coat.
// Skin that faces the surface in between is the near side of another part, as the next toe's, whose outside is not this
// vertex's.
float OutsideOf(const Layers& layers, const Layers& near_sides) {
  size_t nearest = 0;
  for (size_t k = 1; k < kMostLayers; ++k) {
    if (FromSurface(layers, k) < FromSurface(layers, nearest)) nearest = k;
  }
  const float own = layers.high[nearest];
  float end = kFar, outside = own;
  for (size_t k = 0; k < kMostLayers; ++k) {
    if (near_sides.high[k] <= own) continue;
    const float begin = near_sides.low[k] > own ? near_sides.low[k] : own;
    end = begin < end ? begin : end;
  }
  for (size_t k = 0; k < kMostLayers; ++k) {
    if (layers.high[k] > outside && layers.low[k] < end) outside = layers.high[k];
  }
  return outside;
}

// How high the skin over each vertex of the surface that is `wanted` stands. Skin that faces another way is another
// part's, or the wall of a fold; where that wall is beside the vertex it counts as high as its plane is over it.
template <typename Wanted>
void FindSkinOver(const dcloth_character& character, const Space& space, const uint8_t* regions,
                  const PlacedSurface& surface, uint32_t* cells, Layers* layers, Layers* near_sides,
                  uint64_t* work_left, Wanted wanted) {
  const Grid<kBodyPlaces> grid(surface.positions, surface.normals, surface.count, cells, surface.next, work_left,
                               wanted);
  static_assert(kReach <= 0.5 * kPlaceStep * kBodyPlaces);
  for (uint32_t v = 0; v < surface.count; ++v) {
    for (Layers* of : {layers + v, near_sides + v}) {
      for (size_t k = 0; k < kMostLayers; ++k) of->low[k] = kFar, of->high[k] = kNoHeight;
    }
  }
  SampleSkin(character, space, regions, work_left, [&](const Sample& sample) {
    const double facing = Dot3(sample.normal, sample.normal) > 0 ? kFacing : 0;
    VisitBeside(surface, grid, sample, kReach, kBeside, [&](uint32_t v, float height, double alike, float plane) {
      if (alike >= facing) {
        AddToLayers(plane < height ? plane : height, layers + v);
      } else if (alike < 0) {
        AddToLayers(height, near_sides + v);
      }
    });
  });
  for (uint32_t v = 0; v < surface.count; ++v) surface.heights[v] = OutsideOf(layers[v], near_sides[v]);
}

void ComputeNormals(const float* positions, const uint16_t* faces, uint32_t face_count, uint32_t count,
                    float* normals) {
  kernels::NormalsJob job = {};
  job.positions = positions;
  job.position_stride_bytes = job.normal_stride_bytes = 3 * sizeof(float);
  job.triangles = faces;
  job.normals = normals;
  job.vertices = count;
  job.triangle_count = face_count;
  kernels::scalar::Normals(job);
}

// The joints that hold a vertex of body or garment.
struct Holds {
  const uint8_t* indices;
  const float* weights;
  const uint16_t* bones;  // of the garment: index -> joint; else null
  uint32_t influences;

  template <typename Visit>
  void operator()(size_t v, Visit visit) const {
    for (size_t k = v * influences; k < (v + 1) * influences; ++k)
      visit(bones != nullptr ? bones[indices[k]] : indices[k], weights[k]);
  }
};

void PlaceVertices(const float* bind, const Holds& holds, const float* places, const uint8_t* regions_of_joints,
                   const PlacedSurface& surface) {
  for (size_t v = 0; v < surface.count; ++v) {
    float out[3] = {}, weights[5] = {};
    const float* x = bind + 3 * v;
    holds(v, [&](size_t joint, float weight) {
      const float* f = places + 12 * joint;
      for (size_t r = 0; r < 3; ++r)
        out[r] += weight * (f[4 * r] * x[0] + f[4 * r + 1] * x[1] + f[4 * r + 2] * x[2] + f[4 * r + 3]);
      weights[regions_of_joints[joint]] += weight;
    });
    std::memcpy(surface.positions + 3 * v, out, sizeof(out));
    surface.regions[v] = kTrunkRegion;
    for (uint8_t r = 1; r < 5; ++r) {
      if (weights[r] > weights[surface.regions[v]]) surface.regions[v] = r;
    }
  }
}

// One step of averaging over a mesh's edges: sums [count] and counts [count] of the neighbours that `counts_as` allows.
template <typename Counts>
void SumNeighbours(const uint16_t* faces, size_t face_count, size_t count, const float* values, Counts counts_as,
                   float* sums, uint32_t* counts) {
  std::memset(sums, 0, count * sizeof(float));
  std::memset(counts, 0, count * sizeof(uint32_t));
  for (size_t f = 0; f < 3 * face_count; f += 3) {
    for (size_t k = 0; k < 3; ++k) {
      const size_t to = faces[f + k];
      for (size_t other = 1; other < 3; ++other) {
        const size_t from = faces[f + (k + other) % 3];
        if (!counts_as(from)) continue;
        sums[to] += values[from];
        ++counts[to];
      }
    }
  }
}

// How far each body vertex moves: to the skin beside it; where there is none, as its neighbours do.
void FindPushes(const format::BodyView& body, const BodyFitMemory& memory) {
  const size_t b = body.vertex_count;
  float* pushes = memory.pushes;
  for (size_t v = 0; v < b; ++v) pushes[v] = memory.body.heights[v];
  for (int step = 0; step < kFillSteps; ++step) {
    SumNeighbours(
        body.faces, body.face_count, b, pushes, [&](size_t v) { return pushes[v] > kNoHeight; }, memory.sums,
        memory.counts);
    for (size_t v = 0; v < b; ++v) {
      if (pushes[v] == kNoHeight && memory.counts[v] != 0)
        pushes[v] = memory.sums[v] / static_cast<float>(memory.counts[v]);
    }
  }
  for (size_t v = 0; v < b; ++v) {
    if (pushes[v] == kNoHeight) pushes[v] = 0;
  }
  for (int step = 0; step < kSmoothSteps; ++step) {
    SumNeighbours(
        body.faces, body.face_count, b, pushes, [](size_t) { return true; }, memory.sums, memory.counts);
    for (size_t v = 0; v < b; ++v) {
      if (memory.counts[v] != 0)
        pushes[v] = 0.5f * pushes[v] + 0.5f * memory.sums[v] / static_cast<float>(memory.counts[v]);
    }
  }
  // Skin never stands out of the surface that stands for it.
  for (size_t v = 0; v < b; ++v) {
    if (memory.body.heights[v] > pushes[v]) pushes[v] = memory.body.heights[v];
  }
}

// Where a vertex of the placed body is: left, up and forward of the hip joints' middle, up by the figure's trunk. False
// for arms.
bool PlaceInTrunk(const RigFit& fit, double scale, const BodyFitMemory& memory, size_t v, double (&at)[3]) {
  const Vector middle = fit.character_middle;
  const float* p = memory.body.positions + 3 * v;
  const double d[3] = {static_cast<double>(p[0]) - middle.x / scale, static_cast<double>(p[1]) - middle.y / scale,
                       static_cast<double>(p[2]) - middle.z / scale};
  for (int c = 0; c < 3; ++c)
    at[c] =
        fit.character_frame.m[0][c] * d[0] + fit.character_frame.m[1][c] * d[1] + fit.character_frame.m[2][c] * d[2];
  at[1] /= fit.trunk_ratio / scale;
  return memory.body.regions[v] == kTrunkRegion || memory.body.regions[v] >= kLeftLeg;
}

// Mean radius of a slice of the trunk after the push over before; 0 where the body has no such slice.
double GirthRatio(const RigFit& fit, double scale, const BodyFitMemory& memory, const double (&slice)[2]) {
  double sum[2] = {}, count = 0, radius = 0, push = 0, at[3];
  const auto within = [&](size_t v) {
    return PlaceInTrunk(fit, scale, memory, v, at) && at[1] >= slice[0] && at[1] <= slice[1];
  };
  for (size_t v = 0; v < memory.body.count; ++v) {
    if (!within(v)) continue;
    sum[0] += at[0], sum[1] += at[2], count += 1;
  }
  if (count < 8) return 0;
  for (size_t v = 0; v < memory.body.count; ++v) {
    if (!within(v)) continue;
    const double x = at[0] - sum[0] / count, z = at[2] - sum[1] / count;
    radius += std::sqrt(x * x + z * z);
    push += static_cast<double>(memory.pushes[v]);
  }
  return (radius + push) / radius;
}

// The regions of the character's joints: by their role, else by that of the joint with a role that is nearest.
void FindRegions(const dcloth_character& character, const RigFit& fit, uint8_t* regions) {
  for (uint32_t j = 0; j < character.joint_count; ++j) {
    const Affine bind = FromHost(fit.space, CharacterBind(character, j));
    double nearest = 1e300;
    regions[j] = kTrunkRegion;
    const auto consider = [&](const Vector& at, uint8_t region) {
      const double x = at.x - bind.m[0][3], y = at.y - bind.m[1][3], z = at.z - bind.m[2][3];
      const double squared = x * x + y * y + z * z;
      if (squared >= nearest) return;
      nearest = squared;
      regions[j] = region;
    };
    for (uint32_t role = 1; role < kRoleCount; ++role) {
      if (fit.character.joint[role] >= 0) consider(fit.character.at[role], RegionOf(role));
    }
    for (uint32_t i = 0; i < fit.character.trunk_count; ++i) consider(fit.character.trunk_at[i], kTrunkRegion);
  }
}

Holds GarmentHolds(const ModelView& model) {
  const format::StaticStageView& stage = model.static_stage;
  return {stage.influence_bones, stage.influence_weights, stage.bones, stage.influences};
}

Holds BodyHolds(const ModelView& model) {
  return {model.body.joints, model.body.weights, nullptr, model.body.influences};
}

void PlaceAll(const ModelView& model, const RigFit& fit, double scale, const BodyFitMemory& memory,
              uint8_t (&regions)[format::kMaxJoints]) {
  for (uint32_t j = 0; j < model.joint_count; ++j) {
    const PlacedJoint placed = PlaceJoint(model, fit, scale, j);
    StoreFloats(placed.place, memory.places + size_t{12} * j);
    regions[j] = memory.joint_regions[placed.host];
  }
}

// The body at `scale` in the character's bind pose, and how far each vertex is from its skin. `girth_alone`: only of
// vertices around those that GirthRatio reads, in less time.
void WrapBody(const ModelView& model, const dcloth_character& character, const RigFit& fit, double scale,
              bool girth_alone, const BodyFitMemory& memory) {
  uint8_t regions[format::kMaxJoints];
  PlaceAll(model, fit, scale, memory, regions);
  PlaceVertices(model.body.positions, BodyHolds(model), memory.places, regions, memory.body);
  ComputeNormals(memory.body.positions, model.body.faces, model.body.face_count, model.body.vertex_count,
                 memory.body.normals);
  Space space = fit.space;
  space.metres_per_unit /= scale;
  const auto wanted = [&](uint32_t v) {
    double at[3];
    return !girth_alone || (PlaceInTrunk(fit, scale, memory, v, at) && at[1] >= kHips[0] - kAroundSlices &&
                            at[1] <= kWaist[1] + kAroundSlices);
  };
  FindSkinOver(character, space, memory.joint_regions, memory.body, memory.cells, memory.layers, memory.near_sides,
               memory.work_left, wanted);
  FindPushes(model.body, memory);
}

// The model's joint that goes with each of the character's; kNoMover for fingers, twist bones and the like.
void FindMovers(const ModelView& model, const dcloth_character& character, const RigFit& fit, double scale,
                uint16_t* movers) {
  for (uint32_t h = 0; h < character.joint_count; ++h) movers[h] = kNoMover;
  for (uint32_t j = 0; j < model.joint_count; ++j) {
    const PlacedJoint placed = PlaceJoint(model, fit, scale, j);
    if (!placed.stands_in || movers[placed.host] == kNoMover) movers[placed.host] = static_cast<uint16_t>(j);
  }
}

// Solves m x = y; false where m flattens space.
bool Solve(const double (&m)[3][4], const double (&y)[3], double (&x)[3]) {
  const double b[3] = {y[0] - m[0][3], y[1] - m[1][3], y[2] - m[2][3]};
  double cofactors[3][3];
  for (size_t r = 0; r < 3; ++r) {
    const size_t r1 = (r + 1) % 3, r2 = (r + 2) % 3;
    for (size_t c = 0; c < 3; ++c) {
      const size_t c1 = (c + 1) % 3, c2 = (c + 2) % 3;
      cofactors[r][c] = m[r1][c1] * m[r2][c2] - m[r1][c2] * m[r2][c1];
    }
  }
  const double determinant = m[0][0] * cofactors[0][0] + m[0][1] * cofactors[0][1] + m[0][2] * cofactors[0][2];
  if (!(std::fabs(determinant) > 1e-3)) return false;
  for (size_t c = 0; c < 3; ++c)
    x[c] = (cofactors[0][c] * b[0] + cofactors[1][c] * b[1] + cofactors[2][c] * b[2]) / determinant;
  return true;
}

// The joints and weights of a point of the skin, the heaviest `influences` of them. False where joints that the model
// has not hold more than kMostUnheld of it.
bool HoldsOf(const dcloth_character& character, const SkinPoint& point, const uint16_t* movers, uint32_t influences,
             uint8_t* joints, float* weights) {
  float sums[format::kMaxJoints] = {};
  float unheld = 0, all = 0;
  for (size_t k = 0; k < 3; ++k) {
    for (uint32_t i = 0; i < character.body_influences; ++i) {
      const size_t at = size_t{point.corners[k]} * character.body_influences + i;
      const float weight = point.shares[k] * character.body_weights[at];
      const uint16_t mover = movers[character.body_joints[at]];
      all += weight;
      if (mover == kNoMover) {
        unheld += weight;
      } else {
        sums[mover] += weight;
      }
    }
  }
  if (!(all > 0) || !(unheld <= kMostUnheld * all)) return false;
  float kept = 0;
  for (uint32_t i = 0; i < influences; ++i) {
    size_t heaviest = 0;
    for (size_t j = 1; j < format::kMaxJoints; ++j) {
      if (sums[j] > sums[heaviest]) heaviest = j;
    }
    joints[i] = static_cast<uint8_t>(heaviest);
    weights[i] = sums[heaviest];
    kept += sums[heaviest];
    sums[heaviest] = 0;
  }
  if (!(kept > 0)) return false;
  for (uint32_t i = 0; i < influences; ++i) weights[i] /= kept;
  return true;
}

struct Beside {
  double squared;  // distance
  double turned;   // cosine between the normals
};

Beside BesideOf(const PlacedSurface& surface, uint32_t v, const Sample& sample) {
  const float *at = surface.positions + size_t{3} * v, *n = surface.normals + size_t{3} * v;
  Beside beside = {};
  for (size_t a = 0; a < 3; ++a) {
    const double d = sample.at[a] - static_cast<double>(at[a]);
    beside.squared += d * d;
    beside.turned += sample.normal[a] * static_cast<double>(n[a]);
  }
  return beside;
}

// How far a sample stands out of a face of the surface that it lies over and faces as it does; 0 where there is none.
double HeightOver(const PlacedSurface& surface, const uint16_t* face, const Sample& sample) {
  double corner[3][3], area[3], side[3], across[3], from[3];
  CornersOf(surface.positions, face, corner);
  AreaOf(corner[0], corner[1], corner[2], area);
  const double length = std::sqrt(Dot3(area, area));
  const bool faces = Dot3(sample.normal, sample.normal) > 0;
  if (!(length > 0) || (faces && Dot3(sample.normal, area) < kFacing * length)) return 0;
  for (size_t k = 0; k < 3; ++k) {
    for (size_t a = 0; a < 3; ++a) {
      side[a] = corner[(k + 1) % 3][a] - corner[k][a];
      from[a] = sample.at[a] - corner[k][a];
    }
    Cross(side, from, across);
    if (Dot3(across, area) < 0) return 0;
  }
  return Dot3(from, area) / length;  // from a corner, whichever
}

// For each vertex of the surface the skin nearest to it; and for each, in `rises` [b], how far skin stands out of a
// face around the vertex nearest to that skin: a hem or a pocket between vertices.
void FindSkin(const ModelView& model, const dcloth_character& character, const Space& space,
              const BodyFitMemory& memory, float* rises) {
  const format::BodyView& body = model.body;
  constexpr double kReachSquared = kSkinReach * kSkinReach;
  const Grid<1> grid(memory.body.positions, nullptr, body.vertex_count, memory.cells, memory.body.next,
                     memory.work_left, [](uint32_t) { return true; });
  for (size_t v = 0; v < body.vertex_count; ++v) memory.skin[v].squared = static_cast<float>(kReachSquared);
  std::memset(rises, 0, body.vertex_count * sizeof(float));
  SampleSkin(character, space, memory.joint_regions, memory.work_left, [&](const Sample& sample) {
    const double facing = Dot3(sample.normal, sample.normal) > 0 ? kFacing : -2;
    uint32_t best = UINT32_MAX;
    double least = kReachSquared;
    grid.VisitNear(sample.at, kSkinReach, [&](uint32_t v) {
      if (!Meet(sample.region, memory.body.regions[v])) return;
      const Beside beside = BesideOf(memory.body, v, sample);
      if (beside.turned < facing) return;
      if (beside.squared < least) least = beside.squared, best = v;
      SkinPoint* const nearest = memory.skin + v;
      if (beside.squared >= static_cast<double>(nearest->squared)) return;
      nearest->squared = static_cast<float>(beside.squared);
      for (size_t k = 0; k < 3; ++k) {
        nearest->corners[k] = sample.corners[k];
        nearest->shares[k] = static_cast<float>(sample.shares[k]);
      }
    });
    if (best == UINT32_MAX) return;
    for (uint32_t f = body.row_starts[best]; f < body.row_starts[best + 1]; ++f) {
      const uint16_t* face = body.faces + size_t{3} * body.columns[f];
      const auto rise = static_cast<float>(HeightOver(memory.body, face, sample) - kCovered);
      for (size_t k = 0; k < 3; ++k) rises[face[k]] = rise > rises[face[k]] ? rise : rises[face[k]];
    }
  });
}

// Heights, which FindPushes has read, are used up.
Tangle TangleOf(const format::BodyView& body, const BodyFitMemory& memory) {
  return {body.faces,    body.face_count,     body.vertex_count, memory.body.normals, memory.body.positions,
          memory.turned, memory.body.heights, memory.sums,       memory.counts};
}

// The surface that WrapBody has laid into the character's bind pose, pushed onto the skin and held as the skin is, or
// as the figure's where there is none beside it. Those vertices get kHeld; where joints flatten space, the place is
// left to the caller.
void HoldAsSkin(const ModelView& model, const dcloth_character& character, const RigFit& fit, double scale,
                const BodyFitMemory& memory) {
  const format::BodyView& body = model.body;
  FindMovers(model, character, fit, scale, memory.joint_movers);
  for (size_t i = 0; i < size_t{3} * body.vertex_count; ++i)
    memory.body.positions[i] += memory.pushes[i / 3] * memory.body.normals[i];
  Untangle(TangleOf(body, memory));
  Space space = fit.space;
  space.metres_per_unit /= scale;
  float* const rises = memory.sums;
  FindSkin(model, character, space, memory, rises);
  for (size_t i = 0; i < size_t{3} * body.vertex_count; ++i)
    memory.body.positions[i] += rises[i / 3] * memory.body.normals[i];
  for (size_t v = 0; v < body.vertex_count; ++v) memory.pushes[v] += rises[v];
  Untangle(TangleOf(body, memory));
  const uint32_t influences = body.influences;
  std::memcpy(memory.body_joints, body.joints, size_t{influences} * body.vertex_count);
  std::memcpy(memory.body_weights, body.weights, size_t{influences} * body.vertex_count * sizeof(float));
  for (size_t v = 0; v < body.vertex_count; ++v) {
    uint8_t joints[kernels::kMaxInfluences];
    float weights[kernels::kMaxInfluences];
    const bool beside = memory.skin[v].squared < static_cast<float>(kSkinReach * kSkinReach);
    if (!beside || !HoldsOf(character, memory.skin[v], memory.joint_movers, influences, joints, weights)) {
      std::memcpy(joints, body.joints + v * influences, influences);
      std::memcpy(weights, body.weights + v * influences, influences * sizeof(float));
    }
    double blended[3][4] = {}, at[3], bound[3];
    for (uint32_t i = 0; i < influences; ++i) {
      const float* place = memory.places + size_t{12} * joints[i];
      for (size_t e = 0; e < 12; ++e) blended[e / 4][e % 4] += static_cast<double>(weights[i] * place[e]);
    }
    for (size_t a = 0; a < 3; ++a) at[a] = static_cast<double>(memory.body.positions[3 * v + a]);
    if (!Solve(blended, at, bound)) continue;
    for (size_t a = 0; a < 3; ++a) memory.body_positions[3 * v + a] = static_cast<float>(bound[a]);
    std::memcpy(memory.body_joints + v * influences, joints, influences);
    std::memcpy(memory.body_weights + v * influences, weights, influences * sizeof(float));
    memory.skin[v].squared = kHeld;
  }
}

// Steps of averaging with the neighbours that blur the cloth's moves over kClothBlur: each adds a quarter of the
// squared edge to the variance along an axis.
int ClothSteps(const ModelView& model) {
  double squared = 0;
  for (size_t i = 0; i < size_t{3} * model.triangle_count; ++i) {
    const float* a = model.template_positions + size_t{3} * model.faces[i];
    const float* b = model.template_positions + size_t{3} * model.faces[i % 3 == 2 ? i - 2 : i + 1];
    for (size_t c = 0; c < 3; ++c)
      squared += (static_cast<double>(a[c]) - static_cast<double>(b[c])) *
                 (static_cast<double>(a[c]) - static_cast<double>(b[c]));
  }
  const double mean = squared / (3.0 * model.triangle_count), steps = 4 * kClothBlur * kClothBlur / mean;
  return steps < kMostClothSteps ? static_cast<int>(steps) + 1 : kMostClothSteps;
}

// Cloth follows the skin that it lies over: all the way on it, half at kFollows. `sums` and `counts` are used up.
void MoveGarment(const ModelView& model, const BodyFitMemory& memory) {
  const format::BodyView& body = model.body;
  const size_t n = model.vertex_count;
  // Where skin and cloth were at bind; normals of the body at bind are in body.normals, moves go into garment.normals.
  const Grid<1> grid(body.positions, nullptr, body.vertex_count, memory.cells, memory.body.next, memory.work_left,
                     [](uint32_t) { return true; });
  float* moves = memory.garment.normals;
  for (size_t g = 0; g < n; ++g) {
    const float* x = model.template_positions + 3 * g;
    const double at[3] = {static_cast<double>(x[0]), static_cast<double>(x[1]), static_cast<double>(x[2])};
    double nearest = 1e300;
    uint32_t best = UINT32_MAX;
    const auto consider = [&](uint32_t v) {
      if (!Meet(memory.garment.regions[g], memory.body.regions[v])) return;
      const float* p = body.positions + size_t{3} * v;
      double squared = 0;
      for (int a = 0; a < 3; ++a) squared += (static_cast<double>(p[a]) - at[a]) * (static_cast<double>(p[a]) - at[a]);
      if (squared < nearest) nearest = squared, best = v;
    };
    for (double reach = kCell; reach <= kClothSearch; reach *= 2) {
      grid.VisitNear(at, reach, consider);
      if (nearest <= reach * reach) break;
    }
    float move[3] = {};
    // The plane distance to the skin tells what lies on it; penetration is measured over those.
    memory.garment.heights[g] = 1;
    if (best != UINT32_MAX) {
      const float *p = body.positions + size_t{3} * best, *normal = memory.body.normals + size_t{3} * best;
      double height = 0;
      for (int a = 0; a < 3; ++a) height += (at[a] - static_cast<double>(p[a])) * static_cast<double>(normal[a]);
      memory.garment.heights[g] = static_cast<float>(height);
      const double follow = 1 / (1 + nearest / (kFollows * kFollows));
      for (int a = 0; a < 3; ++a) move[a] = static_cast<float>(follow) * memory.pushes[best] * normal[a];
    }
    std::memcpy(moves + 3 * g, move, sizeof(move));
  }
  // Moves of neighbours over different parts of the skin flow into each other.
  const int steps = ClothSteps(model);
  if (!Spend(uint64_t{18} * static_cast<uint64_t>(steps) * model.triangle_count, memory.work_left)) return;
  for (int step = 0; step < steps; ++step) {
    for (size_t a = 0; a < 3; ++a) {
      float* axis = memory.garment.positions;  // one component of all, then their sums
      for (size_t g = 0; g < n; ++g) axis[g] = moves[3 * g + a];
      SumNeighbours(
          model.faces, model.triangle_count, n, axis, [](size_t) { return true; }, memory.sums, memory.counts);
      for (size_t g = 0; g < n; ++g) {
        if (memory.counts[g] != 0)
          moves[3 * g + a] = 0.5f * axis[g] + 0.5f * memory.sums[g] / static_cast<float>(memory.counts[g]);
      }
    }
  }
  for (size_t i = 0; i < 3 * n; ++i) memory.template_positions[i] = model.template_positions[i] + moves[i];
}

// Distance of the garment as it was cut to the skin. `on_skin` [n] holds distances to the figure's skin in training.
void MeasureGarment(const ModelView& model, const dcloth_character& character, const RigFit& fit, double scale,
                    const BodyFitMemory& memory, dcloth_fit* report) {
  for (size_t g = 0; g < model.vertex_count; ++g) memory.sums[g] = memory.garment.heights[g];
  uint8_t regions[format::kMaxJoints];
  PlaceAll(model, fit, scale, memory, regions);
  PlaceVertices(memory.template_positions, GarmentHolds(model), memory.places, regions, memory.garment);
  ComputeNormals(memory.garment.positions, model.faces, model.triangle_count, model.vertex_count,
                 memory.garment.normals);
  Space space = fit.space;
  space.metres_per_unit /= scale;
  FindOutermost(character, space, memory.joint_regions, memory.garment, memory.cells, memory.work_left);
  double gap = 0, figure_gap = 0, on_skin = 0, near = 0, under = 0, deepest = 0;
  float nearest = 1;
  for (size_t g = 0; g < model.vertex_count; ++g) {
    if (memory.sums[g] < nearest) nearest = memory.sums[g] < 0 ? 0 : memory.sums[g];
  }
  for (size_t g = 0; g < model.vertex_count; ++g) {
    const auto height = static_cast<double>(memory.garment.heights[g]);
    if (memory.garment.heights[g] > kNoHeight) {
      near += 1;
      under += height > 0.001 / scale ? 1 : 0;
      deepest = height > deepest ? height : deepest;
    }
    if (memory.sums[g] > nearest + static_cast<float>(kOnSkin)) continue;
    on_skin += 1;
    figure_gap += memory.sums[g] < 0 ? 0 : static_cast<double>(memory.sums[g]);
    gap += memory.garment.heights[g] == kNoHeight ? kClothReach : height < 0 ? -height : 0;
  }
  report->gap_mm = on_skin != 0 ? static_cast<float>(1000 * scale * gap / on_skin) : 0;
  report->penetration_mm = static_cast<float>(1000 * scale * deepest);
  report->penetrating_share = near != 0 ? static_cast<float>(under / near) : 0;
  if (1000 * scale * (gap - figure_gap) > 15 * on_skin) report->warnings |= DCLOTH_FIT_GAP;
  if (report->penetration_mm > 5) report->warnings |= DCLOTH_FIT_PENETRATION;
}

PlacedSurface PlaceSurface(uint32_t count, uint32_t places, Arena* arena) {
  PlacedSurface surface = {};
  surface.count = count;
  surface.positions = arena->Take<float>(size_t{3} * count);
  surface.normals = arena->Take<float>(size_t{3} * count);
  surface.heights = arena->Take<float>(count);
  surface.regions = arena->Take<uint8_t>(count);
  surface.next = arena->Take<uint32_t>(size_t{places} * count);
  return surface;
}

}  // namespace

void Untangle(const Tangle& tangle) {
  for (int step = 0; step < kUntangleSteps; ++step) {
    std::memset(tangle.turned, 0, tangle.count);
    bool any = false;
    for (size_t f = 0; f < size_t{3} * tangle.face_count; f += 3) {
      const uint16_t* face = tangle.faces + f;
      double corner[3][3], area[3], facing[3] = {};
      CornersOf(tangle.positions, face, corner);
      AreaOf(corner[0], corner[1], corner[2], area);
      for (size_t i = 0; i < 9; ++i)
        facing[i % 3] += static_cast<double>(tangle.normals[size_t{3} * face[i / 3] + i % 3]);
      if (Dot3(area, facing) >= kTurned * std::sqrt(Dot3(area, area) * Dot3(facing, facing))) continue;
      for (size_t k = 0; k < 3; ++k) tangle.turned[face[k]] = 1;
      any = true;
    }
    if (!any) return;
    for (size_t a = 0; a < 3; ++a) {
      for (size_t v = 0; v < tangle.count; ++v) tangle.axis[v] = tangle.positions[3 * v + a];
      SumNeighbours(
          tangle.faces, tangle.face_count, tangle.count, tangle.axis, [](size_t) { return true; }, tangle.sums,
          tangle.counts);
      for (size_t v = 0; v < tangle.count; ++v) {
        if (tangle.turned[v] != 0) tangle.positions[3 * v + a] = tangle.sums[v] / static_cast<float>(tangle.counts[v]);
      }
    }
  }
}

BodyFitMemory PlaceBodyFit(const ModelView& model, uint32_t host_joint_count, Arena* arena) {
  const uint32_t n = model.vertex_count, b = model.body.vertex_count, larger = n > b ? n : b;
  BodyFitMemory memory = {};
  memory.template_positions = arena->Take<float>(size_t{3} * n);
  memory.body_positions = arena->Take<float>(size_t{3} * b);
  memory.body_joints = arena->Take<uint8_t>(size_t{model.body.influences} * b);
  memory.body_weights = arena->Take<float>(size_t{model.body.influences} * b);
  memory.joint_regions = arena->Take<uint8_t>(host_joint_count);
  memory.joint_movers = arena->Take<uint16_t>(host_joint_count);
  memory.turned = arena->Take<uint8_t>(b);
  memory.skin = arena->Take<SkinPoint>(b);
  memory.places = arena->Take<float>(size_t{12} * model.joint_count);
  memory.cells = arena->Take<uint32_t>(kCells);
  memory.garment = PlaceSurface(n, kGarmentPlaces, arena);
  memory.body = PlaceSurface(b, kBodyPlaces, arena);
  memory.layers = arena->Take<Layers>(b);
  memory.near_sides = arena->Take<Layers>(b);
  memory.pushes = arena->Take<float>(b);
  memory.sums = arena->Take<float>(larger);
  memory.counts = arena->Take<uint32_t>(larger);
  return memory;
}

bool CheckBody(const dcloth_character& character, Diagnostic* diagnostic) {
  const auto refuse = [&](const char* field, int64_t index, const char* found, const char* allowed, const char* mend) {
    const Path parent = {nullptr, "character"}, path = {&parent, field, index};
    return diagnostic->Fail(DCLOTH_ERROR_ARGUMENT, kNoOffset, &path, found, allowed, mend);
  };
  for (size_t i = 0; i < size_t{3} * character.body_vertex_count; ++i) {
    const float x = character.body_positions[i];
    if (!(x >= -kMaxPoseMagnitude && x <= kMaxPoseMagnitude))
      return refuse("body_positions", static_cast<int64_t>(i), "NaN or a number beyond 1e9", "finite numbers", "");
  }
  for (size_t i = 0; i < size_t{character.body_vertex_count} * character.body_influences; ++i) {
    if (character.body_joints[i] >= character.joint_count)
      return refuse("body_joints", static_cast<int64_t>(i), "a joint past the last one", "less than joint_count", "");
    const float weight = character.body_weights[i];
    if (!(weight >= 0 && weight <= kMaxPoseMagnitude))
      return refuse("body_weights", static_cast<int64_t>(i), "a weight below 0, NaN or infinity", "0 or more", "");
  }
  for (size_t i = 0; character.body_triangles != nullptr && i < size_t{3} * character.body_triangle_count; ++i) {
    if (character.body_triangles[i] >= character.body_vertex_count)
      return refuse("body_triangles", static_cast<int64_t>(i), "a vertex past the last one",
                    "less than body_vertex_count", "");
  }
  return true;
}

bool FitBody(const ModelView& model, const dcloth_character& character, const RigFit& fit, const BodyFitMemory& memory,
             double* scale, dcloth_fit* report) {
  FindRegions(character, fit, memory.joint_regions);
  if (model.body.vertex_count != 0) {
    WrapBody(model, character, fit, *scale, true, memory);
    const double waist = GirthRatio(fit, *scale, memory, kWaist);
    const double hips = GirthRatio(fit, *scale, memory, kHips);
    report->waist_ratio = static_cast<float>(waist);
    report->hips_ratio = static_cast<float>(hips);
    for (const double ratio : {waist, hips}) {
      if (ratio != 0 && (ratio < 0.8 || ratio > 1.25)) report->warnings |= DCLOTH_FIT_GIRTH;
    }
    // Half of the girth goes into the scale, which keeps the cut's look; the rest moves with the skin.
    const double girth = waist != 0 && hips != 0 ? 0.5 * (waist + hips) : waist != 0 ? waist : hips;
    if (girth != 0) {
      const double taken = 0.5 + 0.5 * girth;
      *scale *= taken < kLeastGirth ? kLeastGirth : taken > kMostGirth ? kMostGirth : taken;
      report->scale = static_cast<float>(*scale);
    }
    WrapBody(model, character, fit, *scale, false, memory);
    HoldAsSkin(model, character, fit, *scale, memory);
    // Regions of the garment, then the normals of the figure's skin at bind in place of the character's.
    uint8_t regions[format::kMaxJoints];
    PlaceAll(model, fit, *scale, memory, regions);
    PlaceVertices(model.template_positions, GarmentHolds(model), memory.places, regions, memory.garment);
    ComputeNormals(model.body.positions, model.body.faces, model.body.face_count, model.body.vertex_count,
                   memory.body.normals);
    MoveGarment(model, memory);
    for (size_t i = 0; i < size_t{3} * model.body.vertex_count; ++i) {
      if (memory.skin[i / 3].squared == kHeld) continue;
      memory.body_positions[i] = model.body.positions[i] + memory.pushes[i / 3] * memory.body.normals[i];
    }
  } else {
    std::memcpy(memory.template_positions, model.template_positions, size_t{3} * model.vertex_count * sizeof(float));
    for (size_t g = 0; g < model.vertex_count; ++g) memory.garment.heights[g] = 1;
  }
  MeasureGarment(model, character, fit, *scale, memory, report);
  return *memory.work_left != 0;
}

}  // namespace dcloth::fit

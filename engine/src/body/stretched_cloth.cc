#include "engine/src/body/stretched_cloth.h"

#include <cmath>
#include <cstring>

#include "engine/src/body/deep_cloth.h"

namespace dcloth::engine {
namespace {

using format::ModelView;

constexpr float kStretched = 1.6f;  // of an edge's length in the bind pose: what is longer was stretched
constexpr float kMost = 1.2f;       // of it; what is longer shortens to that
constexpr float kEase = 0.1f;       // of its own length, by which an edge shortens that is not longer
constexpr int kRings = 4;           // around stretched triangles, that give way
constexpr int kPasses = 12;
constexpr int kLift = 3;        // passes until all leaves the cores; so it does after the last
constexpr float kStep = 0.02f;  // metres, in a pass; who calls looks whether cloth came through a limb nevertheless
static_assert(kPasses % kLift == 0);

float SquaredBetween(const float* p, const float* q) {
  const float apart[3] = {p[0] - q[0], p[1] - q[1], p[2] - q[2]};
  return Dot(apart, apart);
}

// Of the edges from a triangle's corners to the next ones, squared: how long they are, and were in the bind pose, in
// host units.
struct Edges {
  float now[3], bound[3];
};

Edges EdgesOf(const ModelView& model, float scale, const uint16_t* face, const Surface& surface) {
  Edges edges;
  for (size_t k = 0; k < 3; ++k) {
    const size_t a = face[k], b = face[(k + 1) % 3];
    edges.now[k] = SquaredBetween(surface.PositionOf(a), surface.PositionOf(b));
    const float *bound_a = model.template_positions + 3 * a, *bound_b = model.template_positions + 3 * b;
    edges.bound[k] = SquaredBetween(bound_a, bound_b) * scale * scale;
  }
  return edges;
}

bool IsStretched(const Edges& edges) {
  bool stretched = false;
  for (size_t k = 0; k < 3; ++k) stretched |= edges.now[k] > kStretched * kStretched * edges.bound[k];
  return stretched;
}

// Shares of an edge by which its ends move together.
float PullOf(float squared, float squared_bound) {
  const float most = kMost * kMost * squared_bound;
  return squared > most ? 1 - std::sqrt(most / squared) : kEase;
}

// `sums` [found + 1, 4] of the listed vertices: of the pulls of their edges, and how many, each as often as triangles
// share it. The last row is of all vertices that stay.
void SumPulls(const ModelView& model, float scale, const SweptCloth& swept, size_t found, const uint32_t* triangles,
              size_t count, const Surface& surface, float* sums) {
  std::memset(sums, 0, sizeof(float) * 4 * (found + 1));
  for (size_t t = 0; t < count; ++t) {
    const uint16_t* face = model.faces + size_t{3} * triangles[t];
    const Edges edges = EdgesOf(model, scale, face, surface);
    size_t rows[3];
    float corners[3][3], pulls[3][3] = {};
    for (size_t k = 0; k < 3; ++k) {
      rows[k] = swept.places[face[k]] < found ? swept.places[face[k]] : found;
      std::memcpy(corners[k], surface.PositionOf(face[k]), sizeof corners[k]);
    }
    for (size_t k = 0; k < 3; ++k) {
      const size_t next = (k + 1) % 3;
      const float pull = PullOf(edges.now[k], edges.bound[k]);
      const float share = rows[k] == found || rows[next] == found ? pull : 0.5f * pull;
      for (size_t c = 0; c < 3; ++c) {
        const float step = share * (corners[next][c] - corners[k][c]);
        pulls[k][c] += step;
        pulls[next][c] -= step;
      }
    }
    for (size_t k = 0; k < 3; ++k) {
      float* sum = sums + 4 * rows[k];
      for (size_t c = 0; c < 3; ++c) sum[c] += pulls[k][c];
      sum[3] += 2;
    }
  }
}

// By the mean of the pulls, or `most`.
void Move(const float* sum, float most, float* position) {
  if (!(sum[3] > 0)) return;
  const float length = std::sqrt(Dot(sum, sum)) / sum[3], share = (length > most ? most / length : 1.0f) / sum[3];
  for (size_t c = 0; c < 3; ++c) position[c] += share * sum[c];
}

}  // namespace

size_t ListStretched(const ModelView& model, const LimbCores& limbs, uint8_t torn, const SweptCloth& swept,
                     const Surface& surface) {
  if (torn == 0) return 0;
  const size_t most = model.vertex_count < kMostDeep ? model.vertex_count : kMostDeep;
  size_t found = 0;
  for (size_t t = 0; t < model.triangle_count; ++t) {
    const uint16_t* face = model.faces + 3 * t;
    if (((swept.limbs[face[0]] | swept.limbs[face[1]] | swept.limbs[face[2]]) & torn) == 0) continue;
    if (!IsStretched(EdgesOf(model, limbs.cores[0].scale, face, surface))) continue;
    for (size_t k = 0; k < 3 && found < most; ++k) {
      const uint16_t v = face[k];
      if (swept.places[v] != kNotDeep || (swept.limbs[v] & torn) == 0) continue;
      found = List(swept, found, v, surface.PositionOf(v));
    }
  }
  for (int ring = 0; ring < kRings && found != 0; ++ring) {
    found = AddRing(model, swept.places, swept.vertices, found, [&](uint16_t v, size_t place) {
      if ((swept.limbs[v] & torn) == 0) return false;
      List(swept, place, v, surface.PositionOf(v));
      return true;
    });
  }
  return found;
}

void DrawTogether(const ModelView& model, const LimbCores& limbs, uint8_t torn, const SweptCloth& swept, size_t found,
                  const uint32_t* triangles, size_t count, float* sums, const Surface& surface) {
  const float scale = limbs.cores[0].scale;
  for (int pass = 0; pass < kPasses; ++pass) {
    SumPulls(model, scale, swept, found, triangles, count, surface, sums);
    for (size_t i = 0; i < found; ++i) Move(sums + 4 * i, kStep * scale, surface.PositionOf(swept.vertices[i]));
    if (pass % kLift != kLift - 1) continue;
    VisitLimbs(limbs, [&](const LimbCore&, uint32_t upper, uint8_t bit) {
      if ((torn & bit) == 0) return;
      for (uint32_t k = upper; k != kMostCores; k = limbs.cores[k].below) {
        for (size_t i = 0; i < found; ++i) {
          const uint16_t v = swept.vertices[i];
          if ((swept.limbs[v] & bit) != 0) LiftAcross(limbs.cores[k], surface.PositionOf(v));
        }
      }
    });
  }
}

}  // namespace dcloth::engine

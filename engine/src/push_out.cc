#include "engine/src/push_out.h"

namespace dcloth::engine {
namespace {

// A push may lead under another part of the body: in a fold, between two legs.
constexpr int kMaxPushes = 4;
constexpr double kShare[kMaxPushes] = {1, 1, 0.5, 0.25};  // of the clearance: a fold may be narrower than it
constexpr double kPushed = 0.99;  // of the clearance: rounded to floats, a vertex that was pushed stays put
// Clearances. A vertex that was pushed further may be under skin that the vertices near its first place know nothing of.
constexpr double kFarPush = 2;

double SquaredDistance(const double* a, const float* b) {
  double squared = 0;
  for (size_t c = 0; c < 3; ++c) {
    const double apart = a[c] - static_cast<double>(b[c]);
    squared += apart * apart;
  }
  return squared;
}

}  // namespace

void PushOut(const PosedBody& posed, const kernels::NearestJob& job, const TouchLists& lists, size_t i, double clearance,
             SearchBudget* budget, float* position) {
  const auto nearest = static_cast<uint32_t>(BodyVertexAt(*posed.body, lists, job.nearest[i]));
  const auto suspect = static_cast<uint32_t>(BodyVertexAt(*posed.body, lists, job.suspect[i]));
  const double far = kFarPush * clearance;
  double v[3] = {static_cast<double>(position[0]), static_cast<double>(position[1]), static_cast<double>(position[2])};
  bool moved = false;
  for (int push = 0; push < kMaxPushes && budget->faces != 0; ++push) {
    const bool whole = moved && budget->whole_searches != 0 && SquaredDistance(v, position) > far * far;
    if (whole) --budget->whole_searches;
    const ClosestPoint closest =
        whole ? SearchWholeBody(posed, job, lists, suspect, v) : SearchBody(posed, suspect, nearest, v);
    budget->faces -= closest.faces_seen < budget->faces ? closest.faces_seen : budget->faces;
    const double height = kShare[push] * clearance;
    if (!closest.found || closest.distance >= kPushed * height || EndsAt(posed, closest)) break;
    for (size_t c = 0; c < 3; ++c) v[c] = closest.point[c] + height * closest.direction[c];
    moved = true;
  }
  if (!moved) return;
  for (size_t c = 0; c < 3; ++c) position[c] = static_cast<float>(v[c]);
}

}  // namespace dcloth::engine

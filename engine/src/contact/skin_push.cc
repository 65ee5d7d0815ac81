// Pushes cloth that is under the skin out of it.
#include "engine/src/contact/skin_search.h"
#include "engine/src/contact/steps.h"

namespace dcloth::engine {
namespace {

using format::ModelView;

// A push may lead under another part of the body, in a fold or between two legs. A fold may be narrower than the
// clearance, so later pushes are shorter.
constexpr float kShares[] = {1, 1, 0.5f, 0.25f};  // of the clearance
constexpr float kPushed = 0.99f;  // of the height: rounded to floats, a vertex that was pushed stays put

// Of an edge near the skin: a shorter one is not looked at; skin shows where its middle is lower; where it is deeper
// than the last, a limb lies between its ends.
constexpr float kLongEdge = 4, kShown = 0.5f, kMostLift = 5;  // clearances

// What the searches of a frame may take, so that no pose and no model makes it endless: looks for vertices near the
// skin (NearestJob::looks), and faces around those. A vertex that comes after stays where it is.
struct SearchBudget {
  explicit SearchBudget(uint32_t vertices) {
    constexpr uint32_t kLooks = 24, kFaces = 16, kLeastLooks = 1 << 18, kLeastFaces = 1 << 16;  // a vertex; in all
    looks = kLooks * vertices > kLeastLooks ? kLooks * vertices : kLeastLooks;
    faces = kFaces * vertices > kLeastFaces ? kFaces * vertices : kLeastFaces;
  }
  uint32_t looks, faces;
};

ClosestSkin Find(const PosedSkin& skin, uint16_t first, uint16_t second, Vecf place, SearchBudget* budget) {
  const ClosestSkin closest = FindClosestSkin(skin, first, second, place);
  budget->faces -= closest.faces_seen < budget->faces ? closest.faces_seen : budget->faces;
  return closest;
}

// Whether a place is the clearance over the plane of a vertex of the skin beside it.
bool IsOver(const PosedSkin& skin, uint16_t vertex, Vecf place) {
  const Vecf from = place - VecfAt(skin.positions + size_t{3} * vertex);
  return Dot(from, VecfAt(skin.normals + size_t{3} * vertex)) > skin.body->clearance;
}

// Returns a corner of the skin's face that the vertex is over, or kNotNear.
uint16_t PushOut(const PosedSkin& skin, uint16_t suspect, uint16_t nearest, Vecf* place, SearchBudget* budget) {
  uint16_t beside = kNotNear;
  for (const float share : kShares) {
    if (budget->faces == 0) break;
    const ClosestSkin closest = Find(skin, suspect, nearest, *place, budget);
    if (!closest.found || closest.on_rim) break;
    beside = closest.vertex;
    const float height = share * skin.body->clearance;
    if (closest.height >= kPushed * height) break;
    *place = *place + (height - closest.height) * closest.outward;
  }
  return beside;
}

// Where an edge cuts a corner of the body, its ends that are near the skin go further out.
void CoverEdge(const ModelView& model, PosedSkin skin, const ContactMemory& memory, size_t near, size_t other,
               SearchBudget* budget) {
  const float clearance = model.body.clearance;
  const Vecf along = memory.places[other] - memory.places[near];
  if (Dot(along, along) < kLongEdge * kLongEdge * clearance * clearance) return;
  const bool both = memory.skin[other] != kNotNear;
  const uint16_t first = memory.skin[near], last = memory.skin[both ? other : near];
  const Vecf middle = 0.5f * (memory.places[near] + memory.places[other]);
  if (IsOver(skin, first, middle)) return;
  const uint8_t* classes = model.body.touch_classes;
  skin.touch_bit = static_cast<uint8_t>(classes == nullptr ? 0u : 1u << classes[near]);
  const ClosestSkin closest = Find(skin, first, last, middle, budget);
  const float lift = kShown * clearance - closest.height;
  if (!closest.found || closest.on_rim || !(lift > 0) || lift > kMostLift * clearance) return;
  memory.places[near] = memory.places[near] + lift * closest.outward;
  if (both) memory.places[other] = memory.places[other] + lift * closest.outward;
}

}  // namespace

void PushOutOfSkin(const kernels::KernelTable& kernels, const ModelView& model, const ContactMemory& memory) {
  PosedSkin skin = {&model.body, memory.positions, memory.normals, 0};
  for (size_t v = 0; v < model.vertex_count; ++v) memory.skin[v] = kNotNear;
  kernels::NearestJob job = {};
  uint16_t nearest[kernels::kNearestPatch], suspect[kernels::kNearestPatch];
  uint32_t looks = 0;
  SearchBudget budget(model.vertex_count);
  job.points = &memory.places[0].x;
  job.point_stride_bytes = sizeof(Vecf);
  job.reach = model.body.reach;
  job.clearance = model.body.clearance;
  job.nearest = nearest;
  job.suspect = suspect;
  job.looks = &looks;
  for (size_t c = 0; c < ClassCount(model); ++c) {
    const TouchClass touch = ClassAt(model, memory.touch, c);
    if (touch.vertex_count == 0 || touch.group_count == 0) continue;
    UseSites(touch, memory.sites, &job);
    skin.touch_bit = touch.bit;
    for (size_t begin = 0; begin < touch.vertex_count && looks < budget.looks; begin += job.points_count) {
      job.order = touch.vertices + begin;
      const size_t left = touch.vertex_count - begin;
      job.points_count = left < kernels::kNearestPatch ? left : kernels::kNearestPatch;
      kernels.nearest(job);
      for (size_t i = 0; i < job.points_count; ++i) {
        if (suspect[i] == kernels::kNoSite) continue;
        memory.skin[job.order[i]] =
            PushOut(skin, static_cast<uint16_t>(BodyVertexAt(model.body, memory.touch, suspect[i])),
                    static_cast<uint16_t>(BodyVertexAt(model.body, memory.touch, nearest[i])),
                    memory.places + job.order[i], &budget);
      }
    }
  }
  for (size_t v = 0; v < model.vertex_count; ++v) {
    if (memory.skin[v] == kNotNear) continue;
    for (uint32_t j = memory.beside_starts[v]; j < memory.beside_starts[v + 1] && budget.faces != 0; ++j) {
      const size_t u = memory.beside[j];
      if (u > v && memory.skin[u] != kNotNear) continue;
      CoverEdge(model, skin, memory, v, u, &budget);
    }
  }
}

}  // namespace dcloth::engine

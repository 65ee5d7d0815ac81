// Keeps the drawn garment out of the body (NETWORK.md, "Contact").
//
// What the network draws is a target. The engine keeps how far each vertex was from its own, because a frame that knows
// nothing of the last one cannot know on which side of a limb cloth belongs. One pass: cloth is carried along, kept on
// its side of the limbs, its neighbours follow, and what is still under the skin is pushed out.
#ifndef DCLOTH_ENGINE_SRC_CONTACT_CONTACT_H_
#define DCLOTH_ENGINE_SRC_CONTACT_CONTACT_H_

#include <cstddef>
#include <cstdint>

#include "engine/src/base/lent_memory.h"
#include "engine/src/base/stopwatch.h"
#include "engine/src/contact/body_sites.h"
#include "engine/src/contact/limb_cores.h"
#include "engine/src/contact/touch_lists.h"
#include "engine/src/draw/output.h"
#include "engine/src/pose/pose.h"
#include "kernels/kernels.h"

namespace dcloth::engine {

constexpr size_t kMostActive = 1500;  // vertices that may be off their targets
constexpr size_t kMostTouches = 2 * kMostActive;

// A vertex beside a core, in the frame of its bone: where it was last outside.
struct Touch {
  Vecf place;
  uint16_t vertex;
  uint8_t core;
};

enum class Hold : uint8_t { kFree, kMet, kHeld, kFixed };

constexpr size_t kPatch = 16;  // vertices that follow each other in the search order are looked at together

constexpr float kBeside = 0.06f;  // metres around a core: cloth that gives way comes no further

// Cores, bit by bit, that a patch may meet on its way from the last frame, and that cloth that gives way may meet.
struct NearCores {
  uint32_t met, beside;
};

// Between frames. Lengths are in steps of kKeptStep, so that a saved state is small and exact.
struct KeptPlaces {
  int16_t* places;   // [n, 3] where each vertex was drawn, from the hips
  int16_t* offsets;  // [n, 3] from its target
};
constexpr float kKeptStep = 1.0f / 16384;
inline Vecf FromKept(const int16_t* steps) {
  return {kKeptStep * steps[0], kKeptStep * steps[1], kKeptStep * steps[2]};
}

// All null where the model has no body.
struct ContactMemory {
  // Once for each garment or body.
  LimbCores limbs;
  TouchLists touch;
  uint32_t* beside_starts;  // [n + 1] into `beside`
  uint16_t* beside;         // [2 edges] neighbours of each vertex on the mesh
  float* mean_edge;         // [1] metres, of the mesh when bound
  uint16_t* patches;        // [n] which run of the search order each vertex lies in
  uint8_t* fixed;           // [n] 1: lies on the trunk in the bind pose and stays where it is drawn
  // Kept from frame to frame.
  KeptPlaces kept;
  float* hips;  // [9] the hips' rotation in the last frame
  // Scratch of a frame.
  float* matrices;   // [joint_count, 12]
  float* positions;  // [b, 3] posed skin
  float* normals;    // [b, 3]
  BodySites sites;
  Vecf* places;      // [n]
  Vecf* offsets;     // [n]
  uint32_t* close;   // [n] cores that go through the cloth there, bit by bit
  Hold* holds;       // [n]
  uint8_t* active;   // [n]
  uint8_t* rings;    // [n] of neighbours that each vertex takes along
  uint16_t* sorted;  // [n] vertices, those with most rings first
  uint16_t* list;    // [n] the active ones, nearest to where cloth was moved first
  NearCores* near;   // [patches]
  Touch* touches;    // [kMostTouches]
  uint16_t* skin;    // [n] the body vertex beside each, or kNotNear
};

// What is kept beside the arrays.
struct ContactClock {
  static constexpr float kMost = 1;

  bool started;   // there is a last frame
  float seconds;  // since it was drawn, at most kMost

  void Pass(float more) { seconds = seconds + more < kMost ? seconds + more : kMost; }
};

ContactMemory PlaceContactMemory(const format::ModelView& model, Arena* arena);

// Once for each garment, after PlaceContactMemory, and for each body that it is fitted to.
void PrepareContact(const kernels::KernelTable& kernels, const format::ModelView& model, const ContactMemory& memory);

// Moves the vertices of `surface`, which are relative to the hips, out of the body. A frame after no time changes
// nothing that is kept. Does nothing where the model has no body.
void KeepOutside(const kernels::KernelTable& kernels, const format::ModelView& model, const Space& space,
                 const SkinPose& skin, const ContactMemory& memory, ContactClock* clock, const Surface& surface,
                 Stopwatch* watch);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_CONTACT_CONTACT_H_

// What the search for the nearest body vertices reads of a posed body (kernels::NearestJob): sites and boxes.
#ifndef DCLOTH_ENGINE_SRC_CONTACT_BODY_SITES_H_
#define DCLOTH_ENGINE_SRC_CONTACT_BODY_SITES_H_

#include "engine/src/base/lent_memory.h"
#include "engine/src/contact/touch_lists.h"
#include "kernels/kernels.h"

namespace dcloth::engine {

struct BodySites {
  float* offsets;       // [b] of planes that lie over all faces around a vertex by the clearance
  float* slacks;        // [b] squared, see PlaceFaces
  float* sites;         // of all groups, as kernels::NearestJob wants them
  float* bounds;        // of all groups
  float* class_bounds;  // of the groups of a class; null without classes
  size_t groups;
};

// The model has a body.
BodySites PlaceBodySites(const format::BodyView& body, Arena* arena);

// Of a posed body, once a frame: positions and normals are [b, 3].
void FillBodySites(const format::BodyView& body, const TouchLists& lists, const float* positions, const float* normals,
                   float clearance, const BodySites& sites);

// Gives `job` the sites that a class touches, at least one. One class at a time.
void UseSites(const TouchClass& touch, const BodySites& sites, kernels::NearestJob* job);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_CONTACT_BODY_SITES_H_

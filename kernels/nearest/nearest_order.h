// The orders in which the search for nearest body vertices wants its points and sites: neighbours together. Made once
// for a model, by the converter or, for a file before format 1.5, when a cloth is created.
#ifndef DCLOTH_KERNELS_NEAREST_NEAREST_ORDER_H_
#define DCLOTH_KERNELS_NEAREST_NEAREST_ORDER_H_

#include <cstddef>
#include <cstdint>

#include "kernels/nearest/nearest.h"

namespace dcloth::kernels {

// Orders `vertices`, which index `positions`, so that each run of kNearestPatch of them lies close together, and so
// does each half, quarter, ... of a run down to 4. Positions are any floats, NaN too; count is at most 65536. Halves
// along the longest side; a half is found bit by bit, so that time is bounded whatever the positions: 60 count
// log2(count / 4) steps, in practice a millisecond for 8,000 vertices.
void OrderByPlace(const float* positions, uint16_t* vertices, size_t count);

// All vertices of a garment, `positions` [count, 3], into `order` [count]: by class, of kTouchClasses, and within a
// class by place. Null `classes`: one class.
constexpr size_t kTouchClasses = 8;
void OrderPoints(const float* positions, const uint8_t* classes, size_t count, uint16_t* order);

// Groups of kNearestGroup that `count` body vertices fill whose `touched_by` is the same; none for those with 0.
size_t CountSiteGroups(const uint8_t* touched_by, size_t count);

// Those groups into `sites` [groups, kNearestGroup]: by rising touched_by, within one by place; a last group is filled
// up with its last vertex.
void OrderSites(const float* positions, const uint8_t* touched_by, size_t count, uint16_t* sites);

}  // namespace dcloth::kernels

#endif  // DCLOTH_KERNELS_NEAREST_NEAREST_ORDER_H_

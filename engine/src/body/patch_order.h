// Vertices in an order in which neighbours come together.
#ifndef DCLOTH_ENGINE_SRC_BODY_PATCH_ORDER_H_
#define DCLOTH_ENGINE_SRC_BODY_PATCH_ORDER_H_

#include <cstddef>
#include <cstdint>

namespace dcloth::engine {

// Orders `vertices`, which index `positions`, so that each run of kernels::kNearestPatch of them lies close together,
// and so does each half, quarter, ... of a run down to 4. Positions are any floats, NaN too; count is at most 65536.
// Halves along the longest side; a half is found bit by bit, so that time is bounded whatever the positions: 60 count
// log2(count / 4) steps, in practice a millisecond for 8,000 vertices.
void OrderByPlace(const float* positions, uint16_t* vertices, size_t count);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_BODY_PATCH_ORDER_H_

// Cloth that was put on a limb anew is drawn together where that stretched it (NETWORK.md, "Limbs through cloth").
#ifndef DCLOTH_ENGINE_SRC_BODY_STRETCHED_CLOTH_H_
#define DCLOTH_ENGINE_SRC_BODY_STRETCHED_CLOTH_H_

#include <cstddef>
#include <cstdint>

#include "engine/src/body/swept_limbs.h"

namespace dcloth::engine {

// Lists the corners of triangles with an edge longer by 0.6 than in the bind pose, and cloth around them, of what lies
// over the limbs `torn`, a bit of VisitLimbs each. Nothing is listed before. Returns how many vertices that are, at
// most kMostDeep. `limbs` are posed. Cost for 16,000 triangles: 0.7 ms.
size_t ListStretched(const format::ModelView& model, const LimbCores& limbs, uint8_t torn, const SweptCloth& swept,
                     const Surface& surface);

// Edges of the `triangles` shorten until they are longer by 0.2 than in the bind pose; others a little, so that cloth
// evens out. The `found` vertices of the list move, and stay out of the cores of the limbs `torn`; all others stay.
// `sums` [found + 1, 4] is scratch. Cost: 1.5 us a vertex.
void DrawTogether(const format::ModelView& model, const LimbCores& limbs, uint8_t torn, const SweptCloth& swept,
                  size_t found, const uint32_t* triangles, size_t count, float* sums, const Surface& surface);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_BODY_STRETCHED_CLOTH_H_

// Cloth that cuts a corner of the body: its vertices lie outside, the middle between them does not. A bent knee shows
// through the long triangles of cloth that was pushed out over it.
#ifndef DCLOTH_ENGINE_SRC_BODY_CUT_CORNERS_H_
#define DCLOTH_ENGINE_SRC_BODY_CUT_CORNERS_H_

#include <cstdint>

#include "engine/format/view.h"
#include "engine/src/body/body_search.h"
#include "engine/src/draw/output.h"

namespace dcloth::engine {

// Lifts edges and triangles whose middle is under the skin, until it is `clearance` above. They are looked at where the
// skin beside their ends bends so much over their length that it may reach them. Where two limbs press on cloth from
// both sides, it stays as deep as it lies, but for a quarter of the clearance; between limbs that are no neighbours,
// such as a heel and the other thigh, so does the cloth around it.
//   posed    which body; the touch bit of each vertex is taken in place of its own
//   normals  [b, 3] of the posed body
//   beside   [n] a body vertex beside the closest point of each vertex near the skin; kNotNear for those that stay
//   at_edge  [n] not 0 for vertices at a hem, a slit or a waist
//   pressed  [n] scratch
//   faces    what is left of the frame's searches
void CoverCorners(const format::ModelView& model, PosedBody posed, const float* normals, const uint16_t* beside,
                  double clearance, const uint8_t* at_edge, uint16_t* pressed, const Surface& surface, uint32_t* faces);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_BODY_CUT_CORNERS_H_

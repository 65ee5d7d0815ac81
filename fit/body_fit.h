// A garment's cut and the surface that it is kept out of, moved onto another body.
//
// The character's skin is sampled. Each vertex of the figure's body, laid into the character's bind pose, moves along
// its normal to the nearest skin that faces as it does, and through layers that lie close over that; cloth moves with
// the skin below it, less the further away it is.
// The surface is then held as that skin is: its joints and weights are taken over, so that it bends with the character.
// Rejected: the outermost sample. On the figure's own skin that took toes to the far side of the next toe and the
// crotch through a buttock, by up to 103 mm. Rejected: the character's own triangles as the surface of the push-out,
// whose number has no bound and whose parts no class of the garment is known for.
#ifndef DCLOTH_FIT_BODY_FIT_H_
#define DCLOTH_FIT_BODY_FIT_H_

#include "engine/format/diagnostic.h"
#include "engine/src/base/lent_memory.h"
#include "fit/rig_fit.h"

namespace dcloth::fit {

using engine::Arena;

// Skin over a vertex of the surface, along its normal: [low, high] of up to kMostLayers, which lie apart. An empty one
// has low above high.
constexpr size_t kMostLayers = 4;
struct Layers {
  float low[kMostLayers], high[kMostLayers];
};

// Vertices of a surface in the character's bind pose, in the figure's metres.
struct PlacedSurface {
  float* positions;  // [count, 3]
  float* normals;    // [count, 3]
  float* heights;    // [count] of skin beside the vertex over it, along the normal; kNoHeight where there is none
  uint8_t* regions;  // [count]
  uint32_t* next;    // [places of all vertices] of the same cell
  uint32_t count;
};

// The skin nearest to a vertex of the surface: corners of a triangle of the character's and the share of each.
struct SkinPoint {
  uint32_t corners[3];
  float shares[3];
  float squared;  // distance
};

struct BodyFitMemory {
  uint64_t* work_left;  // of the caller's kFitWork
  // What takes the place of the model's own.
  float* template_positions;  // [n, 3]
  float* body_positions;      // [b, 3]
  uint8_t* body_joints;       // [b, influences]
  float* body_weights;        // [b, influences]
  // Scratch of the fit.
  uint8_t* joint_regions;  // [host joints]
  uint16_t* joint_movers;  // [host joints], the model's joint that goes with each; kNoMover
  uint8_t* turned;         // [b] 1: of a face that turned over
  SkinPoint* skin;         // [b]
  float* places;           // [joint_count, 12] F
  uint32_t* cells;         // heads of lists
  PlacedSurface garment, body;
  Layers* layers;      // [b] of skin that faces as the vertex does
  Layers* near_sides;  // [b] of skin that faces the vertex
  float* pushes;       // [b]
  float* sums;         // [larger of n and b]
  uint32_t* counts;    // [larger of n and b]
};

BodyFitMemory PlaceBodyFit(const format::ModelView& model, uint32_t host_joint_count, Arena* arena);

// A closed surface and the memory to smooth it with.
struct Tangle {
  const uint16_t* faces;  // [face_count, 3]
  uint32_t face_count, count;
  const float* normals;  // [count, 3] of the vertices before they were moved
  float* positions;      // [count, 3]
  uint8_t* turned;       // [count] scratch, as all that follows
  float *axis, *sums;    // [count]
  uint32_t* counts;      // [count]
};

// Lays vertices among their neighbours wherever a face has turned away from where its vertices faced: in groins and
// between buttocks, where normals meet, vertices that move along them cross, and cloth would be laid over the folds.
void Untangle(const Tangle& tangle);

// Numbers, indices and weights of the character's body.
bool CheckBody(const dcloth_character& character, format::Diagnostic* diagnostic);

// Fills memory's first arrays, `scale` and the report's fields that a body decides. False where *memory.work_left,
// which it counts down, reaches 0. Cost: some nanoseconds for each.
bool FitBody(const format::ModelView& model, const dcloth_character& character, const RigFit& fit,
             const BodyFitMemory& memory, double* scale, dcloth_fit* report);

}  // namespace dcloth::fit

#endif  // DCLOTH_FIT_BODY_FIT_H_

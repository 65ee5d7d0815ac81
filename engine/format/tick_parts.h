// The parts of a tick, in the order in which they run. This list is the only one: the engine's schedule
// (engine/src/network/schedule.cc), saved states, timers, the profiler and the converter's count of work are made from
// it. A part without a row in the schedule, or without a count of its work, does not compile.
#ifndef DCLOTH_ENGINE_FORMAT_TICK_PARTS_H_
#define DCLOTH_ENGINE_FORMAT_TICK_PARTS_H_

#include <cstddef>
#include <cstdint>

#include "dcloth/dcloth.h"

// X(Part, number, name, step)
//   Part    TickPart::k<Part>, and what functions and rows of the part are called
//   number  of the part in a saved state: never changed, never given to another part; 10 means that no tick is begun
//   name    in profiles
//   step    the DCLOTH_STEP_* to which a timer adds the part's time
#define DCLOTH_TICK_PARTS(X)                                    \
  X(Static, 0, "static", DCLOTH_STEP_STATIC)                    \
  X(SkeletonInput, 1, "skeleton input", DCLOTH_STEP_SKELETON)   \
  X(SkeletonHidden, 2, "skeleton hidden", DCLOTH_STEP_SKELETON) \
  X(SkeletonGates, 3, "skeleton gates", DCLOTH_STEP_SKELETON)   \
  X(BodyPoints, 4, "body points", DCLOTH_STEP_MESH)             \
  X(MeshLayers, 5, "mesh layers", DCLOTH_STEP_MESH)             \
  X(MeshHidden, 6, "mesh hidden", DCLOTH_STEP_MESH)             \
  X(MeshCoefficients, 7, "mesh coefficients", DCLOTH_STEP_MESH) \
  X(Head, 8, "head", DCLOTH_STEP_DISPLACEMENT)                  \
  X(Basis, 9, "basis", DCLOTH_STEP_DISPLACEMENT)                \
  X(PatchInputs, 11, "patch inputs", DCLOTH_STEP_MESH)          \
  X(PatchLayers, 12, "patch layers", DCLOTH_STEP_MESH)          \
  X(PatchMap, 13, "patch map", DCLOTH_STEP_DISPLACEMENT)

namespace dcloth::format {

#define DCLOTH_PART(part, number, name, step) k##part,
enum class TickPart : uint32_t { DCLOTH_TICK_PARTS(DCLOTH_PART) kDone };
#undef DCLOTH_PART

constexpr size_t kTickPartCount = static_cast<size_t>(TickPart::kDone);

struct TickPartFacts {
  uint32_t number;
  const char* name;
  int step;
};

// Of every part, and of kDone.
#define DCLOTH_PART(part, number, name, step) {number, name, step},
constexpr TickPartFacts kTickParts[] = {DCLOTH_TICK_PARTS(DCLOTH_PART){10, "done", DCLOTH_STEP_COUNT}};
#undef DCLOTH_PART

constexpr const TickPartFacts& FactsOf(TickPart part) { return kTickParts[static_cast<size_t>(part)]; }

// The part with this number in a saved state; false where none has it.
constexpr bool FindTickPart(uint32_t number, TickPart* part) {
  for (size_t p = 0; p <= kTickPartCount; ++p) {
    if (kTickParts[p].number != number) continue;
    *part = static_cast<TickPart>(p);
    return true;
  }
  return false;
}

}  // namespace dcloth::format

#endif  // DCLOTH_ENGINE_FORMAT_TICK_PARTS_H_

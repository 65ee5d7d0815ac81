#include "engine/src/frame.h"

#include "engine/src/base/arithmetic.h"
#include "engine/src/draw/normals.h"
#include "engine/src/draw/skinning.h"

namespace dcloth::engine {

using format::ModelView;

void DrawFrame(Cloth* cloth, const SkinPose& skin, double behind, const dcloth_output& output, Stopwatch* watch) {
  const ModelView& model = *cloth->model;
  const kernels::KernelTable& kernels = ActiveKernels();
  const uint32_t whole = behind < 1 ? 0 : 1;
  const uint32_t from = SlotBefore(*cloth, whole + 1), to = SlotBefore(*cloth, whole);
  const TickPair ticks = {{cloth->increments[from], cloth->increments[to]},
                          {cloth->displacement[from], cloth->displacement[to]},
                          static_cast<float>(1 - (behind - whole))};
  const Space& space = cloth->rig.space;
  const DrawnMesh mesh = MeshOf(model, output);
  const Surface surface = SurfaceOf(output);
  SkinRelative(kernels, model, space, skin, ticks, cloth->matrices, mesh, surface);
  watch->Lap(DCLOTH_STEP_SKINNING, "skinning");
  if ((output.flags & DCLOTH_OUTPUT_OUTSIDE_BODY) != 0) {
    KeepOutside(kernels, model, space, skin, cloth->contact, &cloth->contact_clock, surface, watch);
    watch->Lap(DCLOTH_STEP_PENETRATION, "contact");
    if (cloth->tick_count == 0) cloth->contact_clock = {};  // what was drawn before the first tick is no motion
  }
  RunNormals(kernels, mesh, surface);
  RepeatSeams(model, output, surface);
  RunTangents(kernels, TexturedMeshOf(model, output, mesh), space.mirrored, model.texture.coordinates, output, surface);
  watch->Lap(DCLOTH_STEP_NORMALS, "normals");
  // To the host's floats and back is exact but for the unit, whose error a float does not see.
  float origin[3];
  for (int i = 0; i < 3; ++i)
    origin[space.axis[i]] = static_cast<float>(space.sign[i] * skin.origin[i] / space.metres_per_unit);
  FinishOutput(kernels, origin, space.mirrored, surface, output);
  watch->Lap(DCLOTH_STEP_SKINNING, "skinning");
}

}  // namespace dcloth::engine

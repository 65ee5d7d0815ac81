#include "converter/stages.h"

#include <string>

#include "converter/error.h"
#include "dcloth/dcloth.h"

namespace dcloth::converter {

uint32_t StagesOf(const Bundle& bundle) {
  return bundle.mesh || bundle.patches ? DCLOTH_STAGES_MESH
         : bundle.skeleton             ? DCLOTH_STAGES_SKELETON
                                       : DCLOTH_STAGES_STATIC;
}

const char* StagesName(uint32_t stages) {
  return stages == DCLOTH_STAGES_MESH ? "mesh" : stages == DCLOTH_STAGES_SKELETON ? "skeleton" : "static";
}

uint32_t ParseStages(const std::string& name) {
  for (uint32_t stages : {DCLOTH_STAGES_STATIC, DCLOTH_STAGES_SKELETON, DCLOTH_STAGES_MESH}) {
    if (name == StagesName(stages)) return stages;
  }
  throw Error({"", "", "stages '" + name + "'", "static, skeleton or mesh", ""});
}

Bundle KeepStages(const Bundle& bundle, uint32_t stages) {
  const uint32_t all = StagesOf(bundle);
  if (stages > all) {
    throw Error({bundle.path, "", std::string("stages '") + StagesName(stages) + "'",
                 std::string("at most '") + StagesName(all) + "', the last stage in the bundle",
                 "choose an earlier stage with --stages, or train this one"});
  }
  Bundle kept = bundle;
  if (stages < DCLOTH_STAGES_MESH) kept.mesh.reset();
  if (stages < DCLOTH_STAGES_SKELETON) {
    kept.skeleton.reset();
    kept.patches.reset();
  }
  return kept;
}

}  // namespace dcloth::converter

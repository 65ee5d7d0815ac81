// A garment without its last stages: what a model need not hold because a scene does without it.
#ifndef DCLOTH_CONVERTER_STAGES_H_
#define DCLOTH_CONVERTER_STAGES_H_

#include <cstdint>
#include <string>

#include "converter/bundle.h"

namespace dcloth::converter {

// All stages of a bundle, as DCLOTH_STAGES_*.
uint32_t StagesOf(const Bundle& bundle);

// "static", "skeleton" or "mesh": the last of `stages`, which are DCLOTH_STAGES_*.
const char* StagesName(uint32_t stages);
uint32_t ParseStages(const std::string& name);  // of such a name; throws Error

// The bundle without what comes after `stages` (DCLOTH_STAGES_*): no approximation of it, the network stops there. A
// patch stage counts as both the skeleton and the mesh stage.
// Throws Error where the bundle does not hold them.
Bundle KeepStages(const Bundle& bundle, uint32_t stages);

}  // namespace dcloth::converter

#endif  // DCLOTH_CONVERTER_STAGES_H_

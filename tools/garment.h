// A garment by file or by the name of one that comes with dcloth.
#ifndef DCLOTH_TOOLS_GARMENT_H_
#define DCLOTH_TOOLS_GARMENT_H_

#include <string>

#include "converter/rollout.h"

namespace dcloth::tools {

// A .dcloth file, a training bundle (.safetensors), which is converted to int8, or a name such as "skirt": NAME.dcloth
// beside the program or in ../share/dcloth, else the bundle of the sources that it was built from. Throws
// converter::Error with all the places that were looked at.
converter::OpenModel OpenGarment(const std::string& garment);

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_GARMENT_H_

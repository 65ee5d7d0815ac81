#include "engine/format/view.h"

#include "engine/format/schema.h"

namespace dcloth::format {

const char* JointName(const ModelView& model, uint32_t index) {
  const auto* names =
      static_cast<const flatbuffers::Vector<flatbuffers::Offset<flatbuffers::String>>*>(model.joint_names);
  return index < model.joint_count ? names->Get(index)->c_str() : nullptr;
}

}  // namespace dcloth::format

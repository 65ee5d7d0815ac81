#include "engine/src/joint_binding.h"

#include <cstring>

namespace dcloth::engine {
namespace {

constexpr uint32_t kMissing = UINT32_MAX;

uint32_t Find(const char* name, const char* const* names, uint32_t count) {
  const size_t size = std::strlen(name) + 1;
  for (uint32_t i = 0; i < count; ++i) {
    if (names[i] != nullptr && std::strncmp(names[i], name, size) == 0) return i;
  }
  return kMissing;
}

// "2 of 6 joints missing: 'hips', 'chest'", as many names as fit.
void ListMissing(const format::ModelView& model, const char* const* names, uint32_t count, uint32_t missing, char* text,
                 size_t size) {
  constexpr size_t kRoomForRest = 20;  // ", and 255 more"
  format::Text out(text, size);
  out.Add(uint64_t{missing}).Add(" of ").Add(uint64_t{model.joint_count}).Add(" joints missing:");
  uint32_t listed = 0;
  for (uint32_t j = 0; j < model.joint_count; ++j) {
    const char* name = format::JointName(model, j);
    if (Find(name, names, count) != kMissing) continue;
    if (std::strlen(text) + std::strlen(name) + 4 + kRoomForRest > size) break;
    out.Add(listed == 0 ? " '" : ", '").AddName(name).Add("'");
    ++listed;
  }
  if (listed < missing) out.Add(listed == 0 ? " " : ", and ").Add(uint64_t{missing - listed}).Add(" more");
}

}  // namespace

bool MatchJoints(const format::ModelView& model, const char* const* names, uint32_t count, uint32_t* joint_map,
                 format::Diagnostic* diagnostic) {
  uint32_t missing = 0;
  for (uint32_t j = 0; j < model.joint_count; ++j) {
    if (Find(format::JointName(model, j), names, count) == kMissing) ++missing;
  }
  if (missing != 0) {
    char found[150];
    ListMissing(model, names, count, missing, found, sizeof(found));
    return diagnostic->Fail(DCLOTH_ERROR_JOINTS, format::kNoOffset, nullptr, found, "every joint of the model",
                            "name the skeleton's joints as in training");
  }
  for (uint32_t j = 0; j < model.joint_count; ++j) joint_map[j] = Find(format::JointName(model, j), names, count);
  return true;
}

}  // namespace dcloth::engine

#include "tests/attack/open_and_run.h"

#include <cmath>
#include <cstdint>
#include <cstring>
#include <vector>

#include "tests/unit/engine/aligned_bytes.h"
#include "tests/unit/engine/all_finite.h"

namespace dcloth::testing {
namespace {

bool IsPoison(const AlignedBytes& bytes) {
  for (size_t i = 0; i < bytes.size(); ++i) {
    if (bytes.data()[i] != AlignedBytes::kPoison) return false;
  }
  return true;
}

std::string BrokenByRefusal(const Outcome& outcome, const dcloth_error& error, size_t size, const dcloth_model* model,
                            const AlignedBytes& storage) {
  switch (outcome.status) {
    case DCLOTH_ERROR_ARGUMENT:
    case DCLOTH_ERROR_ALIGNMENT:
    case DCLOTH_ERROR_FORMAT:
    case DCLOTH_ERROR_VERSION:
    case DCLOTH_ERROR_SEMANTICS:
      break;
    default:
      return "a status that dcloth_model_open does not name: " + std::to_string(outcome.status);
  }
  if (error.status != outcome.status) return "error.status is not the status returned";
  if (std::memchr(error.text, 0, sizeof(error.text)) == nullptr) return "an error text without an end";
  if (outcome.text.find("found ") == std::string::npos || outcome.text.find("; allowed: ") == std::string::npos) {
    return "a text that names nothing found or allowed: " + outcome.text;
  }
  if (error.offset_bytes != UINT64_MAX && error.offset_bytes >= size) return "an offset outside of the bytes";
  if (model != nullptr) return "a refused model in *model";
  return IsPoison(storage) ? "" : "storage written for a refused model";
}

// An upright character at the origin, every joint in its place.
std::vector<float> UprightPose(uint32_t joint_count) {
  std::vector<float> matrices;
  for (uint32_t element = 0; element < 16 * joint_count; ++element)
    matrices.push_back(element % 16 % 5 == 0 ? 1.0f : 0.0f);
  return matrices;
}

std::string BrokenByRun(const dcloth_model* model, size_t storage_limit, bool* finite) {
  dcloth_model_info info = {};
  info.struct_size = sizeof(info);
  if (dcloth_model_describe(model, &info) != DCLOTH_OK) return "an open model that is not described";
  if (!(info.tick_seconds > 0.0f && std::isfinite(info.tick_seconds))) return "a tick of no length";
  for (uint32_t j = 0; j < info.joint_count; ++j) {
    const char* name = dcloth_model_joint_name(model, j);
    if (name == nullptr || *name == '\0') return "a joint without a name";
  }
  const size_t size = dcloth_cloth_storage_size(model);
  if (size == 0 || size > (size_t{1} << 31)) return "a storage size of " + std::to_string(size);
  if (size > storage_limit) return "";
  AlignedBytes storage(size);
  dcloth_cloth* cloth = nullptr;
  if (dcloth_cloth_create(model, storage.data(), storage.size(), &cloth, nullptr) != DCLOTH_OK)
    return "a model that opened takes no cloth";
  const std::vector<float> matrices = UprightPose(info.joint_count);
  const dcloth_pose pose = {sizeof(pose), info.joint_count, matrices.data(), 0, 0};
  for (int tick = 0; tick < 2; ++tick) {
    if (dcloth_cloth_tick(cloth, &pose, info.stages, nullptr) != DCLOTH_OK) return "a sound pose was refused";
  }
  std::vector<float> positions(3 * size_t{info.vertex_count}), normals(positions.size());
  dcloth_output output = {};
  output.struct_size = sizeof(output);
  output.vertex_count = info.vertex_count;
  output.positions = positions.data();
  output.normals = normals.data();
  output.position_stride_bytes = output.normal_stride_bytes = 12;
  output.flags = DCLOTH_OUTPUT_OUTSIDE_BODY;
  if (dcloth_cloth_skin(cloth, &pose, 0.5f, &output, nullptr) != DCLOTH_OK) return "a sound frame was refused";
  *finite = AllFinite(positions) && AllFinite(normals);
  // Refused where the model's own joints have no inverse.
  const dcloth_status taken = dcloth_cloth_set_bind_pose(cloth, &pose, nullptr);
  if (taken != DCLOTH_OK && taken != DCLOTH_ERROR_POSE) return "a bind pose's status: " + std::to_string(taken);
  if (dcloth_cloth_tick(cloth, &pose, info.stages, nullptr) != DCLOTH_OK ||
      dcloth_cloth_skin(cloth, &pose, 0.5f, &output, nullptr) != DCLOTH_OK)
    return "a sound frame was refused in a rig of its own";
  return dcloth_cloth_reset(cloth) == DCLOTH_OK ? "" : "a cloth that cannot be reset";
}

}  // namespace

Outcome OpenAndRun(const void* bytes, size_t size, size_t storage_limit) {
  Outcome outcome;
  AlignedBytes storage(dcloth_model_storage_size());
  dcloth_model* model = nullptr;
  dcloth_error error = {};
  error.struct_size = sizeof(error);
  std::memset(error.text, 'x', sizeof(error.text));
  outcome.status = dcloth_model_open(bytes, size, storage.data(), storage.size(), &model, &error);
  if (outcome.status == DCLOTH_OK) {
    outcome.broken_promise =
        model == nullptr ? "no model where one opened" : BrokenByRun(model, storage_limit, &outcome.finite);
  } else {
    outcome.text.assign(error.text, strnlen(error.text, sizeof(error.text)));
    outcome.broken_promise = BrokenByRefusal(outcome, error, size, model, storage);
  }
  return outcome;
}

}  // namespace dcloth::testing

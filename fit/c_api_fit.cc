// The C ABI of fits: checks arguments, translates, nothing else.
#include <cstddef>
#include <cstdint>

#include "dcloth/dcloth_fit.h"
#include "engine/src/base/arithmetic.h"
#include "engine/src/base/host_struct.h"
#include "engine/src/cloth.h"
#include "fit/joint_roles.h"
#include "fit/make_fit.h"

namespace {

using dcloth::engine::Cloth;
using dcloth::engine::FloatEnvironment;
using dcloth::engine::IsWhole;
using dcloth::engine::ReadStruct;
using dcloth::fit::kRoleCount;
using dcloth::format::Diagnostic;
using dcloth::format::kMaxHostJoints;
using dcloth::format::kNoOffset;
using dcloth::format::ModelView;
using dcloth::format::Path;

static_assert(kRoleCount <= DCLOTH_FIT_ROLES, "a role more has its place in the report");

constexpr uint32_t kMostInfluences = 16;
constexpr uint32_t kMostVertices = 1u << 24, kMostTriangles = 1u << 25;

bool Refuse(const char* field, int64_t index, const char* found, const char* allowed, Diagnostic* diagnostic) {
  const Path parent = {nullptr, "character"}, path = {&parent, field, index};
  return diagnostic->Fail(DCLOTH_ERROR_ARGUMENT, kNoOffset, field == nullptr ? &parent : &path, found, allowed, "");
}

template <typename T>
bool IsAligned(const T* pointer) {
  return reinterpret_cast<uintptr_t>(pointer) % alignof(T) == 0;
}

// The two libraries share the layout of a cloth and of a model's view.
bool CheckLibrary(Diagnostic* diagnostic) {
  if (dcloth_version_number() == DCLOTH_VERSION_NUMBER) return true;
  const Path path = {nullptr, "dcloth_version_number"};
  return diagnostic->FailCount(DCLOTH_ERROR_ARGUMENT, kNoOffset, &path, dcloth_version_number(), "",
                               "that of the fit library's release", "load both libraries from one release");
}

bool CheckCounts(const dcloth_character& c, Diagnostic* diagnostic) {
  constexpr int64_t kNone = Path::kNoIndex;
  if (c.joint_count == 0 || c.joint_count > kMaxHostJoints)
    return Refuse("joint_count", kNone, "0 or a number above 4096", "1 to 4096", diagnostic);
  if (c.bind_matrices == nullptr || !IsAligned(c.bind_matrices))
    return Refuse("bind_matrices", kNone, "a null or misaligned pointer", "a pointer to floats, aligned to 4 bytes",
                  diagnostic);
  if (c.joint_names == nullptr && c.joint_roles == nullptr)
    return Refuse("joint_names", kNone, "null, and joint_roles is null too", "names or roles of the joints",
                  diagnostic);
  if (c.column_major > 1) return Refuse("column_major", kNone, "a number above 1", "0 or 1", diagnostic);
  bool seen[kRoleCount] = {};
  for (uint32_t j = 0; c.joint_roles != nullptr && j < c.joint_count; ++j) {
    const uint32_t role = c.joint_roles[j];
    if (role >= kRoleCount) return Refuse("joint_roles", j, "an unknown number", "DCLOTH_ROLE_*", diagnostic);
    const bool trunk = role >= DCLOTH_ROLE_SPINE && role <= DCLOTH_ROLE_UPPER_CHEST;
    if (seen[role] && !trunk && role != DCLOTH_ROLE_NONE)
      return Refuse("joint_roles", j, "a role that another joint has", "one joint for each role, except in the trunk",
                    diagnostic);
    seen[role] = true;
  }
  if (c.body_vertex_count == 0) return true;
  if (c.body_vertex_count > kMostVertices || c.body_triangle_count > kMostTriangles)
    return Refuse("body_vertex_count", kNone, "more than 2^24 vertices or 2^25 triangles", "at most that many",
                  diagnostic);
  if (c.body_positions == nullptr || c.body_joints == nullptr || c.body_weights == nullptr)
    return Refuse("body_positions", kNone, "a null pointer, or null joints or weights",
                  "points with joints and weights", diagnostic);
  if (!IsAligned(c.body_positions) || !IsAligned(c.body_joints) || !IsAligned(c.body_weights) ||
      !IsAligned(c.body_triangles))
    return Refuse("body_positions", kNone, "a misaligned pointer", "pointers aligned to 4 bytes", diagnostic);
  if (c.body_influences == 0 || c.body_influences > kMostInfluences)
    return Refuse("body_influences", kNone, "0 or a number above 16", "1 to 16", diagnostic);
  return true;
}

}  // namespace

extern "C" {

uint32_t dcloth_role_of_name(const char* name) {
  uint32_t rank = 0;
  const uint32_t role = dcloth::fit::RoleOf(name, false, 0, &rank);
  return role != DCLOTH_ROLE_NONE ? role : dcloth::fit::RoleOf(name, false, 1, &rank);
}

const char* dcloth_role_name(uint32_t role) { return dcloth::fit::RoleName(role); }

size_t dcloth_fit_storage_size(const dcloth_model* model, const dcloth_character* character) {
  Diagnostic ignored(nullptr);
  if (model == nullptr || !IsWhole(character) || !CheckLibrary(&ignored)) return 0;
  const dcloth_character read = ReadStruct(*character);
  if (read.joint_count == 0 || read.joint_count > kMaxHostJoints) return 0;
  return dcloth::fit::FitStorageSize(*reinterpret_cast<const ModelView*>(model), read);
}

dcloth_status dcloth_cloth_fit(dcloth_cloth* cloth, const dcloth_character* character, void* storage,
                               size_t storage_size, dcloth_fit* fit, dcloth_error* error) {
  const FloatEnvironment environment;
  Diagnostic diagnostic(error);
  if (cloth == nullptr || !IsWhole(character) || (fit != nullptr && !IsWhole(fit))) {
    Refuse(nullptr, Path::kNoIndex, "a null pointer, or a struct_size smaller than in the first version",
           "a cloth, a character with its size, and null or a fit with its size", &diagnostic);
    return diagnostic.status();
  }
  if (!CheckLibrary(&diagnostic)) return diagnostic.status();
  const Cloth& worn = *reinterpret_cast<const Cloth*>(cloth);
  const dcloth_character read = ReadStruct(*character);
  dcloth_fit report = {};
  uint64_t work_left = dcloth::fit::kFitWork;
  if (!CheckCounts(read, &diagnostic) || !dcloth::fit::MakeFit(*worn.trained, ToldSpace(worn), read, storage,
                                                               storage_size, &work_left, &report, &diagnostic)) {
    return diagnostic.status();
  }
  const dcloth_status status = dcloth_cloth_set_fit(cloth, storage, static_cast<size_t>(report.file_bytes), error);
  if (status == DCLOTH_OK && fit != nullptr) dcloth::engine::WriteStruct(report, fit);
  return status;
}

}  // extern "C"

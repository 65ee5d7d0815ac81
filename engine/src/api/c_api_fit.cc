// The C ABI of fits: checks arguments, translates, nothing else.
#include <cstddef>
#include <cstdint>

#include "dcloth/dcloth_fit.h"
#include "engine/src/base/arithmetic.h"
#include "engine/src/base/host_struct.h"
#include "engine/src/fit.h"
#include "engine/src/pose/joint_roles.h"

namespace {

using dcloth::engine::Cloth;
using dcloth::engine::FloatEnvironment;
using dcloth::engine::IsWhole;
using dcloth::engine::kRoleCount;
using dcloth::engine::ReadStruct;
using dcloth::format::Diagnostic;
using dcloth::format::kNoOffset;
using dcloth::format::ModelView;
using dcloth::format::Path;

static_assert(kRoleCount <= DCLOTH_FIT_ROLES, "a role more has its place in the report");

constexpr uint32_t kMostJoints = 4096, kMostInfluences = 16;
constexpr uint32_t kMostVertices = 1u << 24, kMostTriangles = 1u << 25;

bool Refuse(const char* field, int64_t index, const char* found, const char* allowed, Diagnostic* diagnostic) {
  const Path parent = {nullptr, "character"}, path = {&parent, field, index};
  return diagnostic->Fail(DCLOTH_ERROR_ARGUMENT, kNoOffset, field == nullptr ? &parent : &path, found, allowed, "");
}

template <typename T>
bool IsAligned(const T* pointer) {
  return reinterpret_cast<uintptr_t>(pointer) % alignof(T) == 0;
}

bool CheckCounts(const dcloth_character& c, Diagnostic* diagnostic) {
  constexpr int64_t kNone = Path::kNoIndex;
  if (c.joint_count == 0 || c.joint_count > kMostJoints)
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
  const uint32_t role = dcloth::engine::RoleOf(name, false, 0, &rank);
  return role != DCLOTH_ROLE_NONE ? role : dcloth::engine::RoleOf(name, false, 1, &rank);
}

const char* dcloth_role_name(uint32_t role) { return dcloth::engine::RoleName(role); }

size_t dcloth_fit_storage_size(const dcloth_model* model, const dcloth_character* character) {
  if (model == nullptr || !IsWhole(character)) return 0;
  const dcloth_character read = ReadStruct(*character);
  if (read.joint_count == 0 || read.joint_count > kMostJoints) return 0;
  return dcloth::engine::FitStorageSize(*reinterpret_cast<const ModelView*>(model), read);
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
  const dcloth_character read = ReadStruct(*character);
  dcloth_fit report = {};
  uint64_t work_left = dcloth::engine::kFitWork;
  if (CheckCounts(read, &diagnostic) &&
      dcloth::engine::FitCloth(read, storage, storage_size, &work_left, reinterpret_cast<Cloth*>(cloth), &report,
                               &diagnostic) &&
      fit != nullptr) {
    dcloth::engine::WriteStruct(report, fit);
  }
  return diagnostic.status();
}

}  // extern "C"

#include "engine/src/fit.h"

#include <cmath>
#include <cstring>

#include "engine/format/checksum.h"
#include "engine/format/fit_file.h"
#include "engine/format/scan.h"
#include "engine/src/base/arithmetic.h"
#include "engine/src/base/state_spans.h"
#include "engine/src/pose/host_rig.h"

namespace dcloth::engine {
namespace {

using format::Diagnostic;
using format::FitHead;
using format::FitJoint;
using format::FitLayout;
using format::ModelView;
using format::Path;
using format::Text;

constexpr char kDamaged[] = "the fit is damaged: make it anew with dcloth dress";
constexpr double kLeastScale = 0.001, kMostScale = 1000;  // those of fits lie far inside

// The bytes of a fit as their parts.
struct FitView {
  const FitHead* head;
  const FitJoint* joints;
  const float *positions, *body_positions, *body_weights;
  const uint8_t* body_joints;
};

FitView ViewOf(const void* bytes) {
  const auto* head = static_cast<const FitHead*>(bytes);
  const auto* at = static_cast<const uint8_t*>(bytes);
  const FitLayout layout = format::LayoutOf(*head);
  const auto floats = [at](size_t offset) { return reinterpret_cast<const float*>(at + offset); };
  return {head,
          reinterpret_cast<const FitJoint*>(at + layout.joints),
          floats(layout.positions),
          floats(layout.body_positions),
          floats(layout.body_weights),
          at + layout.body_joints};
}

bool CheckBytes(const void* bytes, size_t size, Diagnostic* diagnostic) {
  constexpr char kComplete[] = "check that the file is complete";
  if (reinterpret_cast<uintptr_t>(bytes) % DCLOTH_ALIGNMENT != 0) {
    return diagnostic->Fail(DCLOTH_ERROR_ALIGNMENT, format::kNoOffset, nullptr, "a fit that is not aligned to 64 bytes",
                            "an address divisible by 64", "allocate with an alignment of DCLOTH_ALIGNMENT");
  }
  if (size < sizeof(FitHead)) {
    return diagnostic->FailCount(DCLOTH_ERROR_FORMAT, format::kNoOffset, nullptr, size, " bytes", "at least 136",
                                 kComplete);
  }
  const auto& head = *static_cast<const FitHead*>(bytes);
  if (std::memcmp(head.magic, format::kFitMagic, sizeof(format::kFitMagic)) != 0) {
    return diagnostic->Fail(DCLOTH_ERROR_FORMAT, 0, nullptr, "different bytes at the start", "DCLF",
                            "these bytes are no .dcloth-fit");
  }
  if (head.version != format::kFitVersion) {
    const Path path = {nullptr, "version"};
    return diagnostic->FailCount(DCLOTH_ERROR_VERSION, offsetof(FitHead, version), &path, head.version, "", "1",
                                 "another release made this fit: make it anew with dcloth dress");
  }
  if (head.size != size) {
    char allowed[32];
    Text(allowed, sizeof(allowed)).Add(head.size);
    return diagnostic->FailCount(DCLOTH_ERROR_FORMAT, offsetof(FitHead, size), nullptr, size, " bytes", allowed,
                                 kComplete);
  }
  const auto* summed = static_cast<const uint8_t*>(bytes) + format::kFitSummedFrom;
  if (format::Checksum(summed, size - format::kFitSummedFrom) != head.checksum) {
    return diagnostic->Fail(DCLOTH_ERROR_FORMAT, offsetof(FitHead, checksum), nullptr,
                            "a checksum that does not match the bytes", "the checksum of the bytes", kDamaged);
  }
  return true;
}

bool CheckGarment(const FitHead& head, const ModelView& model, Diagnostic* diagnostic) {
  if (head.figure == format::FigureOf(model)) return true;
  const Path path = {nullptr, "figure"};
  char name[sizeof(head.garment) + 1] = {}, found[100], allowed[100];
  std::memcpy(name, head.garment, sizeof(head.garment));
  Text(found, sizeof(found)).Add("a fit of the garment '").AddName(name).Add("'");
  Text(allowed, sizeof(allowed)).Add("one of this model, '").AddName(model.name).Add("', with the same cut");
  return diagnostic->Fail(DCLOTH_ERROR_MODEL, offsetof(FitHead, figure), &path, found, allowed,
                          "make the fit with dcloth dress from the model that the cloth has");
}

struct Field {
  const char* name;
  size_t offset;
};
#define DCLOTH_FIELD(name) \
  Field { #name, offsetof(FitHead, name) }

bool CheckCount(const Field& field, uint32_t found, uint32_t expected, Diagnostic* diagnostic) {
  if (found == expected) return true;
  const Path path = {nullptr, field.name};
  char allowed[16];
  Text(allowed, sizeof(allowed)).Add(uint64_t{expected});
  return diagnostic->FailCount(DCLOTH_ERROR_SEMANTICS, field.offset, &path, found, "", allowed, kDamaged);
}

// False for NaN.
bool CheckRange(const Path& path, size_t offset, double value, double low, double high, const char* allowed,
                Diagnostic* diagnostic) {
  if (value >= low && value <= high) return true;
  char found[32];
  Text(found, sizeof(found)).AddNumber(value);
  return diagnostic->Fail(DCLOTH_ERROR_SEMANTICS, offset, &path, found, allowed, kDamaged);
}

bool CheckHead(const FitHead& head, const ModelView& model, Diagnostic* diagnostic) {
  const bool skin = head.vertex_count != 0, body = skin && model.body.vertex_count != 0;
  const auto range = [&](const Field& field, double value, float low, float high, const char* allowed) {
    return CheckRange({nullptr, field.name}, field.offset, value, static_cast<double>(low), static_cast<double>(high),
                      allowed, diagnostic);
  };
  if (!CheckCount(DCLOTH_FIELD(joint_count), head.joint_count, model.joint_count, diagnostic) ||
      !CheckCount(DCLOTH_FIELD(vertex_count), head.vertex_count, skin ? model.vertex_count : 0, diagnostic) ||
      !CheckCount(DCLOTH_FIELD(body_vertex_count), head.body_vertex_count, body ? model.body.vertex_count : 0,
                  diagnostic) ||
      !CheckCount(DCLOTH_FIELD(influences), head.influences, body ? model.body.influences : 0, diagnostic) ||
      !CheckCount(DCLOTH_FIELD(unused), head.unused, 0, diagnostic) ||
      !CheckRange({nullptr, "scale"}, offsetof(FitHead, scale), head.scale, kLeastScale, kMostScale, "0.001 to 1000",
                  diagnostic)) {
    return false;
  }
  if (head.host_joint_count == 0 || head.host_joint_count > format::kMaxHostJoints) {
    const Path path = {nullptr, "host_joint_count"};
    return diagnostic->FailCount(DCLOTH_ERROR_SEMANTICS, offsetof(FitHead, host_joint_count), &path,
                                 head.host_joint_count, "", "1 to 4096", kDamaged);
  }
  return !body || (range(DCLOTH_FIELD(clearance), static_cast<double>(head.clearance), format::kMinClearance,
                         format::kMaxClearance, "0.0001 to 0.1 m") &&
                   range(DCLOTH_FIELD(reach), static_cast<double>(head.reach), head.clearance, format::kMaxReach,
                         "from the clearance to 10 m"));
}

bool CheckJoints(const FitView& fit, Diagnostic* diagnostic) {
  constexpr double kLargest = static_cast<double>(kLargestSaved);
  for (uint32_t j = 0; j < fit.head->joint_count; ++j) {
    const FitJoint& joint = fit.joints[j];
    const Path parent = {nullptr, "joints", j};
    const size_t offset = reinterpret_cast<const uint8_t*>(&joint) - reinterpret_cast<const uint8_t*>(fit.head);
    for (const auto& row : joint.motion) {
      for (const double value : row) {
        if (!CheckRange({&parent, "motion"}, offset, value, -kLargest, kLargest, "-1e18 to 1e18", diagnostic))
          return false;
      }
    }
    if (joint.host >= fit.head->host_joint_count) {
      const Path path = {&parent, "host"};
      return diagnostic->FailCount(DCLOTH_ERROR_SEMANTICS, offset + offsetof(FitJoint, host), &path, joint.host, "",
                                   "less than host_joint_count", kDamaged);
    }
    if (std::memchr(joint.name, 0, sizeof(joint.name)) == nullptr) {
      const Path path = {&parent, "name"};
      return diagnostic->Fail(DCLOTH_ERROR_SEMANTICS, offset + offsetof(FitJoint, name), &path, "no terminator",
                              "at most 59 bytes and a 0", kDamaged);
    }
  }
  return true;
}

bool CheckArrays(const FitView& fit, Diagnostic* diagnostic) {
  const FitHead& head = *fit.head;
  const size_t n = head.vertex_count, b = head.body_vertex_count, held = b * head.influences;
  const auto check = [&](const char* name, const void* array, size_t size, size_t bad, size_t count, const char* found,
                         const char* allowed) {
    if (bad == count) return true;
    const Path path = {nullptr, name, static_cast<int64_t>(bad)};
    const size_t begin =
        static_cast<size_t>(static_cast<const uint8_t*>(array) - reinterpret_cast<const uint8_t*>(&head));
    return diagnostic->Fail(DCLOTH_ERROR_SEMANTICS, begin + bad * size, &path, found, allowed, kDamaged);
  };
  constexpr size_t kFloat = sizeof(float);
  return check("positions", fit.positions, kFloat, format::FindNotFinite(fit.positions, 3 * n), 3 * n,
               "NaN or infinity", "finite numbers") &&
         check("body.positions", fit.body_positions, kFloat, format::FindNotFinite(fit.body_positions, 3 * b), 3 * b,
               "NaN or infinity", "finite numbers") &&
         check("body.weights", fit.body_weights, kFloat * head.influences,
               format::FindBadWeightRow(fit.body_weights, b, head.influences), b,
               "weights that are negative or do not sum to 1", "weights of a vertex, 0 or more, with sum 1") &&
         check("body.joints", fit.body_joints, 1, format::FindNotBelow(fit.body_joints, held, head.joint_count), held,
               "a joint past the last one", "less than joint_count");
}

}  // namespace

bool WearFit(const void* bytes, size_t size, Cloth* cloth, Diagnostic* diagnostic) {
  const ModelView& model = *cloth->trained;
  if (!CheckBytes(bytes, size, diagnostic)) return false;
  const auto& head = *static_cast<const FitHead*>(bytes);
  if (!CheckGarment(head, model, diagnostic) || !CheckHead(head, model, diagnostic)) return false;
  if (const size_t needed = format::LayoutOf(head).size; needed != size) {
    char allowed[32];
    Text(allowed, sizeof(allowed)).Add(uint64_t{needed});
    return diagnostic->FailCount(DCLOTH_ERROR_FORMAT, offsetof(FitHead, size), nullptr, size, " bytes", allowed,
                                 kDamaged);
  }
  const FitView fit = ViewOf(bytes);
  if (!CheckJoints(fit, diagnostic) || !CheckArrays(fit, diagnostic)) return false;
  cloth->told_space = ToldSpace(*cloth);
  HostRig* const rig = &cloth->rig;
  for (uint32_t j = 0; j < model.joint_count; ++j) {
    Affine motion;
    std::memcpy(motion.m, fit.joints[j].motion, sizeof(motion.m));
    rig->joint_map[j] = fit.joints[j].host;
    rig->inverse_bind[j] = JointToHost(cloth->told_space, motion);
  }
  rig->space = cloth->told_space;
  rig->space.metres_per_unit /= head.scale;
  rig->host_joint_count = head.host_joint_count;
  rig->has_bind_pose = true;
  ModelView* const view = cloth->fitted_model;
  *view = model;
  if (head.vertex_count != 0) view->template_positions = fit.positions;
  if (head.body_vertex_count != 0) {
    view->body.positions = fit.body_positions;
    view->body.weights = fit.body_weights;
    view->body.joints = fit.body_joints;
    view->body.clearance = head.clearance;
    view->body.reach = head.reach;
  }
  cloth->model = view;
  cloth->fit = fit.joints;
  PrepareContact(ActiveKernels(), *view, cloth->contact);
  return true;
}

bool BindJoints(const char* const* names, uint32_t count, Cloth* cloth, Diagnostic* diagnostic) {
  const ModelView& model = *cloth->trained;
  const char* wanted[format::kMaxJoints];
  for (uint32_t j = 0; j < model.joint_count; ++j)
    wanted[j] = cloth->fit != nullptr ? cloth->fit[j].name : format::JointName(model, j);
  if (!MatchJoints(wanted, model.joint_count, names, count, cloth->rig.joint_map, diagnostic)) return false;
  cloth->rig.host_joint_count = count;
  return true;
}

}  // namespace dcloth::engine

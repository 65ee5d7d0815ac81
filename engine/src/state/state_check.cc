#include "engine/src/state/state_check.h"

#include <cmath>
#include <cstring>

#include "engine/format/checksum.h"
#include "engine/src/network/schedule.h"
#include "engine/src/time/idle.h"

namespace dcloth::engine {
namespace {

using format::Diagnostic;
using format::ModelView;
using format::Path;
using format::Text;

constexpr double kLargestDouble = static_cast<double>(kLargestSaved);
constexpr uint64_t kMostIdleFloats = uint64_t{1} << 24;
constexpr char kDamaged[] = "the saved state is damaged; reset the cloth instead";

// A place in the head, for messages.
struct Field {
  const char* name;
  size_t offset;
};
#define DCLOTH_FIELD(name) \
  Field { #name, offsetof(StateHead, name) }

bool FailCount(const Field& field, uint64_t found, const char* allowed, Diagnostic* diagnostic) {
  const Path path = {nullptr, field.name};
  return diagnostic->FailCount(DCLOTH_ERROR_SEMANTICS, field.offset, &path, found, "", allowed, kDamaged);
}

bool FailValue(const Path& path, size_t offset, double found, const char* allowed, Diagnostic* diagnostic) {
  char text[32];
  Text(text, sizeof(text)).AddNumber(found);
  return diagnostic->Fail(DCLOTH_ERROR_SEMANTICS, offset, &path, text, allowed, kDamaged);
}

// False for NaN.
bool CheckRange(const Field& field, double value, double low, double high, const char* allowed,
                Diagnostic* diagnostic) {
  return (value >= low && value <= high) || FailValue({nullptr, field.name}, field.offset, value, allowed, diagnostic);
}

bool CheckPosition(const StateHead& head, const ModelView& model, Diagnostic* diagnostic) {
  if (head.tick_count > kTickSlots) return FailCount(DCLOTH_FIELD(tick_count), head.tick_count, "0 to 3", diagnostic);
  const bool fresh = head.tick_count == 0;
  const bool known =
      head.stages == DCLOTH_STAGES_STATIC || head.stages == DCLOTH_STAGES_SKELETON || head.stages == DCLOTH_STAGES_MESH;
  if (fresh ? head.stages != DCLOTH_STAGES_MESH : !known || head.stages > ModelStages(model))
    return FailCount(DCLOTH_FIELD(stages), head.stages, "DCLOTH_STAGES_* of a stage that the model has", diagnostic);
  TickPart part = TickPart::kDone;
  if (!format::FindTickPart(head.part, &part) || (fresh && part != TickPart::kDone))
    return FailCount(DCLOTH_FIELD(part), head.part, "the number of a part of a tick", diagnostic);
  if (head.contact > (fresh || model.body.vertex_count == 0 ? 0u : kMostCores + 1))
    return FailCount(DCLOTH_FIELD(contact), head.contact, "0 to 25; 0 without a body or a tick", diagnostic);
  if (head.idle_ticks > (fresh ? 0u : kIdleTicks))
    return FailCount(DCLOTH_FIELD(idle_ticks), head.idle_ticks, "0 to 15", diagnostic);
  const bool counting = head.idle_ticks != 0 && head.idle_ticks != kIdleTicks;
  if (counting ? head.idle_floats == 0 || head.idle_floats > kMostIdleFloats : head.idle_floats != 0)
    return FailCount(DCLOTH_FIELD(idle_floats), head.idle_floats, "1 to 2^24 while idle ticks are counted, else 0",
                     diagnostic);
  const uint64_t items = TickItems(model, head.stages, part);
  if (part != TickPart::kDone ? head.items_done >= items : head.items_done != 0)
    return FailCount(DCLOTH_FIELD(items_done), head.items_done, "fewer items than the part has", diagnostic);
  if (head.jumped > (fresh ? 0u : 1u)) return FailCount(DCLOTH_FIELD(jumped), head.jumped, "0 or 1", diagnostic);
  return true;
}

bool CheckClock(const StateHead& head, Diagnostic* diagnostic) {
  constexpr double kRounding = 1e-9;  // of sums up to 2^20
  return CheckRange(DCLOTH_FIELD(tick_share), static_cast<double>(head.tick_share), 0, kLargestDouble, "0 to 1e18",
                    diagnostic) &&
         CheckRange(DCLOTH_FIELD(since), head.since, -kTickTolerance - kRounding, 1, "-0.001 to 1 tick", diagnostic) &&
         CheckRange(DCLOTH_FIELD(waited), head.waited, -1, kLongestGap, "-1 to 1048576 ticks", diagnostic) &&
         CheckRange(DCLOTH_FIELD(lag), head.lag, 0, 2, "0 to 2 ticks", diagnostic) &&
         CheckRange(DCLOTH_FIELD(older_step), head.older_step, 0, kLongestGap, "0 to 1048576 ticks", diagnostic) &&
         CheckRange(DCLOTH_FIELD(contact_seconds), static_cast<double>(head.contact_seconds), 0,
                    head.contact != 0 ? static_cast<double>(ContactClock::kMost) : 0, "0 to 1 s; 0 without contact",
                    diagnostic);
}

bool CheckRoot(const StateHead& head, Diagnostic* diagnostic) {
  constexpr double kRounding = 1e-12;  // of a unit vector in double
  const double square = head.heading[0] * head.heading[0] + head.heading[1] * head.heading[1];
  if (!CheckRange(DCLOTH_FIELD(heading), square, 1 - kRounding, 1 + kRounding, "1, the squared length of a unit vector",
                  diagnostic))
    return false;
  const auto check = [&](const Field& field, double value) {
    return CheckRange(field, value, -kLargestDouble, kLargestDouble, "-1e18 to 1e18", diagnostic);
  };
  for (int i = 0; i < 3; ++i) {
    if (!check(DCLOTH_FIELD(position), head.position[i]) || !check(DCLOTH_FIELD(velocity), head.velocity[i]) ||
        !check(DCLOTH_FIELD(wind), head.wind[i]))
      return false;
  }
  return check(DCLOTH_FIELD(yaw_rate), head.yaw_rate) &&
         CheckRange(DCLOTH_FIELD(velocity_age), head.velocity_age, 0, 1e18, "0 to 1e18 ticks", diagnostic);
}

bool CheckPose(const uint8_t* bytes, size_t joint_count, size_t offset, Diagnostic* diagnostic) {
  for (size_t i = 0; i < 12 * joint_count; ++i) {
    double value = 0;
    std::memcpy(&value, bytes + i * sizeof(value), sizeof(value));
    if (std::fabs(value) <= kLargestJoint) continue;
    return FailValue({nullptr, "pose", static_cast<int64_t>(i)}, offset + i * sizeof(value), value, "-1e12 to 1e12",
                     diagnostic);
  }
  return true;
}

bool CheckRow(const StateSpan& span, const uint8_t* bytes, size_t offset, Diagnostic* diagnostic) {
  for (size_t i = 0; i < span.columns; ++i) {
    float value = 0;
    std::memcpy(&value, bytes + i * sizeof(value), sizeof(value));
    if (std::fabs(value) <= span.largest) continue;
    const bool hidden = span.largest == kLargestHidden, bone = span.largest == kLargestBone;
    return FailValue({nullptr, span.name, static_cast<int64_t>(i)}, offset + i * sizeof(value),
                     static_cast<double>(value),
                     hidden ? "-1 to 1"
                     : bone ? "-1e9 to 1e9"
                            : "-1e18 to 1e18",
                     diagnostic);
  }
  return true;
}

// A number of the head that has to be the model's.
struct Shared {
  Field field;
  uint32_t of_state, of_model;
};

bool CheckShared(const Shared& shared, const char* fix, Diagnostic* diagnostic) {
  if (shared.of_state == shared.of_model) return true;
  char allowed[32];
  Text(allowed, sizeof(allowed)).Add(uint64_t{shared.of_model});
  const Path path = {nullptr, shared.field.name};
  return diagnostic->FailCount(DCLOTH_ERROR_MODEL, shared.field.offset, &path, shared.of_state, "", allowed, fix);
}

}  // namespace

bool CheckStateBytes(const uint8_t* bytes, size_t size, StateHead* head, Diagnostic* diagnostic) {
  constexpr char kComplete[] = "check that the saved state is complete";
  if (size < sizeof(StateHead)) {
    return diagnostic->FailCount(DCLOTH_ERROR_FORMAT, format::kNoOffset, nullptr, size, " bytes", "at least 248",
                                 kComplete);
  }
  std::memcpy(head, bytes, sizeof(StateHead));
  if (std::memcmp(head->magic, kStateMagic, sizeof(kStateMagic)) != 0) {
    return diagnostic->Fail(DCLOTH_ERROR_FORMAT, 0, nullptr, "different bytes at the start", "DCLS",
                            "these bytes are not the saved state of a cloth");
  }
  if (head->version != kStateVersion) {
    const Path path = {nullptr, "version"};
    return diagnostic->FailCount(DCLOTH_ERROR_VERSION, offsetof(StateHead, version), &path, head->version, "", "4",
                                 "another release saved this state; reset the cloth instead");
  }
  if (head->size != size) {
    char allowed[32];
    Text(allowed, sizeof(allowed)).Add(head->size);
    return diagnostic->FailCount(DCLOTH_ERROR_FORMAT, offsetof(StateHead, size), nullptr, size, " bytes", allowed,
                                 kComplete);
  }
  if (format::Checksum(bytes + kStateSummedFrom, size - kStateSummedFrom) != head->checksum) {
    return diagnostic->Fail(DCLOTH_ERROR_FORMAT, offsetof(StateHead, checksum), nullptr,
                            "a checksum that does not match the bytes", "the checksum of the bytes", kDamaged);
  }
  return true;
}

bool CheckStateModel(const StateHead& head, const ModelView& model, bool other_model, Diagnostic* diagnostic) {
  constexpr char kFix[] = "open the model that the state was saved with, or reset the cloth";
  const uint64_t identity = ModelIdentity(model);
  if (!other_model && head.identity != identity) {
    char allowed[64];
    Text(allowed, sizeof(allowed)).Add(identity).Add(", which is '").Add(model.name).Add("'");
    const Path path = {nullptr, "identity"};
    return diagnostic->FailCount(DCLOTH_ERROR_MODEL, offsetof(StateHead, identity), &path, head.identity, "", allowed,
                                 kFix);
  }
  const Shared shared[] = {
      {DCLOTH_FIELD(joint_count), head.joint_count, model.joint_count},
      {DCLOTH_FIELD(feature_count), head.feature_count, model.features.length},
      {DCLOTH_FIELD(bone_count), head.bone_count, model.static_stage.bone_count},
      {DCLOTH_FIELD(vertex_count), head.vertex_count, model.vertex_count},
      {DCLOTH_FIELD(skeleton_units), head.skeleton_units, model.skeleton_stage.units},
      {DCLOTH_FIELD(layer_count), head.layer_count, model.mesh_stage.layer_count},
      {DCLOTH_FIELD(feature_width), head.feature_width, model.mesh_stage.feature_width},
      {DCLOTH_FIELD(patch_shape), head.patch_shape, PatchShape(model.patch_stage)},
  };
  for (const Shared& number : shared) {
    if (!CheckShared(number, kFix, diagnostic)) return false;
  }
  if (head.tick_rate != model.tick_rate) {
    const Path path = {nullptr, "tick_rate"};
    char found[32], allowed[32];
    Text(found, sizeof(found)).AddNumber(static_cast<double>(head.tick_rate)).Add(" Hz");
    Text(allowed, sizeof(allowed)).AddNumber(static_cast<double>(model.tick_rate)).Add(" Hz");
    return diagnostic->Fail(DCLOTH_ERROR_MODEL, offsetof(StateHead, tick_rate), &path, found, allowed, kFix);
  }
  // Another rank's are passed over.
  if (!other_model && head.idle_floats != 0 && head.idle_floats != IdleStartFloats(model)) {
    const Path path = {nullptr, "idle_floats"};
    char allowed[32];
    Text(allowed, sizeof(allowed)).Add(uint64_t{IdleStartFloats(model)});
    return diagnostic->FailCount(DCLOTH_ERROR_MODEL, offsetof(StateHead, idle_floats), &path, head.idle_floats, "",
                                 allowed, kFix);
  }
  if (head.identity != identity && head.part != format::FactsOf(TickPart::kDone).number) {
    return diagnostic->Fail(DCLOTH_ERROR_MODEL, offsetof(StateHead, part), nullptr,
                            "an unfinished tick in the state of another model", "a state between ticks",
                            "save after an update without DCLOTH_FRAME_PIPELINED");
  }
  return true;
}

bool CheckStateHead(const StateHead& head, const ModelView& model, Diagnostic* diagnostic) {
  return CheckPosition(head, model, diagnostic) && CheckClock(head, diagnostic) && CheckRoot(head, diagnostic);
}

bool CheckStatePoses(const uint8_t* bytes, const StateHead& head, Diagnostic* diagnostic) {
  const size_t pose_bytes = head.joint_count * sizeof(Affine);
  for (size_t offset = sizeof(StateHead); offset < sizeof(StateHead) + StatePoseBytes(head); offset += pose_bytes) {
    if (!CheckPose(bytes + offset, head.joint_count, offset, diagnostic)) return false;
  }
  return true;
}

bool CheckStateSpans(const uint8_t* bytes, size_t offset, const StateSpans& spans, Diagnostic* diagnostic) {
  for (uint32_t i = 0; i < spans.count; ++i) {
    const StateSpan& span = spans.spans[i];
    for (size_t row = 0; row < span.rows; ++row, offset += span.columns * sizeof(float)) {
      const uint8_t* from =
          bytes != nullptr ? bytes + offset : reinterpret_cast<const uint8_t*>(span.data + row * span.stride);
      if (!CheckRow(span, from, offset, diagnostic)) return false;
    }
  }
  return true;
}

}  // namespace dcloth::engine

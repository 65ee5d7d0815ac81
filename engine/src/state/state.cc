#include "engine/src/state/state.h"

#include <cstddef>
#include <cstring>

#include "engine/format/checksum.h"
#include "engine/src/network/displacement.h"
#include "engine/src/network/schedule.h"
#include "engine/src/state/state_check.h"
#include "engine/src/time/idle.h"

#if defined(__BYTE_ORDER__) && __BYTE_ORDER__ != __ORDER_LITTLE_ENDIAN__
#error "models and saved states are little-endian and used as they lie"
#endif

namespace dcloth::engine {
namespace {

using format::Diagnostic;
using format::ModelView;
using format::Text;

static_assert(sizeof(StateHead) == 248 && offsetof(StateHead, joint_count) == 32 &&
                  offsetof(StateHead, tick_count) == 64 && offsetof(StateHead, since) == 96,
              "the same on every platform");

StateHead HeadOf(const Cloth& cloth) {
  const ModelView& model = *cloth.model;
  StateHead head = {};
  std::memcpy(head.magic, kStateMagic, sizeof(kStateMagic));
  head.version = kStateVersion;
  head.identity = ModelIdentity(model);
  head.joint_count = model.joint_count;
  head.feature_count = model.features.length;
  head.bone_count = model.static_stage.bone_count;
  head.vertex_count = model.vertex_count;
  head.skeleton_units = model.skeleton_stage.units;
  head.layer_count = model.mesh_stage.layer_count;
  head.feature_width = model.mesh_stage.feature_width;
  head.patch_shape = PatchShape(model.patch_stage);
  head.tick_rate = model.tick_rate;
  head.tick_count = cloth.tick_count;
  head.stages = cloth.stages;
  head.part = format::FactsOf(cloth.work.part).number;
  head.items_done = TickInWork(cloth) ? cloth.work.items_done : 0;
  head.jumped = cloth.root.jumped ? 1 : 0;
  head.contact = ContactOf(cloth);
  head.contact_seconds = head.contact != 0 ? cloth.contact_clock.seconds : 0.0f;
  head.idle_ticks = cloth.idle_ticks;
  head.tick_share = cloth.work_done;
  head.since = cloth.clock.since();
  head.waited = cloth.clock.waited();
  head.lag = cloth.clock.lag();
  head.older_step = cloth.older_step;
  head.heading[0] = cloth.root.heading.cosine;
  head.heading[1] = cloth.root.heading.sine;
  std::memcpy(head.position, cloth.root.position, sizeof(head.position));
  std::memcpy(head.velocity, cloth.root.velocity, sizeof(head.velocity));
  head.yaw_rate = cloth.root.yaw_rate;
  head.velocity_age = cloth.root.velocity_age;
  std::memcpy(head.wind, cloth.root.wind, sizeof(head.wind));
  head.idle_floats = cloth.idle_ticks != 0 && !IsFrozen(cloth) ? IdleStartFloats(model) : 0;
  return head;
}

size_t ContactBytes(const StateHead& head) {
  return head.contact == 0 ? 0 : size_t{6} * head.vertex_count * sizeof(int16_t);
}

// What ContactOf is while this cloth is kept outside of the body; 0 where the model has none.
uint32_t OwnContact(const Cloth& cloth) {
  return cloth.contact.kept.places == nullptr ? 0 : *cloth.contact.limbs.count + 1;
}

// Between ticks. A stage that rests has no state: it starts from zero.
void ListKept(const Cloth& cloth, const StatePosition& at, StateSpans* spans) {
  const ModelView& model = *cloth.model;
  const size_t n = model.vertex_count, width = model.mesh_stage.feature_width;
  spans->AddRow("features", cloth.features, model.features.length);
  if (RunsSkeleton(model, at.stages)) {
    const size_t units = model.skeleton_stage.units;
    spans->Add("skeleton_state", cloth.coefficients, 1, units, units, kLargestHidden);
  }
  if (RunsMesh(model, at.stages)) {
    for (size_t layer = 0; layer < model.mesh_stage.layer_count; ++layer) {
      spans->Add("mesh_state", cloth.mesh.state + layer * kernels::GsgruStateFloats(n, width), n, width, width,
                 kLargestHidden);
    }
  }
  if (RunsPatches(model, at.stages)) {
    const size_t hidden = size_t{model.patch_stage.patch_count} * model.patch_stage.width;
    spans->AddRow("patch_cloth", cloth.patches.cloth, PatchClothFloats(model.patch_stage));
    spans->Add("patch_hidden", cloth.patches.hidden, 1, hidden, hidden, kLargestHidden);
  }
  if (at.idle_floats != 0) {
    const bool own = at.idle_floats == IdleStartFloats(model);
    spans->AddRow("idle_start", own ? cloth.idle_start : nullptr, static_cast<size_t>(at.idle_floats));
  }
  if (at.contact != 0) {
    const bool own = at.contact == OwnContact(cloth);
    const LimbCores& limbs = cloth.contact.limbs;
    spans->Add("contact_hips", own ? cloth.contact.hips : nullptr, 1, 9, 9, kLargestBone);
    if (at.contact > 1) {
      spans->spans[spans->count++] = {"contact_bones",
                                      own ? &limbs.cores[0].before.axes[0].x : nullptr,
                                      at.contact - 1,
                                      kBoneFloats,
                                      sizeof(LimbCore) / sizeof(float),
                                      kLargestBone};
    }
  }
  // A tick in work fills the oldest slot, whose rest a frame may still draw.
  const uint32_t slots = at.work.part == TickPart::kDone ? at.tick_count : kTickSlots;
  for (uint32_t back = 0; back < slots; ++back) {
    const uint32_t slot = (cloth.newest + kTickSlots - back) % kTickSlots;
    spans->AddRow("increments", cloth.increments[slot], size_t{3} * model.static_stage.bone_count);
    if (cloth.displacement[slot] != nullptr) spans->AddRow("displacement", cloth.displacement[slot], 3 * n);
  }
}

size_t SizeOf(const StateHead& head, const StateSpans& spans) {
  return sizeof(StateHead) + StatePoseBytes(head) + spans.Floats() * sizeof(float) + ContactBytes(head);
}

bool CheckAll(const uint8_t* bytes, size_t size, bool other_model, const Cloth& cloth, StateHead* head,
              Diagnostic* diagnostic) {
  if (!CheckStateBytes(bytes, size, head, diagnostic) ||
      !CheckStateModel(*head, *cloth.model, other_model, diagnostic) ||
      !CheckStateHead(*head, *cloth.model, diagnostic)) {
    return false;
  }
  StateSpans spans;
  ListStateSpans(cloth, PositionOf(*head), &spans);
  if (SizeOf(*head, spans) != size) {
    char allowed[32];
    Text(allowed, sizeof(allowed)).Add(uint64_t{SizeOf(*head, spans)});
    return diagnostic->FailCount(DCLOTH_ERROR_FORMAT, offsetof(StateHead, size), nullptr, size, " bytes", allowed,
                                 "the saved state is damaged; reset the cloth instead");
  }
  return CheckStatePoses(bytes, *head, diagnostic) &&
         CheckStateSpans(bytes, sizeof(StateHead) + StatePoseBytes(*head), spans, diagnostic);
}

// A tick leaves features in this range, a reset zero. Features of the same model are there already.
void ClampFeatures(const Cloth& cloth) {
  const format::FeaturesView& features = cloth.model->features;
  for (uint32_t i = 0; i < features.length; ++i) {
    const float low = features.low[i] < 0 ? features.low[i] : 0, high = features.high[i] > 0 ? features.high[i] : 0;
    float& x = cloth.features[i];
    x = x < low ? low : x > high ? high : x;
  }
}

void TakeHead(const StateHead& head, Cloth* cloth) {
  cloth->tick_count = head.tick_count;
  cloth->stages = head.stages;
  cloth->idle_ticks = head.idle_ticks;
  cloth->work_done = head.tick_share;
  cloth->older_step = head.older_step;
  cloth->clock.Resume(head.since, head.waited, head.lag);
  cloth->root.heading = {head.heading[0], head.heading[1]};
  std::memcpy(cloth->root.position, head.position, sizeof(head.position));
  std::memcpy(cloth->root.velocity, head.velocity, sizeof(head.velocity));
  cloth->root.yaw_rate = head.yaw_rate;
  cloth->root.velocity_age = head.velocity_age;
  std::memcpy(cloth->root.wind, head.wind, sizeof(head.wind));
  cloth->root.started = true;
  cloth->root.jumped = head.jumped != 0;
}

// The cloth is reset: the newest tick goes into slot 0, whichever it was in.
void TakeNumbers(const uint8_t* bytes, const StateHead& head, Cloth* cloth) {
  const size_t pose_bytes = head.joint_count * sizeof(Affine);
  const uint8_t* const floats = bytes + sizeof(StateHead) + StatePoseBytes(head);
  const uint8_t* const poses = bytes + sizeof(StateHead);
  std::memcpy(cloth->pose_before, poses, pose_bytes);
  std::memcpy(cloth->idle_pose, poses + pose_bytes, pose_bytes);
  if (head.older_step > 0) std::memcpy(cloth->pose_older, poses + 2 * pose_bytes, pose_bytes);
  StateSpans spans;
  ListStateSpans(*cloth, PositionOf(head), &spans);
  const uint8_t* from = floats;
  for (uint32_t i = 0; i < spans.count; ++i) {
    const StateSpan& span = spans.spans[i];
    const size_t row_bytes = span.columns * sizeof(float);
    if (span.data == nullptr) {
      from += span.rows * row_bytes;
      continue;
    }
    for (size_t row = 0; row < span.rows; ++row, from += row_bytes)
      std::memcpy(span.data + row * span.stride, from, row_bytes);
  }
  if (head.contact == 0 || head.contact != OwnContact(*cloth)) return;
  std::memcpy(cloth->contact.kept.places, from, ContactBytes(head));
  cloth->contact_clock = {true, head.contact_seconds};
}

}  // namespace

StatePosition PositionOf(const StateHead& head) {
  TickPart part = TickPart::kDone;
  format::FindTickPart(head.part, &part);
  return {head.tick_count, head.stages, {part, head.items_done, {}}, head.idle_floats, head.contact};
}

void ListStateSpans(const Cloth& cloth, const StatePosition& position, StateSpans* spans) {
  if (position.tick_count == 0) return;
  ListKept(cloth, position, spans);
  if (position.work.part != TickPart::kDone) ListTickSpans(cloth, position.stages, position.work, spans);
}

uint32_t ContactOf(const Cloth& cloth) {
  return cloth.tick_count != 0 && cloth.contact_clock.started ? OwnContact(cloth) : 0;
}

uint64_t ModelIdentity(const ModelView& model) {
  return model.identity != 0 ? model.identity : format::Checksum(model.name, std::strlen(model.name));
}

size_t StatePoseBytes(const StateHead& head) {
  const size_t poses = head.tick_count == 0 ? 0 : head.older_step > 0 ? 3 : 2;
  return poses * head.joint_count * sizeof(Affine);
}

size_t StateSize(const Cloth& cloth) {
  const StateHead head = HeadOf(cloth);
  StateSpans spans;
  ListStateSpans(cloth, PositionOf(head), &spans);
  return SizeOf(head, spans);
}

void SaveState(const Cloth& cloth, void* bytes, Diagnostic* diagnostic) {
  StateHead head = HeadOf(cloth);
  StateSpans spans;
  ListStateSpans(cloth, PositionOf(head), &spans);
  const size_t pose_bytes = StatePoseBytes(head), one_pose = head.joint_count * sizeof(Affine);
  if (!CheckStateHead(head, *cloth.model, diagnostic) ||
      !CheckStateSpans(nullptr, sizeof(StateHead) + pose_bytes, spans, diagnostic)) {
    return;
  }
  auto* const begin = static_cast<uint8_t*>(bytes);
  uint8_t* to = begin + sizeof(StateHead);
  if (pose_bytes != 0) {
    std::memcpy(to, cloth.pose_before, one_pose);
    std::memcpy(to + one_pose, cloth.idle_pose, one_pose);
  }
  if (pose_bytes > 2 * one_pose) std::memcpy(to + 2 * one_pose, cloth.pose_older, one_pose);
  to += pose_bytes;
  for (uint32_t i = 0; i < spans.count; ++i) {
    const StateSpan& span = spans.spans[i];
    const size_t row_bytes = span.columns * sizeof(float);
    for (size_t row = 0; row < span.rows; ++row, to += row_bytes)
      std::memcpy(to, span.data + row * span.stride, row_bytes);
  }
  if (head.contact != 0) std::memcpy(to, cloth.contact.kept.places, ContactBytes(head));
  head.size = SizeOf(head, spans);
  std::memcpy(begin, &head, sizeof(head));
  head.checksum = format::Checksum(begin + kStateSummedFrom, static_cast<size_t>(head.size) - kStateSummedFrom);
  std::memcpy(begin, &head, sizeof(head));
}

void RestoreState(const void* bytes, size_t size, bool other_model, Cloth* cloth, Diagnostic* diagnostic) {
  const auto* begin = static_cast<const uint8_t*>(bytes);
  StateHead head;
  if (!CheckAll(begin, size, other_model, *cloth, &head, diagnostic)) return;
  ResetCloth(cloth);
  if (head.tick_count == 0) return;
  std::memset(cloth->coefficients, 0, CoefficientFloats(*cloth->model) * sizeof(float));  // padding is read as zero
  TakeHead(head, cloth);
  TakeNumbers(begin, head, cloth);
  // Coefficients are the file's own: with another one the half second begins anew.
  const ModelView& model = *cloth->model;
  const bool own = head.identity == ModelIdentity(model) && head.idle_floats == IdleStartFloats(model);
  if (head.idle_floats != 0 && !own) cloth->idle_ticks = 0;
  ClampFeatures(*cloth);
  ResumeTick(cloth, PositionOf(head).work.part, head.items_done);
}

}  // namespace dcloth::engine

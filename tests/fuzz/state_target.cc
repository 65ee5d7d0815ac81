// A saved state as a hostile save game brings it: refused without a trace, or taken by a cloth that then
// runs, saves itself and can be reset.
//
// Bytes: which model, frame flags, stages, how the host treats the state, four unused; then the state. A fuzzer does
// not guess checksums, so the state is sealed with the right one unless kRaw is asked for.
#include <algorithm>
#include <cstddef>
#include <cstring>
#include <string>
#include <vector>

#include "engine/format/checksum.h"
#include "engine/src/state/state.h"
#include "tests/attack/variants.h"
#include "tests/fuzz/targets.h"
#include "tests/unit/engine/aligned_bytes.h"
#include "tests/unit/engine/all_finite.h"

namespace dcloth::testing {
namespace {

using Bytes = std::vector<uint8_t>;

constexpr size_t kHostBytes = 8;
constexpr uint8_t kOtherModel = 1, kRaw = 2;  // of the fourth byte
constexpr uint8_t kFlags = DCLOTH_FRAME_PIPELINED | DCLOTH_FRAME_JUMPED | DCLOTH_FRAME_HOLD | DCLOTH_FRAME_FREEZE_IDLE;

// A model and a walk, made once.
struct Garment {
  explicit Garment(const Variant& variant, uint64_t identity) : name(variant.name) {
    TestModel built = BuildModel(variant.spec);
    built.tables->identity = identity;
    bytes = built.Bytes();
    view = AlignedBytes(dcloth_model_storage_size());
    dcloth_model_open(bytes.data(), bytes.size(), view.data(), view.size(), &model, nullptr);
    info.struct_size = sizeof(info);
    dcloth_model_describe(model, &info);
    for (int frame = 0; frame < 40; ++frame) walk.push_back(PoseAt(built.numbers, frame / 100.0));
  }

  std::string name;
  AlignedBytes bytes, view;
  dcloth_model* model = nullptr;
  dcloth_model_info info = {};
  std::vector<std::vector<float>> walk;
};

const std::vector<Garment>& Garments() {
  static const std::vector<Garment> garments = [] {
    std::vector<Garment> made;
    for (const Variant& variant : Variants()) made.emplace_back(variant, 1000 + made.size());
    return made;
  }();
  return garments;
}

class Host {
 public:
  // `bind` 0: the joints of training; else those of a rig in its first pose, as large, much larger or much smaller.
  explicit Host(const Garment& garment, uint8_t bind = 0)
      : garment_(garment),
        storage_(dcloth_cloth_storage_size(garment.model)),
        picture(6 * size_t{garment.info.vertex_count}) {
    dcloth_cloth_create(garment.model, storage_.data(), storage_.size(), &cloth, nullptr);
    if (bind % 4 == 0) return;
    constexpr float kScales[] = {1, 1, 1e4f, 1e-4f};
    std::vector<float> matrices = garment.walk[0];
    for (size_t i = 0; i < matrices.size(); ++i) matrices[i] *= i % 16 < 12 && i % 4 != 3 ? kScales[bind % 4] : 1;
    const dcloth_pose pose = {sizeof(pose), garment.info.joint_count, matrices.data(), 0, 0};
    (void)dcloth_cloth_set_bind_pose(cloth, &pose, nullptr);
  }

  dcloth_status Update(size_t frame, uint32_t stages, uint32_t flags) {
    const std::vector<float>& matrices = garment_.walk[frame % garment_.walk.size()];
    const dcloth_pose pose = {sizeof(pose), garment_.info.joint_count, matrices.data(), 0, 0};
    const dcloth_frame time = {sizeof(time), stages & garment_.info.stages, 0.01f, flags, nullptr};
    dcloth_output output = {};
    output.struct_size = sizeof(output);
    output.vertex_count = garment_.info.vertex_count;
    output.positions = picture.data();
    output.normals = picture.data() + 3 * size_t{garment_.info.vertex_count};
    output.position_stride_bytes = output.normal_stride_bytes = 12;
    return dcloth_cloth_update(cloth, &pose, &time, &output, nullptr);
  }
  // Empty where it fails.
  Bytes Save() const {
    Bytes state(dcloth_cloth_state_size(cloth));
    if (dcloth_cloth_save(cloth, state.data(), state.size(), nullptr) != DCLOTH_OK) state.clear();
    return state;
  }

 private:
  const Garment& garment_;
  AlignedBytes storage_;

 public:
  dcloth_cloth* cloth = nullptr;
  std::vector<float> picture;  // positions, then normals
};

uint32_t StagesOf(uint8_t byte) {
  constexpr uint32_t kStages[] = {DCLOTH_STAGES_STATIC, DCLOTH_STAGES_SKELETON, DCLOTH_STAGES_MESH};
  return kStages[byte % 3];
}

bool SameBits(const std::vector<float>& a, const std::vector<float>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(float)) == 0;
}

void SealIfWhole(AlignedBytes* state) {
  if (state->size() < sizeof(engine::StateHead)) return;
  const uint64_t sum =
      format::Checksum(state->data() + engine::kStateSummedFrom, state->size() - engine::kStateSummedFrom);
  std::memcpy(state->data() + offsetof(engine::StateHead, checksum), &sum, sizeof(sum));
}

std::string BrokenByRefusal(const dcloth_error& error, dcloth_status status, size_t size) {
  switch (status) {
    case DCLOTH_ERROR_FORMAT:
    case DCLOTH_ERROR_VERSION:
    case DCLOTH_ERROR_MODEL:
    case DCLOTH_ERROR_SEMANTICS:
      break;
    default:
      return "a status that dcloth_cloth_restore does not name: " + std::to_string(status);
  }
  if (error.status != status) return "error.status is not the status returned";
  if (std::memchr(error.text, 0, sizeof(error.text)) == nullptr) return "an error text without an end";
  const std::string text = error.text;
  if (text.find("found ") == std::string::npos || text.find("; allowed: ") == std::string::npos)
    return "a text that names nothing found or allowed: " + text;
  if (error.offset_bytes != UINT64_MAX && error.offset_bytes >= std::max<size_t>(size, 1))
    return "an offset outside of the bytes";
  return "";
}

// All but identity and checksum, which are the model's and the bytes', and features, which are clamped to its range.
// Before the first tick there is nothing to keep.
bool IsKept(const AlignedBytes& state, const Bytes& saved) {
  engine::StateHead head;
  std::memcpy(&head, state.data(), sizeof(head));
  if (head.tick_count == 0) return true;
  const size_t numbers = offsetof(engine::StateHead, joint_count);
  const size_t features = sizeof(head) + engine::StatePoseBytes(head), rest = features + 4 * head.feature_count;
  return saved.size() == state.size() &&
         std::memcmp(saved.data() + numbers, state.data() + numbers, features - numbers) == 0 &&
         std::memcmp(saved.data() + rest, state.data() + rest, saved.size() - rest) == 0;
}

// A cloth that took the state, and a twin that takes what the first one saves.
std::string BrokenByRun(const Garment& garment, const AlignedBytes& state, Host* host, uint32_t stages, uint32_t flags,
                        uint8_t bind) {
  const Bytes saved = host->Save();
  if (saved.empty()) return "a state that was taken but cannot be saved";
  if (!IsKept(state, saved)) return "a part of the state that was not taken";
  Host twin(garment, bind);
  if (dcloth_cloth_restore(twin.cloth, saved.data(), saved.size(), 0, nullptr) != DCLOTH_OK)
    return "a saved state that is refused";
  if (twin.Save() != saved) return "a state that changes by saving and restoring";
  for (size_t frame = 0; frame < 8; ++frame) {
    // The host's own flags first; then those that bring every tick to its end.
    const uint32_t now = frame < 4 ? flags : 0;
    if (host->Update(frame, stages, now) != DCLOTH_OK || twin.Update(frame, stages, now) != DCLOTH_OK)
      return "a sound frame was refused";
    if (!AllFinite(host->picture)) return "a vertex or normal that is not finite";
    if (!SameBits(host->picture, twin.picture)) return "another picture than that of its saved twin";
  }
  if (host->Save().empty()) return "a state that cannot be saved any more";
  Host fresh(garment, bind);
  if (dcloth_cloth_reset(host->cloth) != DCLOTH_OK) return "a cloth that cannot be reset";
  for (size_t frame = 0; frame < 4; ++frame) {
    host->Update(frame, stages, flags & DCLOTH_FRAME_PIPELINED);
    fresh.Update(frame, stages, flags & DCLOTH_FRAME_PIPELINED);
    if (!SameBits(host->picture, fresh.picture)) return "a state that outlives a reset";
  }
  return "";
}

// States of a walking garment: before the first tick, between ticks, in a tick, and frozen.
std::vector<Seed> SeedsOf(size_t variant) {
  const Garment& garment = Garments()[variant];
  std::vector<Seed> seeds;
  const auto add = [&](const char* name, const Host& host, uint8_t flags) {
    Bytes bytes = {static_cast<uint8_t>(variant), flags, 2, 0, 0, 0, 0, 0};
    const Bytes state = host.Save();
    bytes.insert(bytes.end(), state.begin(), state.end());
    seeds.push_back({garment.name + "_" + name, bytes, true});
  };
  Host host(garment);
  add("new", host, 0);
  for (size_t frame = 0; frame < 20; ++frame) host.Update(frame, DCLOTH_STAGES_MESH, 0);
  add("between", host, 0);
  for (size_t frame = 20; frame < 26; ++frame) host.Update(frame, DCLOTH_STAGES_MESH, DCLOTH_FRAME_PIPELINED);
  add("in_work", host, DCLOTH_FRAME_PIPELINED);
  for (size_t frame = 0; frame < 80; ++frame) host.Update(26, DCLOTH_STAGES_MESH, DCLOTH_FRAME_FREEZE_IDLE);
  add("idle", host, DCLOTH_FRAME_FREEZE_IDLE);
  Bytes cut = seeds[1].bytes;
  cut.resize(cut.size() - 3);
  seeds.push_back({garment.name + "_cut", cut, false});
  Bytes other = seeds[1].bytes;
  other[0] = static_cast<uint8_t>((variant + 1) % Garments().size());
  Bytes flagged = seeds[1].bytes;
  flagged[3] = kOtherModel;
  seeds.push_back({garment.name + "_flagged", flagged, true});
  seeds.push_back({garment.name + "_other", other, false});
  return seeds;
}

}  // namespace

Verdict FuzzState(const uint8_t* bytes, size_t size) {
  if (size < kHostBytes) return {};
  const Garment& garment = Garments()[bytes[0] % Garments().size()];
  const uint32_t flags = bytes[1] & kFlags, stages = StagesOf(bytes[2]) & garment.info.stages;
  AlignedBytes state(bytes + kHostBytes, size - kHostBytes);
  if ((bytes[3] & kRaw) == 0) SealIfWhole(&state);

  const ChosenIsa isa(bytes[4]);
  const uint8_t bind = bytes[5];
  Host host(garment, bind);
  for (size_t frame = 0; frame < 12; ++frame) host.Update(frame, garment.info.stages, DCLOTH_FRAME_PIPELINED);
  const Bytes before = host.Save();
  dcloth_error error = {};
  error.struct_size = sizeof(error);
  std::memset(error.text, 'x', sizeof(error.text));
  const uint32_t restore = (bytes[3] & kOtherModel) != 0 ? DCLOTH_RESTORE_OTHER_MODEL : 0;
  const dcloth_status status = dcloth_cloth_restore(host.cloth, state.data(), state.size(), restore, &error);
  if (status == DCLOTH_OK) return {BrokenByRun(garment, state, &host, stages, flags, bind), true};
  if (host.Save() != before) return {"a refused state that left a trace", false};
  return {BrokenByRefusal(error, status, state.size()), false};
}

std::vector<Seed> StateSeeds() {
  std::vector<Seed> seeds;
  for (size_t variant = 0; variant < Garments().size(); ++variant) {
    for (Seed& seed : SeedsOf(variant)) seeds.push_back(std::move(seed));
  }
  return seeds;
}

}  // namespace dcloth::testing

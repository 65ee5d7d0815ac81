#include "tests/attack/open_and_run.h"

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <random>
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

// All that can be asked of a frame at once, in buffers of exactly its size.
class Picture {
 public:
  Picture(const dcloth_model_info& info, uint32_t flags, uint32_t format)
      : count_((flags & DCLOTH_OUTPUT_COARSE) != 0     ? info.coarse_vertex_count
               : (flags & DCLOTH_OUTPUT_TEXTURED) != 0 ? info.textured_vertex_count
                                                       : info.vertex_count),
        words_(size_t{10} * count_),
        coordinates_((flags & DCLOTH_OUTPUT_TEXTURED) != 0 ? 0 : size_t{2} * count_) {
    for (size_t i = 0; i < coordinates_.size(); ++i) coordinates_[i] = static_cast<float>(i % 7) / 7;
    output_.struct_size = sizeof(output_);
    output_.vertex_count = count_;
    output_.flags = flags;
    output_.position_format = output_.normal_format = output_.tangent_format = format;
    const uint32_t number = format == DCLOTH_FORMAT_FLOAT32 ? 4 : 2;
    output_.position_stride_bytes = output_.normal_stride_bytes = 3 * number;
    output_.tangent_stride_bytes = 4 * number;
    uint8_t* const bytes = reinterpret_cast<uint8_t*>(words_.data());
    output_.positions = bytes;
    output_.normals = bytes + size_t{3} * number * count_;
    output_.tangents = bytes + size_t{6} * number * count_;
    if (!coordinates_.empty()) output_.texture_coordinates = coordinates_.data();
    output_.texture_stride_bytes = 8;
    output_.bounds = bounds_;
    scratch_ = AlignedBytes(dcloth_output_scratch_size(&output_));
    if (scratch_.size() != 0) output_.scratch = scratch_.data();
    output_.scratch_size = scratch_.size();
  }
  Picture(const Picture&) = delete;
  Picture& operator=(const Picture&) = delete;

  const dcloth_output* output() const { return &output_; }
  // Positions and normals, of floats.
  bool IsFinite() const {
    return AllFinite({words_.begin(), words_.begin() + static_cast<std::ptrdiff_t>(6) * count_});
  }

 private:
  uint32_t count_;
  std::vector<float> words_, coordinates_;
  float bounds_[6] = {};
  AlignedBytes scratch_;
  dcloth_output output_ = {};
};

// Every set of output flags that the model has the vertices for, in floats and in halves.
std::vector<std::unique_ptr<Picture>> Pictures(const dcloth_model_info& info) {
  std::vector<uint32_t> sets = {DCLOTH_OUTPUT_OUTSIDE_BODY, 0};
  if (info.coarse_vertex_count != 0) sets.push_back(DCLOTH_OUTPUT_COARSE);
  if (info.textured_vertex_count != 0) {
    sets.push_back(DCLOTH_OUTPUT_TEXTURED);
    sets.push_back(DCLOTH_OUTPUT_TEXTURED | DCLOTH_OUTPUT_OUTSIDE_BODY);
  }
  std::vector<std::unique_ptr<Picture>> pictures;
  for (const uint32_t flags : sets) {
    for (const uint32_t format : {DCLOTH_FORMAT_FLOAT32, DCLOTH_FORMAT_FLOAT16})
      pictures.push_back(std::make_unique<Picture>(info, flags, format));
  }
  return pictures;
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
  const std::vector<std::unique_ptr<Picture>> pictures = Pictures(info);
  const dcloth_output* const output = pictures[0]->output();
  if (dcloth_cloth_skin(cloth, &pose, 0.5f, output, nullptr) != DCLOTH_OK) return "a sound frame was refused";
  *finite = pictures[0]->IsFinite();
  // A body of a metre that comes apart, then frame after frame a smaller one.
  float metres = 0.5f;
  for (const std::unique_ptr<Picture>& picture : pictures) {
    const std::vector<float> twisted = TwistedPose(info.joint_count, static_cast<uint32_t>(1e3f * metres), metres);
    const dcloth_pose to = {sizeof(to), info.joint_count, twisted.data(), 0, 0};
    const dcloth_frame frame = {sizeof(frame), info.stages, 0.02f, 0, nullptr};
    if (dcloth_cloth_update(cloth, &to, &frame, picture->output(), nullptr) != DCLOTH_OK)
      return "a sound update was refused";
    metres *= 0.7f;
  }
  // Refused where the model's own joints have no inverse.
  const dcloth_status taken = dcloth_cloth_set_bind_pose(cloth, &pose, nullptr);
  if (taken != DCLOTH_OK && taken != DCLOTH_ERROR_POSE) return "a bind pose's status: " + std::to_string(taken);
  if (dcloth_cloth_tick(cloth, &pose, info.stages, nullptr) != DCLOTH_OK ||
      dcloth_cloth_skin(cloth, &pose, 0.5f, output, nullptr) != DCLOTH_OK)
    return "a sound frame was refused in a rig of its own";
  return dcloth_cloth_reset(cloth) == DCLOTH_OK ? "" : "a cloth that cannot be reset";
}

}  // namespace

std::vector<float> TwistedPose(uint32_t joint_count, uint32_t seed, float metres) {
  std::vector<float> matrices = UprightPose(joint_count);
  std::mt19937 random(seed);
  const auto between = [&](float most) { return std::uniform_real_distribution<float>(-most, most)(random); };
  for (uint32_t j = 0; j < joint_count; ++j) {
    float* const matrix = matrices.data() + size_t{16} * j;
    const float turn = between(2), c = std::cos(turn), s = std::sin(turn);
    const size_t a = j % 3, b = (j + 1) % 3;
    matrix[5 * a] = matrix[5 * b] = c;
    matrix[4 * a + b] = -s;
    matrix[4 * b + a] = s;
    for (const uint32_t row : {3, 7, 11}) matrix[row] = between(metres);
  }
  return matrices;
}

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

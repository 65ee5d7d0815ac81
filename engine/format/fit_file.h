// A garment laid onto a character that its model was not trained on, as the fit library makes it (fit/), a .dcloth-fit
// file keeps it and a cloth wears it: little-endian, the same on every platform, used where it lies.
//
//   FitHead, FitJoint [joint_count]; where the character's skin was given also the garment's cut f32 [n, 3], the body's
//   positions f32 [b, 3] and weights f32 [b, influences], and its joints u8 [b, influences]. Each begins on kAlignment;
//   zeros lie between them.
#ifndef DCLOTH_ENGINE_FORMAT_FIT_FILE_H_
#define DCLOTH_ENGINE_FORMAT_FIT_FILE_H_

#include <cstddef>
#include <cstdint>

#include "engine/format/checksum.h"
#include "engine/format/limits.h"
#include "engine/format/view.h"

namespace dcloth::format {

constexpr uint8_t kFitMagic[4] = {'D', 'C', 'L', 'F'};
constexpr uint32_t kFitVersion = 1;
constexpr uint32_t kMaxHostJoints = 4096;

struct FitHead {
  uint8_t magic[4];
  uint32_t version;
  uint64_t checksum;                                     // of all that follows
  uint64_t size;                                         // of the whole, this head included
  uint64_t figure;                                       // FigureOf the model
  uint32_t joint_count, host_joint_count;                // of the model; of the character's poses
  uint32_t vertex_count, body_vertex_count, influences;  // of the arrays: those of the model, or all 0
  float clearance, reach;                                // of the body, metres; 0 without one
  uint32_t unused;                                       // 0
  double scale;                                          // the character's size over the figure's
  char garment[64];                                      // the model's name, cut where it is longer
};

struct FitJoint {
  double motion[3][4];  // P^-1 F of fit/rig_fit.h in the model's axes and the character's metres
  uint32_t host;        // index of the character's joint
  char name[60];        // its name; empty where it has none or a longer one
};

static_assert(sizeof(FitHead) == 136 && offsetof(FitHead, scale) == 64 && sizeof(FitJoint) == 160,
              "the same on every platform");

constexpr size_t kFitSummedFrom = offsetof(FitHead, size);

// Where each part begins, in bytes.
struct FitLayout {
  size_t joints, positions, body_positions, body_weights, body_joints, size;
};

inline FitLayout LayoutOf(const FitHead& head) {
  FitLayout at = {};
  const auto place = [&at](size_t bytes) {
    const size_t begin = at.size;
    at.size += (bytes + kAlignment - 1) / kAlignment * kAlignment;
    return begin;
  };
  const size_t b = head.body_vertex_count, held = b * head.influences;
  place(sizeof(FitHead));
  at.joints = place(head.joint_count * sizeof(FitJoint));
  at.positions = place(size_t{3} * head.vertex_count * sizeof(float));
  at.body_positions = place(3 * b * sizeof(float));
  at.body_weights = place(held * sizeof(float));
  at.body_joints = place(held);
  return at;
}

// What a fit depends on: the same for every precision of a garment.
inline uint64_t FigureOf(const ModelView& model) {
  const uint64_t sums[] = {
      Checksum(model.inverse_bind, size_t{12} * model.joint_count * sizeof(float)),
      Checksum(model.template_positions, size_t{3} * model.vertex_count * sizeof(float)),
      Checksum(model.body.positions, size_t{3} * model.body.vertex_count * sizeof(float)),
      Checksum(model.body.faces, size_t{3} * model.body.face_count * sizeof(uint16_t)),
  };
  return Checksum(sums, sizeof(sums));
}

}  // namespace dcloth::format

#endif  // DCLOTH_ENGINE_FORMAT_FIT_FILE_H_

#include "engine/src/contact/limb_cores.h"

#include <cmath>
#include <cstring>

namespace dcloth::engine {
namespace {

using format::BodyView;
using format::ModelView;

constexpr float kLeastBone = 0.05f;   // metres; shorter bones belong to the limb above
constexpr float kBehindTip = 0.025f;  // metres: the ball around a limb's end stays in the skin
constexpr float kOwnWeight = 0.25f;   // of skin that shows how thick a bone's limb is
constexpr float kTipWeight = 0.5f;    // of skin that shows where a limb ends
constexpr float kThickness = 0.5f;    // of its length: a limb is no thicker
constexpr float kFriction = 0.6f;
constexpr float kPartOfWay = 0.5f;  // of the core's radius
constexpr int kMostParts = 8;
constexpr float kSectorsAQuarter = 0.25f * kCoreSectors;
constexpr float kFar = 1e9f;

float Length(Vecf v) { return std::sqrt(Dot(v, v)); }

// Where a joint is in the bind pose: B^-1, a rotation with a scale, takes it to the origin.
Vecf BindPosition(const float* inverse) {
  float out[3];
  for (int r = 0; r < 3; ++r) {
    float sum = 0, squared = 0;
    for (int k = 0; k < 3; ++k) {
      sum += inverse[4 * k + r] * inverse[4 * k + 3];
      squared += inverse[4 * k + r] * inverse[4 * k + r];
    }
    out[r] = squared > 0 ? -sum / squared : 0.0f;
  }
  return VecfAt(out);
}

// Angles around a bone, 0 to 4, without a call of libm: of a square around it in place of a circle.
float Around(float x, float y) {
  const float sum = std::fabs(x) + std::fabs(y), share = sum > 0 ? x / sum : 1.0f;
  return y >= 0 ? 1 - share : 3 + share;
}

// Measures the cores of one body.
class Measure {
 public:
  Measure(const ModelView& model, const LimbCores& limbs) : model_(model), body_(model.body), limbs_(limbs) {
    std::memset(core_of_, kNone, sizeof(core_of_));
  }

  void All() {
    LimbCore core;
    for (uint32_t j = 0; j < model_.joint_count; ++j) is_bone_[j] = FindBone(j, &core);
    for (uint32_t j = 0; j < model_.joint_count; ++j) {
      if (*limbs_.count == kMostCores || !FindBone(j, &core) || !FindRadii(&core)) continue;
      core_of_[j] = static_cast<uint8_t>(*limbs_.count);
      limbs_.cores[(*limbs_.count)++] = core;
    }
    Join();
  }

 private:
  static constexpr uint8_t kNone = 0xFF;

  Vecf JointAt(uint32_t j) const { return BindPosition(model_.inverse_bind + size_t{12} * j); }

  // The child that is furthest away; joint_count where there is none.
  uint32_t ChildOf(uint32_t joint) const {
    uint32_t found = model_.joint_count;
    float furthest = 0;
    for (uint32_t j = 0; j < model_.joint_count; ++j) {
      if (model_.parents[j] != joint) continue;
      const float apart = Length(JointAt(j) - JointAt(joint));
      if (apart > furthest) furthest = apart, found = j;
    }
    return found;
  }

  float WeightOf(size_t vertex, uint32_t a, uint32_t b) const {
    float weight = 0;
    for (size_t k = 0; k < body_.influences; ++k) {
      const size_t i = vertex * body_.influences + k;
      weight += body_.joints[i] == a || body_.joints[i] == b ? body_.weights[i] : 0.0f;
    }
    return weight;
  }

  // How far the skin of a joint, and of its child, reaches along a direction.
  float ReachOf(uint32_t joint, uint32_t child, Vecf direction) const {
    float reach = 0;
    for (size_t v = 0; v < body_.vertex_count; ++v) {
      if (WeightOf(v, joint, child) < kTipWeight) continue;
      const float along = Dot(VecfAt(body_.positions + 3 * v) - JointAt(joint), direction);
      reach = along > reach ? along : reach;
    }
    return reach;
  }

  // A bone leads to the child, or, at a limb's end, to the tip of the skin.
  bool FindBone(uint32_t joint, LimbCore* core) const {
    *core = {};
    const uint32_t child = ChildOf(joint), parent = model_.parents[joint];
    if (parent == format::kNoParent) return false;
    const bool leaf = child == model_.joint_count;
    Vecf way = leaf ? JointAt(joint) - JointAt(parent) : JointAt(child) - JointAt(joint);
    const float apart = Length(way);
    if (!(apart > 0)) return false;
    const Vecf along = (1 / apart) * way;
    core->length = leaf ? ReachOf(joint, joint, along) - kBehindTip : apart;
    if (!leaf && ChildOf(child) == model_.joint_count) {
      const float rest = ReachOf(child, child, along) - kBehindTip;
      if (rest < kLeastBone) core->length = ReachOf(joint, child, along) - kBehindTip;
    }
    if (!(core->length >= kLeastBone)) return false;
    core->joint = static_cast<uint16_t>(joint);
    core->start = JointAt(joint);
    core->axes[2] = along;
    const Vecf helper = std::fabs(along.x) < 0.6f ? Vecf{1, 0, 0} : Vecf{0, 0, 1};
    const Vecf across = Cross(helper, along);
    core->axes[0] = (1 / Length(across)) * across;
    core->axes[1] = Cross(along, core->axes[0]);
    return true;
  }

  // Numbers the limbs, and finds where two cores bend with each other: not at ankles and wrists, where the limb ends.
  void Join() {
    uint8_t limbs = 0;
    bool has_below[kMostCores] = {};
    for (uint32_t k = 0; k < *limbs_.count; ++k) {
      limbs_.cores[k].limb = kNone;
      if (Above(k) != kNone) has_below[Above(k)] = true;
    }
    for (uint32_t k = 0; k < *limbs_.count; ++k) {
      if (Above(k) == kNone || !has_below[k]) continue;
      limbs_.cores[k].bends_at_start = limbs_.cores[Above(k)].bends_at_end = true;
    }
    for (uint32_t pass = 0; pass < *limbs_.count; ++pass) {  // whichever order the joints have
      for (uint32_t k = 0; k < *limbs_.count; ++k) {
        LimbCore& core = limbs_.cores[k];
        if (core.limb == kNone) core.limb = Above(k) == kNone ? limbs++ : limbs_.cores[Above(k)].limb;
      }
    }
  }

  // The core of the same limb that ends where `k` begins: what is not as thick as a trunk.
  uint8_t Above(uint32_t k) const {
    const LimbCore& core = limbs_.cores[k];
    const uint8_t above = core_of_[model_.parents[core.joint]];
    if (above == kNone) return kNone;
    const Vecf end = limbs_.cores[above].start + limbs_.cores[above].length * limbs_.cores[above].axes[2];
    return Length(end - core.start) < kLeastBone ? above : kNone;
  }

  // False where the skin makes no limb of it, or the garment cannot touch it.
  bool FindRadii(LimbCore* core) const {
    const uint32_t next = ChildOf(core->joint);
    const uint32_t child = next < model_.joint_count && !is_bone_[next] ? next : core->joint;
    for (auto& slice : core->radii) {
      for (float& radius : slice) radius = kFar;
    }
    core->start_radius = core->end_radius = kFar;
    core->touched_by = 0xFF;
    for (size_t v = 0; v < body_.vertex_count; ++v) {
      const float weight = WeightOf(v, core->joint, child);
      if (weight < kOwnWeight) continue;
      const Vecf from = VecfAt(body_.positions + 3 * v) - core->start;
      const Vecf p = {Dot(core->axes[0], from), Dot(core->axes[1], from), Dot(core->axes[2], from)};
      TakeSkin(p, core);
      if (weight >= kTipWeight && body_.touched_by != nullptr && p.z > 0 && p.z < core->length)
        core->touched_by &= body_.touched_by[v];
    }
    if (core->touched_by == 0) return false;
    FillGaps(core);
    float first = kFar, last = kFar;
    for (int k = 0; k < kCoreSectors; ++k) {
      for (int s = 0; s < kCoreSlices; ++s) {
        float& radius = core->radii[s][k];
        radius *= kCoreOfSkin;
        core->widest = radius > core->widest ? radius : core->widest;
      }
      first = core->radii[0][k] < first ? core->radii[0][k] : first;
      last = core->radii[kCoreSlices - 1][k] < last ? core->radii[kCoreSlices - 1][k] : last;
    }
    if (!(core->widest > 0 && core->widest < kThickness * core->length + 0.02f)) return false;
    core->start_radius = kCoreOfSkin * core->start_radius < first ? kCoreOfSkin * core->start_radius : first;
    core->end_radius = kCoreOfSkin * core->end_radius < last ? kCoreOfSkin * core->end_radius : last;
    return true;
  }

  static void TakeSkin(Vecf p, LimbCore* core) {
    const float slice = p.z / core->length * kCoreSlices;
    if (slice < 1) {
      const float apart = Length(p);
      core->start_radius = apart < core->start_radius ? apart : core->start_radius;
    }
    if (slice > kCoreSlices - 1) {
      const float apart = Length(p - Vecf{0, 0, core->length});
      core->end_radius = apart < core->end_radius ? apart : core->end_radius;
    }
    if (slice < 0 || slice >= kCoreSlices) return;
    const int sector = static_cast<int>(Around(p.x, p.y) * kSectorsAQuarter) % kCoreSectors;
    const float apart = std::sqrt(p.x * p.x + p.y * p.y);
    if (!(apart < core->radii[static_cast<int>(slice)][sector])) return;
    core->radii[static_cast<int>(slice)][sector] = apart;
  }

  // Where no skin was seen: the least radius beside, around the bone before along it.
  static void FillGaps(LimbCore* core) {
    for (int pass = 0; pass < kCoreSlices + kCoreSectors; ++pass) {
      const LimbCore seen = *core;
      for (int s = 0; s < kCoreSlices; ++s) {
        for (int k = 0; k < kCoreSectors; ++k) {
          if (seen.radii[s][k] < kFar) continue;
          const auto take = [&](int slice, int sector) {
            if (!(seen.radii[slice][sector] < core->radii[s][k])) return;
            core->radii[s][k] = seen.radii[slice][sector];
          };
          take(s, (k + 1) % kCoreSectors);
          take(s, (k + kCoreSectors - 1) % kCoreSectors);
          if (core->radii[s][k] < kFar) continue;
          if (s > 0) take(s - 1, k);
          if (s + 1 < kCoreSlices) take(s + 1, k);
        }
      }
    }
  }

  const ModelView& model_;
  const BodyView& body_;
  const LimbCores& limbs_;
  bool is_bone_[format::kMaxJoints];
  uint8_t core_of_[format::kMaxJoints];
};

}  // namespace

LimbCores PlaceLimbCores(Arena* arena) { return {arena->Take<LimbCore>(kMostCores), arena->Take<uint32_t>(1)}; }

void MeasureLimbCores(const ModelView& model, const LimbCores& limbs) {
  *limbs.count = 0;
  if (model.parents != nullptr) Measure(model, limbs).All();
}

void PoseBone(const float* matrix, LimbCore* core) {
  const auto turned = [&](Vecf v) {
    return Vecf{Dot(VecfAt(matrix), v), Dot(VecfAt(matrix + 4), v), Dot(VecfAt(matrix + 8), v)};
  };
  core->now.start = turned(core->start) + Vecf{matrix[3], matrix[7], matrix[11]};
  for (int i = 0; i < 3; ++i) {
    core->out[i] = turned(core->axes[i]);
    const float squared = Dot(core->out[i], core->out[i]);
    core->now.axes[i] = (squared > 0 ? 1 / squared : 0.0f) * core->out[i];
  }
}

float RadiusAt(const LimbCore& core, Vecf p) {
  if (p.z <= 0 && !core.bends_at_start) return core.start_radius;
  if (p.z >= core.length && !core.bends_at_end) return core.end_radius;
  float around = Around(p.x, p.y) * kSectorsAQuarter - 0.5f, along = p.z / core.length * kCoreSlices - 0.5f;
  constexpr float kLast = kCoreSlices - 1.001f;
  along = along > 0 ? (along < kLast ? along : kLast) : 0.0f;
  if (around < 0) around += kCoreSectors;
  if (!(around < kCoreSectors)) around = 0;  // what is not a number
  const int slice = static_cast<int>(along), sector = static_cast<int>(around) % kCoreSectors;
  const int next = (sector + 1) % kCoreSectors;
  const float u = along - static_cast<float>(slice), w = around - static_cast<float>(static_cast<int>(around));
  const float *low = core.radii[slice], *high = core.radii[slice + 1];
  return (1 - u) * ((1 - w) * low[sector] + w * low[next]) + u * ((1 - w) * high[sector] + w * high[next]);
}

float LeaveCore(const LimbCore& core, Vecf* p, Vecf* normal) {
  const float z = NearestOnBone(core, *p);
  const Vecf away = {p->x, p->y, p->z - z};
  const float squared = Dot(away, away);
  if (!(squared < core.widest * core.widest)) return 0;
  const float radius = RadiusAt(core, *p), apart = std::sqrt(squared);
  if (!(apart < radius)) return 0;
  *normal = apart > 1e-6f ? (1 / apart) * away : Vecf{1, 0, 0};
  *p = Vecf{0, 0, z} + radius * *normal;
  return radius - apart;
}

bool Slide(const LimbCore& core, Vecf from, Vecf* to) {
  const Vecf way = *to - from;
  const float parts = Length(way) / (kPartOfWay * core.widest);
  const int count = parts < kMostParts ? 1 + static_cast<int>(parts) : kMostParts;
  const Vecf part = (1 / static_cast<float>(count)) * way;
  Vecf at = from, normal;
  bool met = false;
  for (int k = 0; k < count; ++k) {
    const Vecf before = at;
    at = at + part;
    const float depth = LeaveCore(core, &at, &normal);
    if (!(depth > 0)) continue;
    met = true;
    Vecf slip = at - before;
    slip = slip - Dot(slip, normal) * normal;
    const float slid = Length(slip);
    if (!(slid > 1e-6f)) continue;
    const float held = kFriction * depth / slid;
    at = at - (held < 1 ? held : 1.0f) * slip;
    LeaveCore(core, &at, &normal);
  }
  if (met) *to = at;
  return met;
}

bool LeadsThrough(const LimbCore& core, Vecf a, Vecf b) {
  const float x = b.x - a.x, y = b.y - a.y, squared = x * x + y * y;
  const float nearest = squared > 0 ? -(a.x * x + a.y * y) / squared : 0.0f;
  if (!(nearest > 0 && nearest < 1)) return false;
  const Vecf middle = a + nearest * (b - a);
  if (middle.z < -core.start_radius || middle.z > core.length + core.end_radius) return false;
  const float radius = RadiusAt(core, middle);
  return middle.x * middle.x + middle.y * middle.y < radius * radius;
}

}  // namespace dcloth::engine

#include "engine/src/body/limb_cores.h"

#include <cmath>
#include <initializer_list>

namespace dcloth::engine {
namespace {

using format::BodyView;
using format::ModelView;

constexpr float kLeastBone = 0.05f;    // metres
constexpr float kOwnWeight = 0.5f;     // of skin that shows how thick a bone's limb is
constexpr float kLeastRadius = 0.02f;  // metres
constexpr float kFurthest = 0.4f;      // metres in the bind pose: bones further from cloth are not under it
constexpr float kBehind = 0.2f;        // metres from a bone: cloth further behind it is not on its way around it
constexpr float kOpposite = 0.5f;      // cosine of the angle to straight behind
constexpr float kShaft = 0.3f;         // of a bone: nearer to its start, cloth is held by the limb above
constexpr float kHinge = 0.15f;        // of a bone, before a hinge: cloth there goes around both limbs
constexpr float kLikeBone = 0.5f;      // of a bone's length: the one before it is a limb if so long
constexpr float kClose = 0.08f, kLoose = 0.14f;    // metres from a bone in the bind pose: a sleeve, a skirt
constexpr float kOver = 0.25f, kMostOver = 0.01f;  // of a core's radius; metres
constexpr float kFar = 1e18f;

// Where a joint is in the bind pose: B^-1, a rotation with a scale, takes it to the origin.
void BindPosition(const float* inverse, float* out) {
  for (size_t r = 0; r < 3; ++r) {
    float sum = 0, squared = 0;
    for (size_t k = 0; k < 3; ++k) {
      sum += inverse[4 * k + r] * inverse[4 * k + 3];
      squared += inverse[4 * k + r] * inverse[4 * k + r];
    }
    out[r] = squared > 0 ? -sum / squared : 0.0f;
  }
}

void FillAround(LimbCore* core) {
  const float along[3] = {core->to[0] - core->from[0], core->to[1] - core->from[1], core->to[2] - core->from[2]};
  float(&first)[3] = core->around[0], (&second)[3] = core->around[1];
  size_t least = 0;
  for (size_t c = 1; c < 3; ++c) least = std::fabs(along[c]) < std::fabs(along[least]) ? c : least;
  const float lengthwise = along[least] / Dot(along, along);
  for (size_t c = 0; c < 3; ++c) first[c] = (c == least ? 1.0f : 0.0f) - lengthwise * along[c];
  for (size_t c = 0; c < 3; ++c) {
    const size_t next = (c + 1) % 3, last = (c + 2) % 3;
    second[c] = along[next] * first[last] - along[last] * first[next];
  }
  for (float(&vector)[3] : core->around) {
    const float length = std::sqrt(Dot(vector, vector));
    for (float& c : vector) c /= length;
  }
}

float WeightOf(const BodyView& body, size_t vertex, uint32_t joint) {
  float weight = 0;
  for (size_t k = 0; k < body.influences; ++k) {
    const size_t i = vertex * body.influences + k;
    weight += body.joints[i] == joint ? body.weights[i] : 0.0f;
  }
  return weight;
}

// Radii and classes, from the skin that the joint moves; false where nothing is left. The first slice is no core: what
// lies around a joint when it is bound sticks out when it is bent. Around the other end a ball may be.
bool MeasureCore(const BodyView& body, uint32_t child, LimbCore* core) {
  const float along[3] = {core->to[0] - core->from[0], core->to[1] - core->from[1], core->to[2] - core->from[2]};
  float squared[kCoreSlices][kCoreSectors], beyond = kFar;
  bool own[kCoreSlices] = {};
  for (auto& slice : squared) {
    for (float& least : slice) least = kFar;
  }
  core->touched_by = 0xFF;
  for (size_t v = 0; v < body.vertex_count; ++v) {
    const float weight = WeightOf(body, v, core->joint);
    if (weight + WeightOf(body, v, child) >= kOwnWeight) {
      const float past[3] = {body.positions[3 * v] - core->to[0], body.positions[3 * v + 1] - core->to[1],
                             body.positions[3 * v + 2] - core->to[2]};
      const float tip = Dot(past, along) / LengthOf(*core);
      core->tip = tip > core->tip ? tip : core->tip;
    }
    if (!(weight > 0)) continue;
    const OnBone on = InBindPose(*core, body.positions + 3 * v);
    if (on.along >= 1 && on.squared < beyond) beyond = on.squared;
    if (!(on.along > 0 && on.along < 1)) continue;
    const size_t slice = SliceAt(on.along);
    float* least = &squared[slice][SectorAt(core->around, on.away)];
    *least = on.squared < *least ? on.squared : *least;
    if (weight < kOwnWeight) continue;
    own[slice] = true;
    if (body.touched_by != nullptr) core->touched_by &= body.touched_by[v];
  }
  float widest = 0, last = 0;
  for (size_t s = 1; s < kCoreSlices; ++s) {
    last = 0;
    for (size_t k = 0; k < kCoreSectors; ++k) {
      const float radius = own[s] && squared[s][k] < kFar ? kCoreOfFree * std::sqrt(squared[s][k]) : 0.0f;
      core->radii[s][k] = radius >= kLeastRadius ? radius : 0.0f;
      last = core->radii[s][k] > last ? core->radii[s][k] : last;
    }
    widest = last > widest ? last : widest;
  }
  const float ball = kCoreOfFree * std::sqrt(beyond);
  core->cap = ball < last ? ball : last;
  return widest > 0 && core->touched_by != 0;
}

// Unit vector across the posed bone to the side of a place in the bind pose; false on the bone itself.
bool SideOf(const LimbCore& core, const OnBone& was, float* out) {
  const float u = Dot(core.around[0], was.away), w = Dot(core.around[1], was.away);
  for (size_t c = 0; c < 3; ++c) out[c] = u * core.posed_around[0][c] + w * core.posed_around[1][c];
  const float length = std::sqrt(Dot(out, out));
  if (!(length > 0)) return false;
  for (size_t c = 0; c < 3; ++c) out[c] /= length;
  return true;
}

float Closeness(const OnBone& was) {
  const float share = (kLoose - std::sqrt(was.squared)) / (kLoose - kClose);
  return share < 0 ? 0.0f : share < 1 ? share : 1.0f;
}

bool IsBehind(const LimbCore& core, const float* bound, const float* point, float* out, float* middle) {
  const OnBone was = InBindPose(core, bound),
               is = PlaceOnBone(core.posed_from, core.along, core.inverse_squared, point);
  const bool free = core.above == kMostCores;
  if (!(was.along > (free ? kShaft : -kHinge) && is.along > (free ? kShaft : 0.0f)) || !SideOf(core, was, out))
    return false;
  float across[3];  // also beyond the bone's end
  for (size_t c = 0; c < 3; ++c) across[c] = point[c] - core.posed_from[c] - is.along * core.along[c];
  const float apart = std::sqrt(Dot(across, across));
  if (!(apart < kBehind * core.scale)) return false;
  const float height = Dot(across, out);
  if (!(height < -kOpposite * (1 - Closeness(was)) * apart)) return false;
  for (size_t c = 0; c < 3; ++c) middle[c] = point[c] - height * out[c];
  float away[3], radius;
  return IsInCore(core, middle, away, &radius);
}

// A limb is longer than thick; a trunk is not.
bool IsLimb(const LimbCore& core) {
  float widest = 0;
  for (const auto& slice : core.radii) {
    for (const float radius : slice) widest = radius > widest ? radius : widest;
  }
  return LengthOf(core) > 2 * widest;
}

// The core of the limb, of joint `parent`, that ends where `core` begins; kMostCores where there is none, as at hips
// and shoulders.
uint32_t CoreAbove(const LimbCores& limbs, const LimbCore& core, uint32_t parent) {
  for (uint32_t k = 0; k < *limbs.count; ++k) {
    const LimbCore& other = limbs.cores[k];
    const bool ends = other.to[0] == core.from[0] && other.to[1] == core.from[1] && other.to[2] == core.from[2];
    if (other.joint == parent && ends && LengthOf(other) >= kLikeBone * LengthOf(core) && IsLimb(other)) return k;
  }
  return kMostCores;
}

// The first slice of a limb at a hinge, as wide as the ball around the hinge: between the two no cloth is lost.
void JoinAbove(float cap, LimbCore* core) {
  for (size_t k = 0; k < kCoreSectors; ++k) core->radii[0][k] = cap < core->radii[1][k] ? cap : core->radii[1][k];
}

}  // namespace

OnBone InBindPose(const LimbCore& core, const float* point) {
  const float along[3] = {core.to[0] - core.from[0], core.to[1] - core.from[1], core.to[2] - core.from[2]};
  return PlaceOnBone(core.from, along, 1 / Dot(along, along), point);
}

size_t SliceAt(float along) {
  const auto slice = static_cast<size_t>(along * kCoreSlices);
  return slice < kCoreSlices ? slice : kCoreSlices - 1;
}

// Eighths of a turn, in no order.
size_t SectorAt(const float (&around)[2][3], const float* away) {
  static_assert(kCoreSectors == 8);
  const float u = Dot(around[0], away), w = Dot(around[1], away);
  return (u < 0 ? 4u : 0u) + (w < 0 ? 2u : 0u) + (std::fabs(u) < std::fabs(w) ? 1u : 0u);
}

float LengthOf(const LimbCore& core) {
  const float along[3] = {core.to[0] - core.from[0], core.to[1] - core.from[1], core.to[2] - core.from[2]};
  return std::sqrt(Dot(along, along));
}

LimbCores PlaceLimbCores(Arena* arena) { return {arena->Take<LimbCore>(kMostCores), arena->Take<uint32_t>(1)}; }

void MeasureLimbCores(const ModelView& model, const LimbCores& limbs) {
  *limbs.count = 0;
  if (model.parents == nullptr) return;
  for (uint32_t child = 0; child < model.joint_count && *limbs.count < kMostCores; ++child) {
    const uint32_t joint = model.parents[child];
    if (joint == format::kNoParent) continue;
    LimbCore core = {};
    core.joint = joint;
    BindPosition(model.inverse_bind + size_t{12} * joint, core.from);
    BindPosition(model.inverse_bind + size_t{12} * child, core.to);
    const float along[3] = {core.to[0] - core.from[0], core.to[1] - core.from[1], core.to[2] - core.from[2]};
    if (!(Dot(along, along) > kLeastBone * kLeastBone)) continue;
    FillAround(&core);
    if (MeasureCore(model.body, child, &core)) limbs.cores[(*limbs.count)++] = core;
  }
  for (uint32_t k = 0; k < *limbs.count; ++k) limbs.cores[k].below = kMostCores;
  for (uint32_t k = 0; k < *limbs.count; ++k) {
    LimbCore& core = limbs.cores[k];
    core.above = CoreAbove(limbs, core, model.parents[core.joint]);
    if (core.above == kMostCores) continue;
    JoinAbove(limbs.cores[core.above].cap, &core);
    core.bends = limbs.cores[core.above].bends = true;
    limbs.cores[core.above].below = k;
  }
}

void PoseLimbCores(const float* matrices, const LimbCores& limbs) {
  for (uint32_t k = 0; k < *limbs.count; ++k) {
    LimbCore& core = limbs.cores[k];
    const float* matrix = matrices + size_t{12} * core.joint;
    float end[3], bound = 0, widest = core.cap;
    Transform(matrix, core.from, core.posed_from);
    Transform(matrix, core.to, end);
    for (size_t c = 0; c < 3; ++c) {
      core.along[c] = end[c] - core.posed_from[c];
      bound += (core.to[c] - core.from[c]) * (core.to[c] - core.from[c]);
    }
    for (size_t a = 0; a < 2; ++a) {
      for (size_t r = 0; r < 3; ++r) core.posed_around[a][r] = Dot(matrix + 4 * r, core.around[a]);
    }
    const float squared = Dot(core.along, core.along);
    core.inverse_squared = squared > 0 ? 1 / squared : 0.0f;
    core.scale = std::sqrt(squared / bound);
    for (const auto& slice : core.radii) {
      for (const float radius : slice) widest = radius > widest ? radius : widest;
    }
    core.reach = widest * core.scale;
  }
}

uint32_t CoresUnder(const LimbCores& limbs, const float* point, uint8_t bit, uint32_t* nearest_core) {
  OnBone found[kMostCores], nearest = {};
  nearest.squared = kFar;
  *nearest_core = kMostCores;
  for (uint32_t k = 0; k < *limbs.count; ++k) {
    found[k] = InBindPose(limbs.cores[k], point);
    const bool counts = bit == 0 || (limbs.cores[k].touched_by & bit) != 0;
    if (!counts) found[k].squared = kFar;
    if (found[k].squared < nearest.squared) nearest = found[k], *nearest_core = k;
  }
  uint32_t under = 0;
  for (uint32_t k = 0; k < *limbs.count; ++k) {
    if (!(found[k].squared < kFurthest * kFurthest)) continue;
    bool below = true;
    for (const float* end : {limbs.cores[k].from, limbs.cores[k].to}) {
      const float apart[3] = {end[0] - point[0], end[1] - point[1], end[2] - point[2]};
      below &= Dot(apart, nearest.away) < 0;
    }
    if (below) under |= 1u << k;
  }
  for (uint32_t k = 0; k < *limbs.count; ++k) {
    const uint32_t above = limbs.cores[k].above;
    const bool is_foot = above != kMostCores && limbs.cores[above].above != kMostCores;
    if (is_foot && found[k].squared < kFar) under |= (under >> above & 1u) << k;
  }
  return under;
}

bool ReachesInto(const LimbCore& core, const float* centre, float radius) {
  const float apart = core.reach + radius;
  return PlaceOnBone(core.posed_from, core.along, core.inverse_squared, centre).squared <= apart * apart;
}

bool IsInCore(const LimbCore& core, const OnBone& on, float* away, float* radius) {
  const float metres = on.along < 1 ? core.radii[SliceAt(on.along)][SectorAt(core.posed_around, on.away)] : core.cap;
  *radius = metres * core.scale;
  for (size_t c = 0; c < 3; ++c) away[c] = on.away[c];
  return on.squared < *radius * *radius;
}

float SkinOver(const LimbCore& core, float radius) {
  const float most = kMostOver * core.scale, over = kOver * radius;
  if (!core.bends) return 0;
  return over < most ? over : most;
}

void LiftAcross(const LimbCore& core, float* position) {
  float away[3], radius;
  if (!IsInCore(core, position, away, &radius)) return;
  const float distance = std::sqrt(Dot(away, away)), height = radius + SkinOver(core, radius);
  for (size_t c = 0; c < 3 && distance > 0; ++c) position[c] += (height - distance) / distance * away[c];
}

float OwnSide(const LimbCore& core, const float* bound, float* out) {
  const OnBone was = InBindPose(core, bound);
  return SideOf(core, was, out) ? Closeness(was) : 0.0f;
}

bool GoesThrough(const LimbCore& core, const float* a, const float* b, const float* c) {
  float ab[3], ac[3], from_a[3], normal[3], across[3];
  for (size_t i = 0; i < 3; ++i) {
    ab[i] = b[i] - a[i];
    ac[i] = c[i] - a[i];
    from_a[i] = core.posed_from[i] - a[i];
  }
  Cross(ab, ac, normal);
  const float slope = -Dot(normal, core.along);
  if (!(std::fabs(slope) > 0)) return false;
  const float along = Dot(normal, from_a) / slope;
  if (along < 0 || along > 1) return false;
  Cross(from_a, core.along, across);
  const float u = Dot(ac, across) / slope, v = -Dot(ab, across) / slope;
  return u >= 0 && v >= 0 && u + v <= 1;
}

bool BendsWith(const LimbCores& limbs, uint32_t nearest, uint32_t k) {
  return k == nearest || k == limbs.cores[nearest].above || limbs.cores[k].above == nearest;
}

bool IsBehindCore(const LimbCores& limbs, uint32_t under, uint32_t nearest, const float* bound, const float* point,
                  float* out, float* middle) {
  if (nearest >= kMostCores) return false;
  for (uint32_t k = 0; k < *limbs.count; ++k) {
    if ((under >> k & 1u) == 0 || !BendsWith(limbs, nearest, k)) continue;
    if (IsBehind(limbs.cores[k], bound, point, out, middle)) return true;
  }
  return false;
}

}  // namespace dcloth::engine

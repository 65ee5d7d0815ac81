#include "fit/rig_fit.h"

#include <cmath>
#include <cstring>
#include <initializer_list>

#include "engine/src/pose/host_rig.h"

namespace dcloth::fit {
namespace {

using engine::AngleOf;
using engine::BindMatrix;
using engine::Invert;
using engine::JointMatrix;
using engine::kMaxPoseMagnitude;
using format::Diagnostic;
using format::kNoOffset;
using format::ModelView;
using format::Path;
using format::Text;

constexpr double kDegrees = 180 / 3.14159265358979311600;
// Between the two bind poses, in degrees. Arms may hang (A) or be raised (T): 90. Legs stand.
constexpr double kMostArmTurn = 100, kMostLegTurn = 40, kMostUpTurn = 45;
constexpr double kWideArmTurn = 60, kWideLegTurn = 25;  // worth a warning
// A bone over the scaled figure's. Children and cartoons are within the first pair.
constexpr double kLeastBone = 0.4, kMostBone = 2.5;
constexpr double kUsualLeast = 0.75, kUsualMost = 1.33;
constexpr double kLeastScale = 0.05, kMostScale = 20;
constexpr double kShortest = 1e-4;  // metres; no direction below it

Vector operator+(const Vector& a, const Vector& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
Vector operator-(const Vector& a, const Vector& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
Vector operator*(double s, const Vector& a) { return {s * a.x, s * a.y, s * a.z}; }
double Dot(const Vector& a, const Vector& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
double Length(const Vector& a) { return std::sqrt(Dot(a, a)); }
Vector Cross(const Vector& a, const Vector& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
Vector Unit(const Vector& a) { return (1 / Length(a)) * a; }
Vector Middle(const Vector& a, const Vector& b) { return 0.5 * (a + b); }
double Angle(const Vector& a, const Vector& b) { return kDegrees * AngleOf(Length(Cross(a, b)), Dot(a, b)); }

Vector operator*(const Turn3& t, const Vector& a) {
  return {t.m[0][0] * a.x + t.m[0][1] * a.y + t.m[0][2] * a.z, t.m[1][0] * a.x + t.m[1][1] * a.y + t.m[1][2] * a.z,
          t.m[2][0] * a.x + t.m[2][1] * a.y + t.m[2][2] * a.z};
}
Turn3 operator*(const Turn3& a, const Turn3& b) {
  Turn3 product;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) product.m[r][c] = a.m[r][0] * b.m[0][c] + a.m[r][1] * b.m[1][c] + a.m[r][2] * b.m[2][c];
  }
  return product;
}
Turn3 Transposed(const Turn3& a) {
  Turn3 t;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) t.m[r][c] = a.m[c][r];
  }
  return t;
}

// The shortest turn from one unit vector to another that does not point against it (Rodrigues).
Turn3 ShortestTurn(const Vector& from, const Vector& to) {
  const Vector v = Cross(from, to);
  const double c = Dot(from, to), k = 1 / (1 + c);
  return {{{c + k * v.x * v.x, k * v.x * v.y - v.z, k * v.x * v.z + v.y},
           {k * v.x * v.y + v.z, c + k * v.y * v.y, k * v.y * v.z - v.x},
           {k * v.x * v.z - v.y, k * v.y * v.z + v.x, c + k * v.z * v.z}}};
}

Vector Origin(const Affine& a) { return {a.m[0][3], a.m[1][3], a.m[2][3]}; }

bool IsSame(const char* a, const char* b) { return a != nullptr && std::strncmp(a, b, std::strlen(b) + 1) == 0; }

bool IsTrunk(uint32_t role) { return role >= DCLOTH_ROLE_SPINE && role <= DCLOTH_ROLE_UPPER_CHEST; }

// Joints of either skeleton by number: names, told roles, places.
struct NamedJoints {
  const ModelView* model;             // or
  const dcloth_character* character;  // in `space`
  Space space;
  bool numbered = false;  // joint_roles.h
  const char* prefix = nullptr;
  size_t prefix_size = 0;  // of `prefix`, which nearly all names begin with and which says nothing

  uint32_t count() const { return model != nullptr ? model->joint_count : character->joint_count; }
  const char* Name(uint32_t j) const {
    if (model != nullptr) return format::JointName(*model, j);
    const char* const name = character->joint_names != nullptr ? character->joint_names[j] : nullptr;
    return HasPrefix(name) ? name + prefix_size : name;
  }
  bool HasPrefix(const char* name) const {
    return prefix_size != 0 && name != nullptr && std::strncmp(name, prefix, prefix_size) == 0;
  }
  uint32_t Role(uint32_t j, uint32_t choice, uint32_t* rank) const {
    if (Told(j) != DCLOTH_ROLE_NONE) {
      *rank = 0;
      return choice == 0 ? Told(j) : uint32_t{DCLOTH_ROLE_NONE};
    }
    const uint32_t role = RoleOf(Name(j), numbered, choice, rank);
    ++*rank;  // what is told comes first
    return role;
  }
  bool IsOfTrunk(uint32_t j) const {
    return Told(j) != DCLOTH_ROLE_NONE ? IsTrunk(Told(j)) : IsTrunkName(Name(j), numbered);
  }
  uint32_t Told(uint32_t j) const {
    return model == nullptr && character->joint_roles != nullptr ? character->joint_roles[j]
                                                                 : uint32_t{DCLOTH_ROLE_NONE};
  }
  Vector At(uint32_t j) const {
    Affine bind = {};
    if (model != nullptr) {
      BindMatrix(*model, j, &bind);
      return Origin(bind);
    }
    return Origin(FromHost(space, CharacterBind(*character, j)));
  }
};

// What nearly all names have in common is no part of them: numbers, and a prefix if more names are known without it.
void ReadNaming(NamedJoints* joints) {
  constexpr size_t kLongestPrefix = 64;
  const dcloth_character& character = *joints->character;
  const uint32_t count = character.joint_count;
  if (character.joint_names == nullptr) return;
  const auto nearly_all = [&](uint32_t some) { return uint64_t{10} * some >= uint64_t{9} * count; };
  uint32_t numbered = 0;
  for (uint32_t j = 0; j < count; ++j) numbered += EndsInNumber(character.joint_names[j]) ? 1 : 0;
  joints->numbered = nearly_all(numbered);
  const auto known = [&] {
    uint32_t roles = 0;
    for (uint32_t j = 0; j < count; ++j)
      roles += RoleOf(joints->Name(j), joints->numbered, 0, nullptr) != DCLOTH_ROLE_NONE ? 1 : 0;
    return roles;
  };
  const uint32_t known_whole = known();
  for (const uint32_t sample : {count / 2, count - 1, uint32_t{0}}) {
    joints->prefix = character.joint_names[sample];
    if (joints->prefix == nullptr) continue;
    for (size_t size = SizeOfPrefix(joints->prefix, kLongestPrefix); size != 0;
         size = SizeOfPrefix(joints->prefix, size - 1)) {
      joints->prefix_size = size;
      uint32_t begin_so = 0;
      for (uint32_t j = 0; j < count; ++j) begin_so += joints->HasPrefix(character.joint_names[j]) ? 1 : 0;
      if (!nearly_all(begin_so)) continue;
      if (known() > known_whole) return;
      break;
    }
    joints->prefix_size = 0;
  }
}

bool IsTaken(const RoleJoints& found, uint32_t joint) {
  for (const int32_t taken : found.joint) {
    if (taken == static_cast<int32_t>(joint)) return true;
  }
  return false;
}

// The spine's joints, lowest first, of what has no other role.
void FindTrunk(const NamedJoints& joints, RoleJoints* found) {
  const bool has_neck = found->joint[DCLOTH_ROLE_NECK] >= 0 || found->joint[DCLOTH_ROLE_HEAD] >= 0;
  const Vector low = found->at[DCLOTH_ROLE_HIPS];
  const Vector high = found->joint[DCLOTH_ROLE_NECK] >= 0 ? found->at[DCLOTH_ROLE_NECK] : found->at[DCLOTH_ROLE_HEAD];
  const auto height = [&](const Vector& at) { return has_neck ? Dot(at - low, high - low) : at.y; };
  for (uint32_t j = 0; j < joints.count(); ++j) {
    if (found->trunk_count == kMostTrunkJoints) break;
    if (!joints.IsOfTrunk(j) || IsTaken(*found, j)) continue;
    const Vector at = joints.At(j);
    if (has_neck && height(at) > height(high)) continue;
    uint32_t place = found->trunk_count++;
    for (; place > 0 && height(found->trunk_at[place - 1]) > height(at); --place) {
      found->trunk[place] = found->trunk[place - 1];
      found->trunk_at[place] = found->trunk_at[place - 1];
    }
    found->trunk[place] = static_cast<int32_t>(j);
    found->trunk_at[place] = at;
  }
}

RoleJoints FindRoles(const NamedJoints& joints) {
  RoleJoints found = {};
  for (int32_t& joint : found.joint) joint = -1;
  for (uint32_t choice = 0; choice < kRoleChoices; ++choice) {
    uint32_t best[kRoleCount];
    bool open[kRoleCount];
    for (uint32_t role = 0; role < kRoleCount; ++role) {
      best[role] = UINT32_MAX;
      open[role] = role != DCLOTH_ROLE_NONE && !IsTrunk(role) && found.joint[role] < 0;
    }
    for (uint32_t j = 0; j < joints.count(); ++j) {
      uint32_t rank = 0;
      const uint32_t role = joints.Role(j, choice, &rank);
      if (!open[role] || rank >= best[role] || (choice != 0 && IsTaken(found, j))) continue;
      best[role] = rank;
      found.joint[role] = static_cast<int32_t>(j);
      found.at[role] = joints.At(j);
    }
  }
  FindTrunk(joints, &found);
  return found;
}

bool Has(const RoleJoints& joints, uint32_t role) { return joints.joint[role] >= 0; }
bool BothHave(const RigFit& fit, uint32_t role) { return Has(fit.figure, role) && Has(fit.character, role); }

// Whose joint moves a part where the character lacks it; NONE where nothing can.
uint32_t StandIn(uint32_t role) {
  switch (role) {
    case DCLOTH_ROLE_NECK:
    case DCLOTH_ROLE_LEFT_SHOULDER:
    case DCLOTH_ROLE_RIGHT_SHOULDER:
      return DCLOTH_ROLE_UPPER_CHEST;
    case DCLOTH_ROLE_HEAD:
      return DCLOTH_ROLE_NECK;
    case DCLOTH_ROLE_LEFT_LOWER_ARM:
    case DCLOTH_ROLE_LEFT_HAND:
    case DCLOTH_ROLE_RIGHT_LOWER_ARM:
    case DCLOTH_ROLE_RIGHT_HAND:
    case DCLOTH_ROLE_LEFT_FOOT:
    case DCLOTH_ROLE_LEFT_TOES:
    case DCLOTH_ROLE_RIGHT_FOOT:
    case DCLOTH_ROLE_RIGHT_TOES:
      return role - 1;
    default:
      return DCLOTH_ROLE_NONE;
  }
}

// The role among the character's that moves the figure's joint of `role`; NONE where nothing does.
uint32_t MovedBy(const RigFit& fit, uint32_t role) {
  while (role != DCLOTH_ROLE_NONE && !Has(fit.character, role)) {
    if (IsTrunk(role)) return fit.character.trunk_count != 0 ? role : uint32_t{DCLOTH_ROLE_NONE};
    role = StandIn(role);
  }
  return role;
}

uint32_t FigureRole(const RigFit& fit, uint32_t joint) {
  for (uint32_t role = 1; role < kRoleCount; ++role) {
    if (fit.figure.joint[role] == static_cast<int32_t>(joint)) return role;
  }
  for (uint32_t i = 0; i < fit.figure.trunk_count; ++i) {
    if (fit.figure.trunk[i] == static_cast<int32_t>(joint)) return DCLOTH_ROLE_SPINE;
  }
  return DCLOTH_ROLE_NONE;
}

// The figure's trunk joint `i` by place in order where both have as many; by height where not: the character's highest
// that is not clearly above, whose turn is that of the part of the trunk over the figure's joint.
uint32_t TrunkJoint(const RigFit& fit, uint32_t i) {
  const RoleJoints& character = fit.character;
  if (character.trunk_count == fit.figure.trunk_count) return i;
  constexpr double kSame = 0.1;  // of the trunk's length
  const auto share = [](const Vector& at, const Vector& middle, const Turn3& frame, double length) {
    const Vector up = {frame.m[0][1], frame.m[1][1], frame.m[2][1]};
    return Dot(at - middle, up) / length;
  };
  const double wanted = share(fit.figure.trunk_at[i], fit.figure_middle, fit.figure_frame, 1);
  uint32_t best = 0;
  for (uint32_t k = 0; k < character.trunk_count; ++k) {
    const double at = share(character.trunk_at[k], fit.character_middle, fit.character_frame, fit.trunk_ratio);
    if (at <= wanted + kSame * 0.5) best = k;  // figures' trunks are half a metre
  }
  return best;
}

struct Bone {
  uint32_t from, to;
  double most_turn, wide_turn;  // 0: any
};
constexpr Bone kBones[] = {
    {DCLOTH_ROLE_LEFT_UPPER_ARM, DCLOTH_ROLE_LEFT_LOWER_ARM, kMostArmTurn, kWideArmTurn},
    {DCLOTH_ROLE_LEFT_LOWER_ARM, DCLOTH_ROLE_LEFT_HAND, kMostArmTurn, kWideArmTurn},
    {DCLOTH_ROLE_RIGHT_UPPER_ARM, DCLOTH_ROLE_RIGHT_LOWER_ARM, kMostArmTurn, kWideArmTurn},
    {DCLOTH_ROLE_RIGHT_LOWER_ARM, DCLOTH_ROLE_RIGHT_HAND, kMostArmTurn, kWideArmTurn},
    {DCLOTH_ROLE_LEFT_UPPER_LEG, DCLOTH_ROLE_LEFT_LOWER_LEG, kMostLegTurn, kWideLegTurn},
    {DCLOTH_ROLE_LEFT_LOWER_LEG, DCLOTH_ROLE_LEFT_FOOT, kMostLegTurn, kWideLegTurn},
    {DCLOTH_ROLE_RIGHT_UPPER_LEG, DCLOTH_ROLE_RIGHT_LOWER_LEG, kMostLegTurn, kWideLegTurn},
    {DCLOTH_ROLE_RIGHT_LOWER_LEG, DCLOTH_ROLE_RIGHT_FOOT, kMostLegTurn, kWideLegTurn},
    {DCLOTH_ROLE_LEFT_FOOT, DCLOTH_ROLE_LEFT_TOES, 0, 0},
    {DCLOTH_ROLE_RIGHT_FOOT, DCLOTH_ROLE_RIGHT_TOES, 0, 0},
};

// "0.62", "14.3", "170": as many digits as a reader wants.
Text& AddPlain(double value, Text* text) {
  const auto hundredths = static_cast<uint64_t>(value < 0 ? 0 : value > 1e12 ? 1e14 : value * 100 + 0.5);
  const uint64_t rest = hundredths % 100;
  text->Add(hundredths / 100);
  if (rest != 0 && hundredths < 100000) text->Add(rest < 10 ? ".0" : ".").Add(rest);
  return *text;
}

// "'mixamorig:LeftUpLeg' (left upper leg)"
Text& AddJoint(const dcloth_character& character, const RoleJoints& joints, uint32_t role, Text* text) {
  const char* name =
      character.joint_names == nullptr ? nullptr : character.joint_names[static_cast<size_t>(joints.joint[role])];
  text->Add("'");
  if (name != nullptr) {
    text->AddName(name);
  } else {
    text->Add(static_cast<uint64_t>(joints.joint[role]));
  }
  return text->Add("' (").Add(RoleName(role)).Add(")");
}

bool RefusePose(const char* field, int64_t index, const char* found, const char* allowed, const char* mend,
                Diagnostic* diagnostic) {
  const Path character = {nullptr, "character"}, path = {&character, field, Path::kNoIndex},
             element = {&path, nullptr, index};
  return diagnostic->Fail(DCLOTH_ERROR_POSE, kNoOffset, index < 0 ? &path : &element, found, allowed, mend);
}

// Every joint of the garment has somebody to move it.
bool CheckRoles(const ModelView& model, const dcloth_character& character, const RigFit& fit, Diagnostic* diagnostic) {
  constexpr uint32_t kMostNamed = 6;
  char found[170];
  Text text(found, sizeof(found));
  uint32_t missing = 0;
  const auto miss = [&](const char* what) {
    if (++missing > kMostNamed) return;
    text.Add(missing == 1 ? "no joint for '" : ", '").AddName(what).Add("'");
  };
  bool trunk_missed = false;
  for (uint32_t j = 0; j < model.joint_count; ++j) {
    const uint32_t role = FigureRole(fit, j);
    if (role == DCLOTH_ROLE_NONE) {
      bool named = false;  // a part of the garment's own, a tail: by its name
      for (uint32_t i = 0; i < character.joint_count && character.joint_names != nullptr && !named; ++i) {
        named = IsSame(character.joint_names[i], format::JointName(model, j));
      }
      if (!named) miss(format::JointName(model, j));
    } else if (MovedBy(fit, role) == DCLOTH_ROLE_NONE) {
      if (!IsTrunk(role)) {
        miss(RoleName(role));
      } else if (!trunk_missed) {
        trunk_missed = true;
        miss("spine");
      }
    }
  }
  if (missing == 0) return true;
  if (missing > kMostNamed) text.Add(" and ").Add(uint64_t{missing - kMostNamed}).Add(" more");
  char allowed[64];
  Text(allowed, sizeof(allowed)).Add("a joint for each, among the ").Add(uint64_t{character.joint_count}).Add(" given");
  const Path path = {nullptr, "character"};
  return diagnostic->Fail(DCLOTH_ERROR_JOINTS, kNoOffset, &path, found, allowed, "set their roles in joint_roles");
}

bool CheckMatrices(const dcloth_character& character, const RigFit& fit, Diagnostic* diagnostic) {
  const auto usable = [&](int32_t joint) {
    if (joint < 0) return true;
    const Affine bind = CharacterBind(character, static_cast<size_t>(joint));
    Affine inverse;
    bool finite = true;
    for (const auto& row : bind.m) {
      for (const double value : row)
        finite &= value >= -static_cast<double>(kMaxPoseMagnitude) && value <= static_cast<double>(kMaxPoseMagnitude);
    }
    return (finite && Invert(bind, &inverse)) ||
           RefusePose("bind_matrices", joint, "NaN, a number beyond 1e9 or a matrix without inverse",
                      "the joint's matrix in the bind pose",
                      "pass matrices from joint to world space, with a scale other than 0", diagnostic);
  };
  for (const int32_t joint : fit.character.joint) {
    if (!usable(joint)) return false;
  }
  for (uint32_t i = 0; i < fit.character.trunk_count; ++i) {
    if (!usable(fit.character.trunk[i])) return false;
  }
  return true;
}

// Between the hip joints, and up from there to between the shoulders, or what both skeletons have instead.
void FindTrunkEnds(const RigFit& fit, const RoleJoints& joints, Vector* middle, Vector* top) {
  const bool legs = BothHave(fit, DCLOTH_ROLE_LEFT_UPPER_LEG) && BothHave(fit, DCLOTH_ROLE_RIGHT_UPPER_LEG);
  *middle = legs ? Middle(joints.at[DCLOTH_ROLE_LEFT_UPPER_LEG], joints.at[DCLOTH_ROLE_RIGHT_UPPER_LEG])
                 : joints.at[DCLOTH_ROLE_HIPS];
  if (BothHave(fit, DCLOTH_ROLE_LEFT_UPPER_ARM) && BothHave(fit, DCLOTH_ROLE_RIGHT_UPPER_ARM)) {
    *top = Middle(joints.at[DCLOTH_ROLE_LEFT_UPPER_ARM], joints.at[DCLOTH_ROLE_RIGHT_UPPER_ARM]);
  } else if (BothHave(fit, DCLOTH_ROLE_NECK)) {
    *top = joints.at[DCLOTH_ROLE_NECK];
  } else if (BothHave(fit, DCLOTH_ROLE_HEAD)) {
    *top = joints.at[DCLOTH_ROLE_HEAD];
  } else {
    *top = joints.trunk_count != 0 ? joints.trunk_at[joints.trunk_count - 1] : *middle;
  }
}

// From right to left, of the first pair that both have.
bool LeftOf(const RigFit& fit, const RoleJoints& joints, Vector* left) {
  for (const uint32_t role : {DCLOTH_ROLE_LEFT_UPPER_LEG, DCLOTH_ROLE_LEFT_UPPER_ARM, DCLOTH_ROLE_LEFT_SHOULDER,
                              DCLOTH_ROLE_LEFT_LOWER_LEG, DCLOTH_ROLE_LEFT_FOOT}) {
    const uint32_t other = OtherSide(role);
    if (!BothHave(fit, role) || !BothHave(fit, other)) continue;
    *left = joints.at[role] - joints.at[other];
    return true;
  }
  return false;
}

Turn3 Frame(const Vector& up_way, const Vector& left_way) {
  const Vector up = Unit(up_way);
  const Vector left = Unit(left_way - Dot(left_way, up) * up);
  const Vector forward = Cross(left, up);
  return {{{left.x, up.x, forward.x}, {left.y, up.y, forward.y}, {left.z, up.z, forward.z}}};
}

// The host's axis that a vector of the model's space points along: "-Z".
void AddHostAxis(const Space& space, const Vector& v, Text* text) {
  const double model[3] = {v.x, v.y, v.z};
  double host[3];
  for (int i = 0; i < 3; ++i) host[space.axis[i]] = space.sign[i] * model[i];
  int largest = 0;
  for (int i = 1; i < 3; ++i) {
    if (host[i] * host[i] > host[largest] * host[largest]) largest = i;
  }
  constexpr const char* kAxes[2][3] = {{"+X", "+Y", "+Z"}, {"-X", "-Y", "-Z"}};
  text->Add(kAxes[host[largest] < 0 ? 1 : 0][largest]);
}

bool CheckAxes(const dcloth_character& character, const RigFit& fit, const Vector& up, const Vector& left,
               dcloth_fit* report, Diagnostic* diagnostic) {
  char found[150], allowed[80];
  const double off = Angle(up, {0, 1, 0});
  if (off > kMostUpTurn) {
    Text text(found, sizeof(found));
    text.Add("a character that stands along ");
    AddHostAxis(fit.space, up, &text);
    Text allow(allowed, sizeof(allowed));
    allow.Add("the way up of dcloth_cloth_set_space, ");
    AddHostAxis(fit.space, {0, 1, 0}, &allow);
    return RefusePose("bind_matrices", -1, found, allowed,
                      "set the space to your axes, or pass the bind pose in the axes of the world", diagnostic);
  }
  // Left and up give the front; toes tell whether that is so.
  const Vector forward = Cross(left, up);
  double toes = 0;
  for (const uint32_t foot : {DCLOTH_ROLE_LEFT_FOOT, DCLOTH_ROLE_RIGHT_FOOT}) {
    if (!Has(fit.character, foot) || !Has(fit.character, foot + 1)) continue;
    const Vector to_toes = fit.character.at[foot + 1] - fit.character.at[foot];
    const Vector level = to_toes - Dot(to_toes, Unit(up)) * Unit(up);
    if (Length(level) > kShortest) toes += Dot(Unit(level), Unit(forward));
  }
  if (toes == 0) report->warnings |= DCLOTH_FIT_FACING;
  if (toes < -0.3) {
    Text text(found, sizeof(found));
    text.Add("toes that point backwards");
    return RefusePose(
        "bind_matrices", -1, found, "left joints on the character's left",
        "left and right are swapped in names or roles, or the space of dcloth_cloth_set_space has the wrong "
        "handedness",
        diagnostic);
  }
  for (const uint32_t role : {DCLOTH_ROLE_LEFT_UPPER_ARM, DCLOTH_ROLE_LEFT_LOWER_LEG, DCLOTH_ROLE_LEFT_FOOT}) {
    const uint32_t other = OtherSide(role);
    if (!Has(fit.character, role) || !Has(fit.character, other)) continue;
    const Vector across = fit.character.at[role] - fit.character.at[other];
    if (Dot(across, left) > 0 || Length(across) < kShortest) continue;
    Text text(found, sizeof(found));
    AddJoint(character, fit.character, role, &text).Add(" to the right of ");
    AddJoint(character, fit.character, other, &text);
    return RefusePose("bind_matrices", fit.character.joint[role], found, "left on the left, as at the hips",
                      "left and right are swapped in names or roles", diagnostic);
  }
  return true;
}

bool CheckScale(const RigFit& fit, Diagnostic* diagnostic) {
  const double scale = fit.bone_scale;
  if (scale >= kLeastScale && scale <= kMostScale) return true;
  char found[120], mend[120];
  Text text(found, sizeof(found)), help(mend, sizeof(mend));
  text.Add("a character ");
  AddPlain(scale, &text).Add(" times the size of the garment's figure");
  help.Add("the space says ");
  AddPlain(fit.space.metres_per_unit, &help)
      .Add(scale > 1 ? " m in a unit; are these centimetres?" : " m in a unit; are these metres?");
  return RefusePose("bind_matrices", -1, found, "0.05 to 20 times", mend, diagnostic);
}

bool CheckBone(const dcloth_character& character, const RigFit& fit, uint32_t from, uint32_t to, dcloth_fit* report,
               Diagnostic* diagnostic) {
  if (!BothHave(fit, from) || !BothHave(fit, to)) return true;
  const double figure = Length(fit.figure.at[to] - fit.figure.at[from]);
  if (figure < kShortest) return true;
  const double ratio = Length(fit.character.at[to] - fit.character.at[from]) / figure / fit.bone_scale;
  if (to != OtherSide(from)) report->ratios[from] = static_cast<float>(ratio);
  if (ratio < kUsualLeast || ratio > kUsualMost) report->warnings |= DCLOTH_FIT_PROPORTIONS;
  if (ratio >= kLeastBone && ratio <= kMostBone) return true;
  char found[200];
  Text text(found, sizeof(found));
  AddPlain(ratio, &text).Add(" times the figure's length from ");
  AddJoint(character, fit.character, from, &text).Add(" to ");
  AddJoint(character, fit.character, to, &text);
  return RefusePose("bind_matrices", fit.character.joint[to], found, "0.4 to 2.5 times",
                    "pass matrices of one pose, from joint to world space", diagnostic);
}

bool CheckStance(const dcloth_character& character, const RigFit& fit, const Bone& bone, double turn,
                 dcloth_fit* report, Diagnostic* diagnostic) {
  if (bone.most_turn == 0) return true;
  if (turn > static_cast<double>(report->stance_degrees)) {
    report->stance_degrees = static_cast<float>(turn);
    report->stance_role = bone.from;
  }
  if (turn > bone.wide_turn) report->warnings |= DCLOTH_FIT_STANCE;
  if (turn <= bone.most_turn) return true;
  char found[170], allowed[48];
  Text text(found, sizeof(found));
  AddJoint(character, fit.character, bone.from, &text).Add(" at ").Add(static_cast<uint64_t>(turn + 0.5));
  text.Add(" degrees from the figure's bind pose");
  Text(allowed, sizeof(allowed)).Add("at most ").Add(static_cast<uint64_t>(bone.most_turn)).Add(" degrees");
  return RefusePose("bind_matrices", fit.character.joint[bone.from], found, allowed,
                    "pass the T or A pose that the skin was bound in, not a pose of an animation", diagnostic);
}

bool FitLimbs(const dcloth_character& character, RigFit* fit, dcloth_fit* report, Diagnostic* diagnostic) {
  const Turn3 trunk = fit->character_frame * Transposed(fit->figure_frame);
  for (Turn3& turn : fit->turn) turn = trunk;
  for (const Bone& bone : kBones) {
    const bool lower = bone.from == DCLOTH_ROLE_LEFT_LOWER_ARM || bone.from == DCLOTH_ROLE_RIGHT_LOWER_ARM ||
                       bone.from == DCLOTH_ROLE_LEFT_LOWER_LEG || bone.from == DCLOTH_ROLE_RIGHT_LOWER_LEG;
    Turn3 turn = lower ? fit->turn[bone.from - 1] : trunk;
    if (BothHave(*fit, bone.from) && BothHave(*fit, bone.to)) {
      const Vector figure = fit->figure.at[bone.to] - fit->figure.at[bone.from];
      const Vector own = fit->character.at[bone.to] - fit->character.at[bone.from];
      if (Length(figure) > kShortest && Length(own) > kShortest) {
        if (!CheckStance(character, *fit, bone, Angle(trunk * figure, own), report, diagnostic)) return false;
        const Vector from = Unit(turn * figure), to = Unit(own);
        if (Dot(from, to) > -0.99) turn = ShortestTurn(from, to) * turn;
      }
    }
    fit->turn[bone.from] = turn;
    // The hand goes with the forearm, the toes with the foot; a lower part that has no end, with the upper one.
    if (bone.to == DCLOTH_ROLE_LEFT_HAND || bone.to == DCLOTH_ROLE_RIGHT_HAND || bone.to == DCLOTH_ROLE_LEFT_TOES ||
        bone.to == DCLOTH_ROLE_RIGHT_TOES)
      fit->turn[bone.to] = turn;
  }
  return true;
}

double LegLength(const RoleJoints& joints, const RigFit& fit, double* parts) {
  double sum = 0;
  *parts = 0;
  for (const uint32_t upper : {DCLOTH_ROLE_LEFT_UPPER_LEG, DCLOTH_ROLE_RIGHT_UPPER_LEG}) {
    for (const uint32_t part : {upper, upper + 1}) {
      if (!BothHave(fit, part) || !BothHave(fit, part + 1)) continue;
      sum += Length(joints.at[part + 1] - joints.at[part]);
      *parts += 1;
    }
  }
  return sum;
}

void TellJoints(const RigFit& fit, dcloth_fit* report) {
  for (int32_t& joint : report->joints) joint = -1;
  for (uint32_t role = 1; role < kRoleCount; ++role) report->joints[role] = fit.character.joint[role];
  for (uint32_t i = 0; i < fit.figure.trunk_count && i < 3 && fit.character.trunk_count != 0; ++i)
    report->joints[DCLOTH_ROLE_SPINE + i] = fit.character.trunk[TrunkJoint(fit, i)];
}

}  // namespace

Affine CharacterBind(const dcloth_character& character, size_t joint) {
  dcloth_pose pose = {};
  pose.joint_matrices = character.bind_matrices;
  pose.column_major = character.column_major;
  return JointMatrix(pose, joint);
}

bool MeasureRig(const ModelView& model, const dcloth_character& character, const Space& space, RigFit* fit,
                dcloth_fit* report, Diagnostic* diagnostic) {
  fit->space = space;
  fit->figure = FindRoles({&model, nullptr, space});
  NamedJoints joints = {nullptr, &character, space};
  ReadNaming(&joints);
  fit->character = FindRoles(joints);
  if (!CheckRoles(model, character, *fit, diagnostic) || !CheckMatrices(character, *fit, diagnostic)) return false;
  for (uint32_t j = 0; j < model.joint_count; ++j) {
    const uint32_t role = FigureRole(*fit, j);
    if (role == DCLOTH_ROLE_NONE || IsTrunk(role) || Has(fit->character, role)) continue;
    report->warnings |= DCLOTH_FIT_STAND_IN;
    if (report->stand_in_role == DCLOTH_ROLE_NONE) report->stand_in_role = role;
  }
  Vector figure_top, top, figure_left, left;
  FindTrunkEnds(*fit, fit->figure, &fit->figure_middle, &figure_top);
  FindTrunkEnds(*fit, fit->character, &fit->character_middle, &top);
  const Vector figure_up = figure_top - fit->figure_middle, up = top - fit->character_middle;
  if (!LeftOf(*fit, fit->figure, &figure_left) || !LeftOf(*fit, fit->character, &left) ||
      Length(figure_up) < kShortest || Length(Cross(figure_up, figure_left)) < kShortest * kShortest) {
    const Path path = {nullptr, "character"};
    return diagnostic->Fail(DCLOTH_ERROR_JOINTS, kNoOffset, &path, "no pair of legs or arms in garment and character",
                            "a left and a right joint of one kind and a trunk", "name them in joint_roles");
  }
  if (Length(up) < kShortest || Length(Cross(up, left)) < kShortest * kShortest) {
    return RefusePose("bind_matrices", -1, "hips, spine and legs in one place or one line", "a standing body",
                      "pass matrices of one bind pose, from joint to world space", diagnostic);
  }
  double parts = 0;
  const double legs = LegLength(fit->character, *fit, &parts), figure_legs = LegLength(fit->figure, *fit, &parts);
  fit->trunk_ratio = Length(up) / Length(figure_up);
  fit->bone_scale = parts != 0 ? 0.5 * (fit->trunk_ratio + legs / figure_legs) : fit->trunk_ratio;
  fit->figure_frame = Frame(figure_up, figure_left);
  if (!CheckScale(*fit, diagnostic) || !CheckAxes(character, *fit, up, left, report, diagnostic)) return false;
  fit->character_frame = Frame(up, left);
  report->ratios[DCLOTH_ROLE_HIPS] = static_cast<float>(fit->trunk_ratio / fit->bone_scale);
  for (const Bone& bone : kBones) {
    if (bone.most_turn != 0 && !CheckBone(character, *fit, bone.from, bone.to, report, diagnostic)) return false;
  }
  for (const uint32_t role : {DCLOTH_ROLE_LEFT_UPPER_LEG, DCLOTH_ROLE_LEFT_UPPER_ARM}) {
    if (!CheckBone(character, *fit, role, OtherSide(role), report, diagnostic)) return false;
  }
  const double trunk = fit->trunk_ratio / fit->bone_scale;
  if (trunk < kUsualLeast || trunk > kUsualMost) report->warnings |= DCLOTH_FIT_PROPORTIONS;
  if (!FitLimbs(character, fit, report, diagnostic)) return false;
  report->bone_scale = report->scale = static_cast<float>(fit->bone_scale);
  TellJoints(*fit, report);
  return true;
}

PlacedJoint PlaceJoint(const ModelView& model, const RigFit& fit, double scale, uint32_t joint) {
  Affine bind = {};
  BindMatrix(model, joint, &bind);
  const Vector from = Origin(bind);
  const uint32_t role = FigureRole(fit, joint), mover = MovedBy(fit, role);
  // The trunk's joints are no places that all rigs agree on: they follow the trunk's ends, stretched along it.
  const auto along_trunk = [&](const Vector& at) {
    Vector local = Transposed(fit.figure_frame) * (at - fit.figure_middle);
    local.y *= fit.trunk_ratio / scale;
    return (1 / scale) * fit.character_middle + fit.character_frame * local;
  };
  PlacedJoint placed = {};
  Vector to = along_trunk(from);
  const Turn3& turn = fit.turn[mover];
  placed.stands_in = mover != role;
  if (IsTrunk(mover)) {
    uint32_t place = fit.figure.trunk_count != 0 ? fit.figure.trunk_count - 1 : 0;  // of what stands in: the highest
    for (uint32_t i = 0; i < fit.figure.trunk_count; ++i) {
      if (fit.figure.trunk[i] == static_cast<int32_t>(joint)) place = i;
    }
    const uint32_t own = IsTrunk(role) ? TrunkJoint(fit, place) : fit.character.trunk_count - 1;
    placed.host = static_cast<uint32_t>(fit.character.trunk[own]);
  } else if (mover != DCLOTH_ROLE_NONE) {
    placed.host = static_cast<uint32_t>(fit.character.joint[mover]);
    const bool of_trunk = mover == DCLOTH_ROLE_HIPS || mover == DCLOTH_ROLE_NECK ||
                          mover == DCLOTH_ROLE_LEFT_SHOULDER || mover == DCLOTH_ROLE_RIGHT_SHOULDER;
    if (!of_trunk) {
      const Vector own = (1 / scale) * fit.character.at[mover];
      to = mover == role || !Has(fit.figure, mover) ? own : own + turn * (from - fit.figure.at[mover]);
    }
  }
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) placed.place.m[r][c] = turn.m[r][c];
  }
  const Vector offset = to - turn * from;
  placed.place.m[0][3] = offset.x, placed.place.m[1][3] = offset.y, placed.place.m[2][3] = offset.z;
  return placed;
}

void WriteJoints(const ModelView& model, const dcloth_character& character, const RigFit& fit, double scale,
                 format::FitJoint* joints) {
  Space space = fit.space;
  space.metres_per_unit /= scale;
  Space world = fit.space;
  world.converts_joints = true;
  for (uint32_t j = 0; j < model.joint_count; ++j) {
    PlacedJoint placed = PlaceJoint(model, fit, scale, j);
    if (FigureRole(fit, j) == DCLOTH_ROLE_NONE) {
      for (uint32_t i = 0; i < character.joint_count; ++i) {
        if (!IsSame(character.joint_names[i], format::JointName(model, j))) continue;
        placed.host = i;
        break;
      }
    }
    Affine inverse = {};
    Invert(CharacterBind(character, placed.host), &inverse);
    const Affine motion = FromHost(world, inverse * JointToHost(space, placed.place));
    format::FitJoint joint = {};
    std::memcpy(joint.motion, motion.m, sizeof(joint.motion));
    joint.host = placed.host;
    const char* const name = character.joint_names != nullptr ? character.joint_names[placed.host] : nullptr;
    if (name != nullptr && std::memchr(name, 0, sizeof(joint.name)) != nullptr)
      std::memcpy(joint.name, name, std::strlen(name));
    joints[j] = joint;
  }
}

}  // namespace dcloth::fit

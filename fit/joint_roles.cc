#include "fit/joint_roles.h"

#include <cstddef>
#include <cstring>

namespace dcloth::fit {
namespace {

constexpr const char* kNames[kRoleCount] = {"none",
                                            "hips",
                                            "spine",
                                            "chest",
                                            "upper chest",
                                            "neck",
                                            "head",
                                            "left shoulder",
                                            "left upper arm",
                                            "left lower arm",
                                            "left hand",
                                            "right shoulder",
                                            "right upper arm",
                                            "right lower arm",
                                            "right hand",
                                            "left upper leg",
                                            "left lower leg",
                                            "left foot",
                                            "left toes",
                                            "right upper leg",
                                            "right lower leg",
                                            "right foot",
                                            "right toes"};

enum class Side : uint8_t { kNone, kLeft, kRight };

// A joint's name without its side, prefix and separators, in lower case. `role` is that of the left where it has a
// side.
struct Word {
  const char* word;
  uint8_t role;
  uint8_t rank;  // of several joints with one role, the lowest rank has it
  bool sided;
};

// Where each word comes from: Mixamo (upleg, leg, toebase), Unity Humanoid and VRM (upperleg, lowerleg, upperchest),
// Unreal and MakeHuman's game rig (thigh, calf, ball, clavicle, spine01), MakeHuman's default rig (upperleg01, spine05
// to spine01), Rigify (spine, spine001 to spine006, thigh, shin, forearm), CMU (hipjoint, lowerback, fingerbase), Biped
// (toe0), Character Creator (waist, thigh), DAZ (thighbend, shldrbend, abdomenlower), SMPL (pelvis, knee, elbow).
constexpr Word kWords[] = {
    {"hips", DCLOTH_ROLE_HIPS, 0, false},
    {"pelvis", DCLOTH_ROLE_HIPS, 1, false},
    {"hip", DCLOTH_ROLE_HIPS, 2, false},
    {"root", DCLOTH_ROLE_HIPS, 3, false},
    {"spine", DCLOTH_ROLE_SPINE, 0, false},
    {"lowerback", DCLOTH_ROLE_SPINE, 0, false},
    {"waist", DCLOTH_ROLE_SPINE, 1, false},
    {"abdomen", DCLOTH_ROLE_SPINE, 1, false},
    {"abdomenlower", DCLOTH_ROLE_SPINE, 1, false},
    {"chest", DCLOTH_ROLE_CHEST, 0, false},
    {"spine1", DCLOTH_ROLE_CHEST, 1, false},
    {"chestlower", DCLOTH_ROLE_CHEST, 2, false},
    {"abdomen2", DCLOTH_ROLE_CHEST, 2, false},
    {"upperchest", DCLOTH_ROLE_UPPER_CHEST, 0, false},
    {"spine2", DCLOTH_ROLE_UPPER_CHEST, 1, false},
    {"chestupper", DCLOTH_ROLE_UPPER_CHEST, 1, false},
    {"neck", DCLOTH_ROLE_NECK, 0, false},
    {"neck1", DCLOTH_ROLE_NECK, 1, false},
    {"necklower", DCLOTH_ROLE_NECK, 1, false},
    {"necktwist1", DCLOTH_ROLE_NECK, 1, false},
    {"head", DCLOTH_ROLE_HEAD, 0, false},
    {"shoulder", DCLOTH_ROLE_LEFT_SHOULDER, 1, true},
    {"clavicle", DCLOTH_ROLE_LEFT_SHOULDER, 0, true},
    {"collar", DCLOTH_ROLE_LEFT_SHOULDER, 0, true},
    {"upperarm", DCLOTH_ROLE_LEFT_UPPER_ARM, 0, true},
    {"arm", DCLOTH_ROLE_LEFT_UPPER_ARM, 0, true},
    {"upperarm1", DCLOTH_ROLE_LEFT_UPPER_ARM, 0, true},
    {"uparm", DCLOTH_ROLE_LEFT_UPPER_ARM, 0, true},
    {"shldr", DCLOTH_ROLE_LEFT_UPPER_ARM, 0, true},
    {"shldrbend", DCLOTH_ROLE_LEFT_UPPER_ARM, 0, true},
    {"lowerarm", DCLOTH_ROLE_LEFT_LOWER_ARM, 0, true},
    {"forearm", DCLOTH_ROLE_LEFT_LOWER_ARM, 0, true},
    {"lowarm", DCLOTH_ROLE_LEFT_LOWER_ARM, 0, true},
    {"lowerarm1", DCLOTH_ROLE_LEFT_LOWER_ARM, 0, true},
    {"forearmbend", DCLOTH_ROLE_LEFT_LOWER_ARM, 0, true},
    {"elbow", DCLOTH_ROLE_LEFT_LOWER_ARM, 1, true},
    {"hand", DCLOTH_ROLE_LEFT_HAND, 1, true},
    {"wrist", DCLOTH_ROLE_LEFT_HAND, 0, true},
    {"upperleg", DCLOTH_ROLE_LEFT_UPPER_LEG, 0, true},
    {"upleg", DCLOTH_ROLE_LEFT_UPPER_LEG, 0, true},
    {"thigh", DCLOTH_ROLE_LEFT_UPPER_LEG, 0, true},
    {"upperleg1", DCLOTH_ROLE_LEFT_UPPER_LEG, 0, true},
    {"thighbend", DCLOTH_ROLE_LEFT_UPPER_LEG, 0, true},
    {"hip", DCLOTH_ROLE_LEFT_UPPER_LEG, 1, true},
    {"lowerleg", DCLOTH_ROLE_LEFT_LOWER_LEG, 0, true},
    {"leg", DCLOTH_ROLE_LEFT_LOWER_LEG, 0, true},
    {"calf", DCLOTH_ROLE_LEFT_LOWER_LEG, 0, true},
    {"shin", DCLOTH_ROLE_LEFT_LOWER_LEG, 0, true},
    {"lowerleg1", DCLOTH_ROLE_LEFT_LOWER_LEG, 0, true},
    {"lowleg", DCLOTH_ROLE_LEFT_LOWER_LEG, 0, true},
    {"knee", DCLOTH_ROLE_LEFT_LOWER_LEG, 1, true},
    {"foot", DCLOTH_ROLE_LEFT_FOOT, 1, true},
    {"ankle", DCLOTH_ROLE_LEFT_FOOT, 0, true},
    {"toebase", DCLOTH_ROLE_LEFT_TOES, 0, true},
    {"toes", DCLOTH_ROLE_LEFT_TOES, 0, true},
    {"toe", DCLOTH_ROLE_LEFT_TOES, 0, true},
    {"toe0", DCLOTH_ROLE_LEFT_TOES, 1, true},
    {"ball", DCLOTH_ROLE_LEFT_TOES, 0, true},
};
// The second meaning of a trunk's word, taken where nothing else has the role.
constexpr Word kSecondWords[] = {
    {"spine", DCLOTH_ROLE_HIPS, 8, false},  // Rigify, as the next two
    {"spine4", DCLOTH_ROLE_NECK, 8, false},
    {"spine6", DCLOTH_ROLE_HEAD, 8, false},
    {"shoulder", DCLOTH_ROLE_LEFT_UPPER_ARM, 8, true},  // SMPL, beside a collar
    {"foot", DCLOTH_ROLE_LEFT_TOES, 8, true},           // SMPL, beside an ankle
};
constexpr const char* kTrunk[] = {"spine", "chest", "upperchest", "lowerback", "waist", "abdomen", "torso"};
// Pieces of a name that say nothing: whose skeleton it is, what kind of bone.
constexpr const char* kIdle[] = {"mixamorig", "bip",   "bip01", "bip001", "valvebiped", "def",  "org",    "bone",
                                 "jnt",       "joint", "j",     "c",      "cc",         "base", "mixamo", "character"};

constexpr size_t kMaxName = 64;

bool IsDigit(char c) { return c >= '0' && c <= '9'; }
bool IsUpper(char c) { return c >= 'A' && c <= 'Z'; }
char Lower(char c) { return IsUpper(c) ? static_cast<char>(c - 'A' + 'a') : c; }
bool IsLetter(char c) { return Lower(c) >= 'a' && Lower(c) <= 'z'; }

bool IsSame(const char* a, const char* b) { return std::strncmp(a, b, std::strlen(b) + 1) == 0; }

bool StartsWith(const char* text, const char* with) { return std::strncmp(text, with, std::strlen(with)) == 0; }

struct Plain {
  char word[kMaxName + 1] = {};
  size_t size = 0;
  Side side = Side::kNone;
  void Add(const char* piece, size_t piece_size) {
    for (size_t i = 0; i < piece_size && size < kMaxName; ++i) word[size++] = piece[i];
    word[size] = 0;
  }
};

// One piece of a name, lower case: a side, an idle word, or a piece of the word. `last` tells that nothing follows it.
void TakePiece(const char* piece, size_t size, Plain* plain) {
  char text[kMaxName + 1] = {};
  std::memcpy(text, piece, size);
  if (plain->side == Side::kNone && size == 1 && (text[0] == 'l' || text[0] == 'r')) {
    plain->side = text[0] == 'l' ? Side::kLeft : Side::kRight;
    return;
  }
  size_t at = StartsWith(text, "mixamorig") ? std::strlen("mixamorig") : 0;  // "mixamorigHips"
  size_t digits = 0;
  while (IsDigit(text[digits])) ++digits;
  if (IsLetter(text[digits])) at += digits;  // the rest of "mixamorig7Hips"
  if (plain->side == Side::kNone && StartsWith(text + at, "left")) plain->side = Side::kLeft, at += 4;
  if (plain->side == Side::kNone && StartsWith(text + at, "right")) plain->side = Side::kRight, at += 5;
  size_t end = size;
  const auto ends_with = [&](const char* with) {
    const size_t length = std::strlen(with);
    return end - at > length && std::strncmp(text + end - length, with, length) == 0;
  };
  if (plain->side == Side::kNone && ends_with("left")) plain->side = Side::kLeft, end -= 4;
  if (plain->side == Side::kNone && ends_with("right")) plain->side = Side::kRight, end -= 5;
  if (ends_with("bone")) end -= 4;
  text[end] = 0;
  if (at >= end) return;
  for (const char* idle : kIdle) {
    if (IsSame(text + at, idle)) return;
  }
  if (IsDigit(text[at])) {  // "01", "001" -> "1"; "000" -> "0"; that of "Bip01" is none of the word's
    if (plain->size == 0) return;
    while (at + 1 < end && text[at] == '0') ++at;
  }
  plain->Add(text + at, end - at);
}

// Bytes of a name without the number that it ends in, "_01"; 0 where there is none.
size_t SizeBeforeNumber(const char* name) {
  const size_t size = std::strlen(name);
  size_t at = size;
  while (at > 0 && IsDigit(name[at - 1])) --at;
  return at == size || at < 2 || name[at - 1] != '_' ? 0 : at - 1;
}

// "mixamorig:LeftUpLeg" -> upleg, left; "thigh_l", "DEF-thigh.L", "J_Bip_L_UpperLeg", "Bip01 L Thigh", "lThigh" the
// same way.
Plain PlainName(const char* name, bool numbered) {
  Plain plain;
  const char* begin = name;
  const size_t before_number = numbered ? SizeBeforeNumber(name) : 0;
  const char* const end = name + (before_number != 0 ? before_number : std::strlen(name));
  for (const char* at = name; at != end && at < name + 4 * kMaxName; ++at) {
    if ((*at == ':' || *at == '|') && at + 1 != end) begin = at + 1;
  }
  // "lThigh", "rShin", "LHipJoint": a side in one letter before a capital.
  if (end - begin > 2 && (Lower(begin[0]) == 'l' || Lower(begin[0]) == 'r') && IsUpper(begin[1]) &&
      !IsUpper(begin[2])) {
    plain.side = Lower(begin[0]) == 'l' ? Side::kLeft : Side::kRight;
    ++begin;
  }
  char piece[kMaxName + 1];
  size_t size = 0;
  for (const char* at = begin;; ++at) {
    const bool letter = at != end && IsLetter(*at), digit = at != end && IsDigit(*at);
    // A number after a word is a piece of its own, but for its zeros: "spine01".
    const bool breaks = size != 0 && digit && !IsDigit(piece[size - 1]);
    if (size != 0 && ((!letter && !digit) || breaks || size == kMaxName)) {
      TakePiece(piece, size, &plain);
      size = 0;
    }
    if (at == end) return plain;
    if (letter || digit) piece[size++] = Lower(*at);
  }
}

uint32_t Find(const Plain& plain, const Word* words, size_t count, uint32_t* rank) {
  for (size_t i = 0; i < count; ++i) {
    const Word& word = words[i];
    if (word.sided != (plain.side != Side::kNone) || !IsSame(word.word, plain.word)) continue;
    if (rank != nullptr) *rank = word.rank;
    return plain.side == Side::kRight ? OtherSide(word.role) : word.role;
  }
  return DCLOTH_ROLE_NONE;
}

}  // namespace

const char* RoleName(uint32_t role) { return role < kRoleCount ? kNames[role] : nullptr; }

uint32_t OtherSide(uint32_t role) {
  constexpr uint32_t kArm = DCLOTH_ROLE_RIGHT_SHOULDER - DCLOTH_ROLE_LEFT_SHOULDER;
  constexpr uint32_t kLeg = DCLOTH_ROLE_RIGHT_UPPER_LEG - DCLOTH_ROLE_LEFT_UPPER_LEG;
  if (role < DCLOTH_ROLE_LEFT_SHOULDER || role >= kRoleCount) return role;
  if (role < DCLOTH_ROLE_RIGHT_SHOULDER) return role + kArm;
  if (role < DCLOTH_ROLE_LEFT_UPPER_LEG) return role - kArm;
  return role < DCLOTH_ROLE_RIGHT_UPPER_LEG ? role + kLeg : role - kLeg;
}

uint32_t RoleOf(const char* name, bool numbered, uint32_t choice, uint32_t* rank) {
  if (name == nullptr) return DCLOTH_ROLE_NONE;
  const Plain plain = PlainName(name, numbered);
  return choice == 0 ? Find(plain, kWords, sizeof(kWords) / sizeof(kWords[0]), rank)
                     : Find(plain, kSecondWords, sizeof(kSecondWords) / sizeof(kSecondWords[0]), rank);
}

size_t SizeOfPrefix(const char* name, size_t most) {
  size_t size = 0;
  while (size < most && name[size] != '\0') ++size;
  while (size > 0 && (IsLetter(name[size - 1]) || IsDigit(name[size - 1]) || name[size] == '\0')) --size;
  return size;
}

bool EndsInNumber(const char* name) { return name != nullptr && SizeBeforeNumber(name) != 0; }

bool IsTrunkName(const char* name, bool numbered) {
  if (name == nullptr) return false;
  const Plain plain = PlainName(name, numbered);
  if (plain.side != Side::kNone) return false;
  for (const char* word : kTrunk) {
    if (!StartsWith(plain.word, word)) continue;
    const char* rest = plain.word + std::strlen(word);
    if (*rest == 0 || IsDigit(*rest) || IsSame(rest, "lower") || IsSame(rest, "upper")) return true;
  }
  return false;
}

}  // namespace dcloth::fit

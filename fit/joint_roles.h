// What a joint moves, told by its name.
#ifndef DCLOTH_FIT_JOINT_ROLES_H_
#define DCLOTH_FIT_JOINT_ROLES_H_

#include <cstddef>
#include <cstdint>

#include "dcloth/dcloth_fit.h"

namespace dcloth::fit {

constexpr uint32_t kRoleCount = DCLOTH_ROLE_RIGHT_TOES + 1;

// Null past the last role.
const char* RoleName(uint32_t role);

// The role that `name` may have as its choice number `choice`, 0 to kRoleChoices - 1: a few words mean one thing in one
// naming and another in the next ("spine" is Rigify's hips). `rank` says how well the word fits, 0 best.
constexpr uint32_t kRoleChoices = 2;
uint32_t RoleOf(const char* name, bool numbered, uint32_t choice, uint32_t* rank);

// Whether the name is one of the trunk between hips and neck, whichever: those are told apart by their height.
bool IsTrunkName(const char* name, bool numbered);

// Whether the name ends in a number of its own: "Hips_01". Sketchfab numbers its nodes so; where nearly all of a
// character's joints are numbered, which is what `numbered` says, the number is no part of the name. Unreal's
// "spine_01" is one.
bool EndsInNumber(const char* name);

// Bytes of the name, at most `most`, up to its last separator that has something behind it; 0 for none.
size_t SizeOfPrefix(const char* name, size_t most);

// The role on the other side of the body; the role itself in the middle.
uint32_t OtherSide(uint32_t role);

}  // namespace dcloth::fit

#endif  // DCLOTH_FIT_JOINT_ROLES_H_

// What `dcloth poses` and `dcloth body` do with a character that was read, and what must be true of it on the way.
#ifndef DCLOTH_TESTS_FUZZ_CHARACTER_USE_H_
#define DCLOTH_TESTS_FUZZ_CHARACTER_USE_H_

#include <Eigen/Core>
#include <functional>
#include <string>
#include <vector>

#include "tests/fuzz/targets.h"
#include "tools/character/character.h"
#include "tools/character/character_space.h"
#include "tools/character/joint_map.h"

namespace dcloth::testing {

// What a user asks of a character.
struct CharacterRequest {
  tools::SpaceOptions space;
  tools::JointMap map;
  std::vector<std::string> wanted;    // joints, each once; empty: all
  std::vector<Eigen::Matrix4d> bind;  // of `wanted`, finite and with a volume, as ReadTarget's are; or empty
};

// Reads a character, samples its clips as sequences and gathers its body. Accepted where one of the two succeeds.
Verdict ReadAndUse(const std::function<tools::CharacterFile()>& read, const CharacterRequest& asked);

}  // namespace dcloth::testing

#endif  // DCLOTH_TESTS_FUZZ_CHARACTER_USE_H_

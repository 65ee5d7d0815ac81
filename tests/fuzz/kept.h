// What earlier fuzzing left: inputs that broke something, and those that reach every edge (kept/README.md).
#ifndef DCLOTH_TESTS_FUZZ_KEPT_H_
#define DCLOTH_TESTS_FUZZ_KEPT_H_

#include <cstdint>
#include <string>
#include <vector>

namespace dcloth::testing {

struct KeptInput {
  std::string name;
  std::vector<uint8_t> bytes;
};

std::vector<KeptInput> Findings(const std::string& target);

// Throws std::runtime_error where the pack is missing or cut off.
std::vector<KeptInput> PackedInputs(const std::string& target);

}  // namespace dcloth::testing

#endif  // DCLOTH_TESTS_FUZZ_KEPT_H_

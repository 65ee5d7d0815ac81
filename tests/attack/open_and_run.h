// What a host does with a downloaded model, in memory of exactly the sizes asked for: open, lend, tick, draw.
// Checks on the way what the library promises for any bytes at all. No test framework: fuzzers use it too.
#ifndef DCLOTH_TESTS_ATTACK_OPEN_AND_RUN_H_
#define DCLOTH_TESTS_ATTACK_OPEN_AND_RUN_H_

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "dcloth/dcloth.h"

namespace dcloth::testing {

struct Outcome {
  dcloth_status status = DCLOTH_OK;  // of dcloth_model_open
  std::string text;                  // its error, empty where the model opened
  std::string broken_promise;        // empty where all were kept
  bool finite = false;               // every vertex and normal of the frame drawn
};

// Opens `size` bytes, which start on DCLOTH_ALIGNMENT, and where that succeeds runs some ticks and draws frames with
// every output flag.
//
// Promises: a refusal is one of the errors named for dcloth_model_open, says "found" and "allowed", touches
// neither *model nor the storage lent, and gives a place inside the bytes or none; a model that opens
// describes itself, names its joints, takes a cloth and runs. A garment that wants more than `storage_limit`
// bytes is not run.
Outcome OpenAndRun(const void* bytes, size_t size, size_t storage_limit = SIZE_MAX);

// [joint_count, 16]: each joint turned about an axis of its own and moved by up to `metres`.
std::vector<float> TwistedPose(uint32_t joint_count, uint32_t seed, float metres);

}  // namespace dcloth::testing

#endif  // DCLOTH_TESTS_ATTACK_OPEN_AND_RUN_H_

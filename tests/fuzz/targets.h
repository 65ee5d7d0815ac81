// What fuzzers feed: every reader of untrusted bytes, and what happens to them next. A promise that the bytes
// broke is a finding, as is anything but a return: a fault, a foreign exception.
#ifndef DCLOTH_TESTS_FUZZ_TARGETS_H_
#define DCLOTH_TESTS_FUZZ_TARGETS_H_

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "dcloth/dcloth.h"
#include "kernels/kernels.h"

namespace dcloth::testing {

struct Verdict {
  std::string broken_promise;  // empty where all were kept
  bool accepted = false;       // the bytes passed every check and were used
};

// A model file: opened, run for two ticks, drawn. Zeros fill it up to a whole line of 64 bytes.
Verdict FuzzModel(const uint8_t* bytes, size_t size);

// A training bundle: parsed, checked, and where it passes converted; the model then opens and runs.
Verdict FuzzBundle(const uint8_t* bytes, size_t size);

// A sequence: parsed, checked, its joints mapped and poses gathered. What passes is finite.
Verdict FuzzSequence(const uint8_t* bytes, size_t size);

// A saved state in a cloth of one of the small models: restored, run beside a twin, saved, reset.
Verdict FuzzState(const uint8_t* bytes, size_t size);

// A glTF file, plain or binary, alone in its folder: read, sampled as a sequence, gathered as a body.
Verdict FuzzGltf(const uint8_t* bytes, size_t size);

// What assimp could hand over, see scene_target.cc: read, sampled as a sequence, gathered as a body. In builds with
// assimp.
Verdict FuzzScene(const uint8_t* bytes, size_t size);

// The instruction set that an input runs on: each of those that this CPU has gets its share, scalar too.
// While it lives; 0 is the CPU's best.
class ChosenIsa {
 public:
  explicit ChosenIsa(uint64_t choice) {
    (void)dcloth_isa_select(kernels::KernelTableAt(choice % kernels::KernelTableCount())->name);
  }
  ~ChosenIsa() { (void)dcloth_isa_select(nullptr); }
  ChosenIsa(const ChosenIsa&) = delete;
  ChosenIsa& operator=(const ChosenIsa&) = delete;
};

struct FuzzTarget {
  const char* name;
  Verdict (*run)(const uint8_t* bytes, size_t size);
};
inline constexpr FuzzTarget kFuzzTargets[] = {
    {"model", FuzzModel}, {"bundle", FuzzBundle}, {"sequence", FuzzSequence}, {"state", FuzzState}, {"gltf", FuzzGltf},
#ifdef DCLOTH_FUZZ_SCENE
    {"scene", FuzzScene},
#endif
};

struct Seed {
  std::string name;
  std::vector<uint8_t> bytes;
  bool sound;  // passes all checks
};

// A small corpus for a target, by its name: sound files of every kind and the named corruptions of model
// files.
std::vector<Seed> Seeds(const std::string& target);

// What earlier fuzzing left: inputs that broke something, and those that reach every edge (kept/README.md).
struct KeptInput {
  std::string name;
  std::vector<uint8_t> bytes;
};

std::vector<KeptInput> Findings(const std::string& target);

// Throws std::runtime_error where the pack is missing or cut off.
std::vector<KeptInput> PackedInputs(const std::string& target);

// The parts of Seeds for "state", "gltf" and "scene".
std::vector<Seed> StateSeeds();
std::vector<Seed> GltfSeeds();
std::vector<Seed> SceneSeeds();

}  // namespace dcloth::testing

#endif  // DCLOTH_TESTS_FUZZ_TARGETS_H_

// Writes what the fuzzers start from: `fuzz_write_seeds FOLDER` fills FOLDER/model, FOLDER/bundle and so on with seeds
// made by code and what earlier fuzzing left.
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <stdexcept>

#include "tests/fuzz/targets.h"

namespace {

void Write(const std::filesystem::path& path, const std::vector<uint8_t>& bytes) {
  std::ofstream file(path, std::ios::binary);
  file.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  if (!file.flush()) throw std::runtime_error(path.string() + " cannot be written");
}

void WriteSeeds(const std::filesystem::path& folder, const std::string& target) {
  std::filesystem::create_directories(folder);
  const std::vector<dcloth::testing::Seed> seeds = dcloth::testing::Seeds(target);
  for (const dcloth::testing::Seed& seed : seeds) Write(folder / seed.name, seed.bytes);
  size_t kept = 0;
  for (const auto& inputs : {dcloth::testing::Findings(target), dcloth::testing::PackedInputs(target)}) {
    for (const dcloth::testing::KeptInput& input : inputs) Write(folder / input.name, input.bytes);
    kept += inputs.size();
  }
  std::printf("%s: %zu seeds, %zu kept inputs\n", folder.c_str(), seeds.size(), kept);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: %s FOLDER\n", argv[0]);
    return 2;
  }
  try {
    for (const auto& target : dcloth::testing::kFuzzTargets) {
      WriteSeeds(std::filesystem::path(argv[1]) / target.name, target.name);
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "fuzz_write_seeds: %s\n", error.what());
    return 1;
  }
  return 0;
}

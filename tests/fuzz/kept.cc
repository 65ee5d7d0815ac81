#include "tests/fuzz/kept.h"

#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>

namespace dcloth::testing {
namespace {

std::vector<uint8_t> Read(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw std::runtime_error(path.string() + " cannot be read");
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

}  // namespace

std::vector<KeptInput> Findings(const std::string& target) {
  std::vector<KeptInput> findings;
  for (const auto& entry : std::filesystem::directory_iterator(DCLOTH_KEPT_INPUTS)) {
    const std::string name = entry.path().filename().string();
    if (name.starts_with(target + "-")) findings.push_back({name, Read(entry.path())});
  }
  return findings;
}

std::vector<KeptInput> PackedInputs(const std::string& target) {
  const std::filesystem::path path = std::filesystem::path(DCLOTH_KEPT_INPUTS) / (target + ".pack");
  const std::vector<uint8_t> pack = Read(path);
  std::vector<KeptInput> inputs;
  for (auto next = pack.begin(); next != pack.end();) {
    size_t length = 0, left = static_cast<size_t>(pack.end() - next);
    if (left < 4) throw std::runtime_error(path.string() + " is cut off");
    for (unsigned byte = 0; byte < 4; ++byte) length |= size_t{*next++} << (8 * byte);
    if (left - 4 < length) throw std::runtime_error(path.string() + " is cut off");
    const auto end = next + static_cast<std::ptrdiff_t>(length);
    inputs.push_back({"kept-" + std::to_string(inputs.size()), {next, end}});
    next = end;
  }
  return inputs;
}

}  // namespace dcloth::testing

#include "tools/character/glb.h"

#include <cstdint>
#include <cstring>
#include <nlohmann/json.hpp>
#include <string>

#include "converter/error.h"
#include "dcloth/dcloth_fit.h"

namespace dcloth::tools {
namespace {

constexpr uint64_t kHeaderBytes = 12, kChunkHeaderBytes = 8;

uint64_t WordAt(std::span<const std::byte> bytes, uint64_t at) {
  uint64_t word = 0;
  for (uint64_t i = 0; i < 4; ++i) word |= std::to_integer<uint64_t>(bytes[at + i]) << (8 * i);
  return word;
}

void AtMost(const std::filesystem::path& path, const std::string& what, uint64_t length, uint64_t most) {
  if (length <= most) return;
  throw converter::Error({.path = path,
                          .tensor = {},
                          .found = what + " of " + std::to_string(length) + " bytes",
                          .expected = "at most " + std::to_string(most) + ", the size of the file",
                          .mend = "the file is damaged or cut off; export it again"});
}

}  // namespace

void CheckGlbLengths(const std::filesystem::path& path, std::span<const std::byte> bytes) {
  const uint64_t size = bytes.size();
  if (size < kHeaderBytes + kChunkHeaderBytes || std::memcmp(bytes.data(), "glTF", 4) != 0) return;
  const uint64_t whole = WordAt(bytes, 8);
  AtMost(path, "a binary glTF", whole, size);
  // Version 1 has its one length where later ones have the first chunk's. Writers may leave a chunk's padding
  // uncounted.
  uint64_t at = kHeaderBytes;
  do {
    const uint64_t length = WordAt(bytes, at);
    AtMost(path, "a chunk at byte " + std::to_string(at), length, size - at - kChunkHeaderBytes);
    at += kChunkHeaderBytes + (length + 3) / 4 * 4;
  } while (WordAt(bytes, 4) == 2 && at + kChunkHeaderBytes <= whole);
}

GltfFacts ReadGltfFacts(std::span<const std::byte> bytes) {
  constexpr int kDeepest = 16;  // VRM's list lies at 5; a hostile depth is cut off
  GltfFacts facts;
  if (bytes.size() >= kHeaderBytes + kChunkHeaderBytes && std::memcmp(bytes.data(), "glTF", 4) == 0) {
    const uint64_t length = WordAt(bytes, kHeaderBytes);
    if (length > bytes.size() - kHeaderBytes - kChunkHeaderBytes) return facts;
    bytes = bytes.subspan(kHeaderBytes + kChunkHeaderBytes, length);
  }
  const auto* const text = reinterpret_cast<const char*>(bytes.data());
  const auto json = nlohmann::json::parse(
      text, text + bytes.size(),
      [](int depth, nlohmann::json::parse_event_t, nlohmann::json&) { return depth < kDeepest; }, false);
  if (!json.is_object()) return facts;
  const auto at = [](const nlohmann::json& object, const char* key) -> const nlohmann::json& {
    static const nlohmann::json none;
    const auto found = object.is_object() ? object.find(key) : object.end();
    return object.is_object() && found != object.end() ? *found : none;
  };
  for (const nlohmann::json& name : at(json, "extensionsRequired")) {
    if (name.is_string()) facts.required.push_back(name.get<std::string>());
  }
  const nlohmann::json& nodes = at(json, "nodes");
  const auto add = [&](const std::string& bone, const nlohmann::json& node) {
    const uint32_t role = dcloth_role_of_name(bone.c_str());
    if (role == DCLOTH_ROLE_NONE || !node.is_number_unsigned() || !nodes.is_array()) return;
    const auto index = node.get<uint64_t>();
    if (index >= nodes.size() || !at(nodes[index], "name").is_string()) return;
    facts.roles.emplace_back(at(nodes[index], "name").get<std::string>(), role);
  };
  const nlohmann::json& extensions = at(json, "extensions");
  for (const nlohmann::json& bone : at(at(at(extensions, "VRM"), "humanoid"), "humanBones")) {
    if (at(bone, "bone").is_string()) add(at(bone, "bone").get<std::string>(), at(bone, "node"));
  }
  const nlohmann::json& bones = at(at(at(extensions, "VRMC_vrm"), "humanoid"), "humanBones");
  if (bones.is_object()) {
    for (const auto& [bone, value] : bones.items()) add(bone, at(value, "node"));
  }
  return facts;
}

}  // namespace dcloth::tools

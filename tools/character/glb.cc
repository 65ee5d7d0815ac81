#include "tools/character/glb.h"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>

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

// The JSON of a binary file, or the whole of a plain one; empty where a binary one is cut off.
std::span<const std::byte> DocumentOf(std::span<const std::byte> bytes) {
  if (bytes.size() < kHeaderBytes + kChunkHeaderBytes || std::memcmp(bytes.data(), "glTF", 4) != 0) return bytes;
  const uint64_t length = WordAt(bytes, kHeaderBytes);
  if (length > bytes.size() - kHeaderBytes - kChunkHeaderBytes) return {};
  return bytes.subspan(kHeaderBytes + kChunkHeaderBytes, length);
}

// Not an object where it is no JSON.
nlohmann::json Parse(std::span<const std::byte> document) {
  constexpr int kDeepest = 16;  // VRM's list lies at 5; a hostile depth is cut off
  const auto* const text = reinterpret_cast<const char*>(document.data());
  return nlohmann::json::parse(
      text, text + document.size(),
      [](int depth, nlohmann::json::parse_event_t, nlohmann::json&) { return depth < kDeepest; }, false);
}

const nlohmann::json& At(const nlohmann::json& object, const char* key) {
  static const nlohmann::json none;
  const auto found = object.is_object() ? object.find(key) : object.end();
  return object.is_object() && found != object.end() ? *found : none;
}

uint64_t NumberAt(const nlohmann::json& object, const char* key) {
  const nlohmann::json& number = At(object, key);
  return number.is_number_unsigned() ? number.get<uint64_t>() : 0;
}

// Bytes of an accessor's values, packed; 0 for what is none.
uint64_t AccessorBytes(const nlohmann::json& accessor) {
  const nlohmann::json& type = At(accessor, "type");
  if (!type.is_string()) return 0;
  constexpr std::pair<const char*, uint64_t> kTypes[] = {{"SCALAR", 1}, {"VEC2", 2}, {"VEC3", 3}, {"VEC4", 4},
                                                         {"MAT2", 4},   {"MAT3", 9}, {"MAT4", 16}};
  uint64_t elements = 0;
  for (const auto& [name, count] : kTypes) elements = type.get<std::string>() == name ? count : elements;
  const uint64_t component = NumberAt(accessor, "componentType"), count = NumberAt(accessor, "count");
  const uint64_t width = component == 5120 || component == 5121 ? 1 : component == 5122 || component == 5123 ? 2 : 4;
  return count > kMostZeros ? kMostZeros + 1 : count * elements * width;
}

void Append(uint64_t word, std::vector<std::byte>* bytes) {
  for (int shift = 0; shift < 32; shift += 8) bytes->push_back(static_cast<std::byte>(word >> shift & 0xFF));
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
  GltfFacts facts;
  const nlohmann::json json = Parse(DocumentOf(bytes));
  if (!json.is_object()) return facts;
  for (const nlohmann::json& name : At(json, "extensionsRequired")) {
    if (name.is_string()) facts.required.push_back(name.get<std::string>());
  }
  const nlohmann::json& nodes = At(json, "nodes");
  const auto add = [&](const std::string& bone, const nlohmann::json& node) {
    const uint32_t role = dcloth_role_of_name(bone.c_str());
    if (role == DCLOTH_ROLE_NONE || !node.is_number_unsigned() || !nodes.is_array()) return;
    const auto index = node.get<uint64_t>();
    if (index >= nodes.size() || !At(nodes[index], "name").is_string()) return;
    facts.roles.emplace_back(At(nodes[index], "name").get<std::string>(), role);
  };
  const nlohmann::json& extensions = At(json, "extensions");
  for (const nlohmann::json& bone : At(At(At(extensions, "VRM"), "humanoid"), "humanBones")) {
    if (At(bone, "bone").is_string()) add(At(bone, "bone").get<std::string>(), At(bone, "node"));
  }
  const nlohmann::json& bones = At(At(At(extensions, "VRMC_vrm"), "humanoid"), "humanBones");
  if (bones.is_object()) {
    for (const auto& [bone, value] : bones.items()) add(bone, At(value, "node"));
  }
  return facts;
}

std::vector<std::byte> ForAssimp(std::span<const std::byte> bytes) {
  if (bytes.size() < kHeaderBytes + kChunkHeaderBytes || std::memcmp(bytes.data(), "glTF", 4) != 0) return {};
  const std::span<const std::byte> document = DocumentOf(bytes);
  nlohmann::json json = Parse(document);
  const uint64_t at = kHeaderBytes + kChunkHeaderBytes + (document.size() + 3) / 4 * 4;  // of the buffer's chunk
  const nlohmann::json& buffers = At(json, "buffers");
  const bool one_buffer = buffers.is_array() && buffers.size() == 1 && At(buffers[0], "uri").is_null();
  if (WordAt(bytes, 4) != 2 || !one_buffer || !At(json, "accessors").is_array() ||
      bytes.size() < at + kChunkHeaderBytes)
    return {};
  const uint64_t held = NumberAt(buffers[0], "byteLength");
  if (held > bytes.size() - at - kChunkHeaderBytes) return {};
  uint64_t zeros = 0;
  const auto is_empty = [](const nlohmann::json& accessor) {
    return accessor.is_object() && !accessor.contains("bufferView") && !accessor.contains("sparse");
  };
  for (const nlohmann::json& accessor : json["accessors"]) {
    if (is_empty(accessor)) zeros = std::max(zeros, AccessorBytes(accessor));
  }
  if (zeros > kMostZeros) return {};
  bool webp = false;
  for (size_t i = 0; At(json, "textures").is_array() && i < json["textures"].size(); ++i) {
    nlohmann::json& texture = json["textures"][i];
    const nlohmann::json& source = At(At(At(texture, "extensions"), "EXT_texture_webp"), "source");
    if (!source.is_number_unsigned() || texture.contains("source")) continue;
    texture["source"] = source;
    webp = true;
  }
  if (zeros == 0 && !webp) return {};
  uint64_t size = held;
  if (zeros != 0) {
    const uint64_t begin = (held + 15) / 16 * 16;
    size = begin + (zeros + 15) / 16 * 16;
    if (!At(json, "bufferViews").is_array()) json["bufferViews"] = nlohmann::json::array();
    for (nlohmann::json& accessor : json["accessors"]) {
      if (is_empty(accessor)) accessor["bufferView"] = json["bufferViews"].size();
    }
    json["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", begin}, {"byteLength", size - begin}});
    json["buffers"][0]["byteLength"] = size;
  }
  std::string text = json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  text.resize((text.size() + 3) / 4 * 4, ' ');
  std::vector<std::byte> out;
  out.reserve(kHeaderBytes + 2 * kChunkHeaderBytes + text.size() + size);
  const auto append = [&](std::span<const std::byte> part) { out.insert(out.end(), part.begin(), part.end()); };
  append(bytes.first(8));
  Append(kHeaderBytes + 2 * kChunkHeaderBytes + text.size() + (size + 3) / 4 * 4, &out);
  Append(text.size(), &out);
  append(bytes.subspan(kHeaderBytes + 4, 4));
  append(std::as_bytes(std::span(text)));
  const uint64_t padded = (size + 3) / 4 * 4;
  Append(padded, &out);
  append(bytes.subspan(at + 4, 4));
  append(bytes.subspan(at + kChunkHeaderBytes, held));
  out.resize(out.size() + (padded - held));
  return out;
}

}  // namespace dcloth::tools

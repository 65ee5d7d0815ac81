#include <fstream>  // tinygltf's own want
#include <nlohmann/json.hpp>

#define TINYGLTF_IMPLEMENTATION
#include <algorithm>
#include <cstdint>
#include <cstring>
#include <exception>
#include <new>
#include <optional>

#include "converter/error.h"
#include "tools/character/gltf_model.h"

namespace dcloth::tools {
namespace {

constexpr uint64_t kHeaderBytes = 12, kChunkHeaderBytes = 8;
constexpr int kDeepest = 64;  // tinygltf calls itself at each level of what it does not know
constexpr const char* kCompressions[] = {"KHR_draco_mesh_compression", "EXT_meshopt_compression",
                                         "KHR_meshopt_compression"};

[[noreturn]] void Refuse(const std::filesystem::path& path, const std::string& found, const std::string& expected,
                         const std::string& mend) {
  throw converter::Error({.path = path, .tensor = {}, .found = found, .expected = expected, .mend = mend});
}

uint64_t WordAt(std::span<const std::byte> bytes, uint64_t at) {
  uint64_t word = 0;
  for (uint64_t i = 0; i < 4; ++i) word |= std::to_integer<uint64_t>(bytes[at + i]) << (8 * i);
  return word;
}

void AtMost(const std::filesystem::path& path, const std::string& what, uint64_t length, uint64_t most) {
  if (length <= most) return;
  Refuse(path, what + " of " + std::to_string(length) + " bytes",
         "at most " + std::to_string(most) + ", the size of the file",
         "the file is damaged or cut off; export it again");
}

bool IsBinary(std::span<const std::byte> bytes) {
  return bytes.size() >= kHeaderBytes + kChunkHeaderBytes && std::memcmp(bytes.data(), "glTF", 4) == 0;
}

void CheckLengths(const std::filesystem::path& path, std::span<const std::byte> bytes) {
  const uint64_t size = bytes.size(), whole = WordAt(bytes, 8);
  AtMost(path, "a binary glTF", whole, size);
  uint64_t at = kHeaderBytes;
  do {
    const uint64_t length = WordAt(bytes, at);
    AtMost(path, "a chunk at byte " + std::to_string(at), length, size - at - kChunkHeaderBytes);
    at += kChunkHeaderBytes + (length + 3) / 4 * 4;  // writers may leave a chunk's padding uncounted
  } while (at + kChunkHeaderBytes <= whole);
}

void CheckVersion(const std::filesystem::path& path, const std::string& version) {
  if (version.empty() || version.starts_with("2.")) return;
  Refuse(path, "a file of glTF " + version.substr(0, 8), "glTF 2.0",
         "export it again as glTF 2.0; glTF 1.0 is rewritten by: npx gltf-pipeline -i OLD.gltf -o NEW.glb");
}

// Takes any JSON that is not too deep, and keeps the text asset.version and where it ends to be JSON.
struct JsonCheck : nlohmann::json_sax<nlohmann::json> {
  bool null() override { return true; }
  bool boolean(bool) override { return true; }
  bool number_integer(int64_t) override { return true; }
  bool number_unsigned(uint64_t) override { return true; }
  bool number_float(double, const std::string&) override { return true; }
  bool string(std::string& value) override {
    if (at_version) version = value;
    return true;
  }
  bool binary(binary_t&) override { return true; }
  bool key(std::string& name) override {
    if (depth == 1) in_asset = name == "asset";
    at_version = depth == 2 && in_asset && name == "version";
    return true;
  }
  bool start_object(size_t) override { return ++depth <= kDeepest; }
  bool start_array(size_t) override { return ++depth <= kDeepest; }
  bool end_object() override { return --depth >= 0; }
  bool end_array() override { return --depth >= 0; }
  bool parse_error(size_t position, const std::string&, const nlohmann::json::exception&) override {
    error_at = position;
    return false;
  }

  int depth = 0;
  bool in_asset = false, at_version = false;
  std::string version;
  std::optional<size_t> error_at;  // bytes read
};

void CheckJson(const std::filesystem::path& path, std::span<const std::byte> bytes, size_t first, size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()) + first, size);
  JsonCheck check;
  if (nlohmann::json::sax_parse(text.begin(), text.end(), &check)) return CheckVersion(path, check.version);
  if (!check.error_at) {
    Refuse(path, "JSON that nests too deep", "at most " + std::to_string(kDeepest) + " levels",
           "the file is damaged; export it again");
  }
  constexpr size_t kBefore = 24, kAfter = 8;
  const size_t at = std::min(*check.error_at == 0 ? 0 : *check.error_at - 1, size), from = at - std::min(at, kBefore);
  const auto line = 1 + std::ranges::count(text.substr(0, at), '\n');
  Refuse(path,
         "text that is not JSON at byte " + std::to_string(first + at) + " (line " + std::to_string(line) + "): '" +
             std::string(text.substr(from, at + kAfter - from)) + "'",
         "JSON, which has no NaN, Infinity, comments or loose commas", "the file is damaged, or its exporter is");
}

std::filesystem::path Utf8Path(const std::string& name) { return std::u8string(name.begin(), name.end()); }

bool FileExists(const std::string& file, void* folder) { return static_cast<Folder*>(folder)->Has(Utf8Path(file)); }
std::string SamePath(const std::string& file, void*) { return file; }
bool ReadWholeFile(std::vector<unsigned char>* out, std::string* error, const std::string& file, void* folder) {
  const auto bytes = static_cast<Folder*>(folder)->Read(Utf8Path(file));
  if (!bytes) {
    *error += "it cannot be read";
    return false;
  }
  const auto* const first = reinterpret_cast<const unsigned char*>(bytes->data());
  out->assign(first, first + bytes->size());
  return true;
}

// Bytes of a view are not looked at: its range is not checked yet.
bool KeepPicture(tinygltf::Image* image, int, std::string*, std::string*, int, int, const unsigned char* bytes,
                 int size, void*) {
  if (image->bufferView < 0 && size > 0) image->image.assign(bytes, bytes + size);
  return true;
}

// tinygltf's lines as one, without those about what glTF allows: channels of no node, skins without bind matrices.
std::string Complaints(const std::string& text) {
  std::string out;
  for (size_t at = 0; at < text.size();) {
    const size_t end = std::min(text.find('\n', at), text.size());
    std::string line = text.substr(at, end - at);
    at = end + 1;
    if (line.starts_with("'node' property is missing") || line.starts_with("`node` field is missing") ||
        line.starts_with("'inverseBindMatrices' property is missing"))
      continue;
    while (line.ends_with(' ') || line.ends_with('.')) line.pop_back();
    if (!line.empty()) out += (out.empty() ? "" : "; ") + line;
  }
  return out;
}

}  // namespace

std::filesystem::path UriPath(const std::string& uri) { return Utf8Path(tinygltf::dlib::urldecode(uri)); }

tinygltf::Model ReadGltfModel(const std::filesystem::path& path, std::span<const std::byte> bytes, Folder* folder) {
  const bool binary = IsBinary(bytes);
  if (binary) {
    CheckVersion(path, std::to_string(WordAt(bytes, 4)) + ".0");
    CheckLengths(path, bytes);
    CheckJson(path, bytes, kHeaderBytes + kChunkHeaderBytes, static_cast<size_t>(WordAt(bytes, kHeaderBytes)));
  } else {
    CheckJson(path, bytes, 0, bytes.size());
  }
  tinygltf::TinyGLTF reader;
  reader.SetFsCallbacks({&FileExists, &SamePath, &ReadWholeFile, nullptr, folder});
  reader.SetImageLoader(&KeepPicture, nullptr);
  tinygltf::Model model;
  std::string error, warning;
  bool read = false;
  const std::u8string base = (path.has_parent_path() ? path.parent_path() : ".").u8string();
  const std::string base_text(base.begin(), base.end());
  try {
    const auto size = static_cast<unsigned>(bytes.size());
    read = binary ? reader.LoadBinaryFromMemory(&model, &error, &warning,
                                                reinterpret_cast<const unsigned char*>(bytes.data()), size, base_text)
                  : reader.LoadASCIIFromString(&model, &error, &warning, reinterpret_cast<const char*>(bytes.data()),
                                               size, base_text);
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception& thrown) {  // of what it does not check
    error += thrown.what();
  }
  for (const std::string& name : model.extensionsRequired) {
    if (std::ranges::find(kCompressions, name) == std::end(kCompressions)) continue;
    Refuse(path, "a mesh compressed with " + name, "a glTF file without compression",
           "export it without compression, or remove it: npx @gltf-transform/cli copy IN.glb OUT.glb");
  }
  const std::string complaints = Complaints(error);
  if (read && complaints.empty()) return model;
  Refuse(path, "a file that tinygltf cannot read: " + (complaints.empty() ? "it does not say why" : complaints),
         "a sound glTF 2.0 file", "export it again, with its buffers beside it or as .glb");
}

}  // namespace dcloth::tools

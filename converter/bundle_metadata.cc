#include "converter/bundle_metadata.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>

#include "converter/error.h"

namespace dcloth::converter {
namespace {

[[noreturn]] void Refuse(const SafeFile& file, std::string_view key, const std::string& found,
                         const std::string& expected) {
  throw Error({file.path(), "", "metadata '" + std::string(key) + "' " + found, expected, "see converter/BUNDLE.md"});
}

// Long values are cut: a message is for people.
std::string Quoted(const std::string& value) {
  return "'" + (value.size() > 60 ? value.substr(0, 60) + "..." : value) + "'";
}

// Lists and objects here are shallow; a hostile one must not exhaust the stack or the memory of later users.
nlohmann::json ParseJson(const std::string& text) {
  constexpr int kMaxDepth = 32;
  // The parser takes a zero byte for the end of its input and would pass what hides behind it.
  bool deep = text.find('\0') != std::string::npos;
  const auto shallow = [&](int depth, nlohmann::json::parse_event_t, nlohmann::json&) {
    deep = deep || depth > kMaxDepth;
    return !deep;
  };
  nlohmann::json value = nlohmann::json::parse(text, shallow, /*allow_exceptions=*/false);
  return deep ? nlohmann::json(nlohmann::json::value_t::discarded) : value;
}

}  // namespace

std::vector<std::string> UniqueNames(const SafeFile& file, std::string_view key) {
  const std::string& text = file.RequireMetadata(key);
  const nlohmann::json list = ParseJson(text);
  const bool names_only =
      list.is_array() && !list.empty() &&
      std::all_of(list.begin(), list.end(), [](const nlohmann::json& name) { return name.is_string(); });
  if (!names_only) Refuse(file, key, Quoted(text), "a JSON list of one or more names");
  std::vector<std::string> names;
  std::set<std::string> seen;
  for (const nlohmann::json& name : list) {
    names.push_back(name.get<std::string>());
    // The engine hands names out as C strings.
    if (names.back().empty() || names.back().find('\0') != std::string::npos) {
      Refuse(file, key, "with a name that is empty or has a zero byte", "names without zero bytes");
    }
    if (!seen.insert(names.back()).second) Refuse(file, key, "with " + Quoted(names.back()) + " twice", "unique names");
  }
  return names;
}

std::vector<int32_t> Parents(const SafeFile& file, std::string_view key, size_t joints) {
  const auto text = file.metadata().find(key);
  if (text == file.metadata().end()) return {};
  const nlohmann::json list = ParseJson(text->second);
  const auto is_parent = [&](const nlohmann::json& parent) {
    if (!parent.is_number_integer()) return false;
    // As double: a huge unsigned number must not wrap.
    return parent.get<double>() >= -1 && parent.get<double>() < static_cast<double>(joints);
  };
  if (!list.is_array() || list.size() != joints || !std::ranges::all_of(list, is_parent)) {
    Refuse(file, key, Quoted(text->second),
           "a JSON list of " + std::to_string(joints) + " indices into joint_names, or -1");
  }
  const auto parents = list.get<std::vector<int32_t>>();
  for (size_t joint = 0; joint < joints; ++joint) {
    int32_t above = parents[joint];
    for (size_t steps = 0; above >= 0 && steps < joints; ++steps) above = parents[static_cast<size_t>(above)];
    if (above >= 0)
      Refuse(file, key, "in which joint " + std::to_string(joint) + " is below itself",
             "parents that lead to a root (-1)");
  }
  return parents;
}

double PositiveNumber(const SafeFile& file, std::string_view key, double limit) {
  const std::string& text = file.RequireMetadata(key);
  double value = 0;
  const auto [end, failed] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (failed != std::errc() || end != text.data() + text.size() || !(value > 0 && value <= limit)) {
    Refuse(file, key, Quoted(text), "a number above 0, at most " + std::to_string(static_cast<int>(limit)));
  }
  return value;
}

size_t OneOf(const SafeFile& file, std::string_view key, std::span<const std::string_view> allowed) {
  const std::string& text = file.RequireMetadata(key);
  const auto found = std::ranges::find(allowed, text);
  if (found != allowed.end()) return static_cast<size_t>(found - allowed.begin());
  std::string names;
  for (const std::string_view name : allowed) names += (names.empty() ? "'" : ", '") + std::string(name) + "'";
  Refuse(file, key, Quoted(text), names);
}

std::string JsonObject(const SafeFile& file, std::string_view key) {
  const auto found = file.metadata().find(key);
  if (found == file.metadata().end()) return "{}";
  if (!ParseJson(found->second).is_object()) Refuse(file, key, Quoted(found->second), "a JSON object");
  return found->second;
}

uint32_t IndexOf(const SafeFile& file, std::string_view key, const std::string& name,
                 const std::vector<std::string>& names) {
  const auto found = std::find(names.begin(), names.end(), name);
  if (found == names.end()) Refuse(file, key, "with " + Quoted(name), "a name from joint_names");
  return static_cast<uint32_t>(found - names.begin());
}

}  // namespace dcloth::converter

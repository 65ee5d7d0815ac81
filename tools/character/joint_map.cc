#include "tools/character/joint_map.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <numeric>
#include <set>
#include <unordered_map>
#include <utility>

#include "converter/error.h"
#include "converter/file.h"

namespace dcloth::tools {
namespace {

// "mixamorig:LeftUpLeg" and "left_up_leg" are the same word.
std::string Plain(const std::string& name) {
  const size_t colon = name.rfind(':');
  std::string plain;
  for (const char c : name.substr(colon == std::string::npos ? 0 : colon + 1)) {
    if (c >= 'A' && c <= 'Z') plain += static_cast<char>(c - 'A' + 'a');
    if ((c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || static_cast<unsigned char>(c) >= 0x80) plain += c;
  }
  return plain;
}

size_t EditDistance(const std::string& a, const std::string& b) {
  std::vector<size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), size_t{0});
  for (size_t i = 1; i <= a.size(); ++i) {
    size_t corner = std::exchange(row[0], i);
    for (size_t j = 1; j <= b.size(); ++j) {
      const size_t swapped = corner + (a[i - 1] != b[j - 1]);
      corner = row[j];
      row[j] = std::min({swapped, row[j] + 1, row[j - 1] + 1});
    }
  }
  return row[b.size()];
}

}  // namespace

JointMap ReadJointMap(const std::filesystem::path& path) {
  const converter::AlignedBytes bytes = converter::ReadFile(path, uint64_t{1} << 20);
  const auto refuse = [&](const std::string& found) {
    throw converter::Error({.path = path,
                            .tensor = {},
                            .found = found,
                            .expected = "a JSON object {\"joint of the garment\": \"node of the file\", ...}",
                            .mend = {}});
  };
  const auto* const text = reinterpret_cast<const char*>(bytes.data());
  // Arrays and objects in the values are refused before they can nest deeper than the stack is.
  bool nested = false;
  const auto parsed = nlohmann::json::parse(
      text, text + bytes.size(),
      [&](int depth, nlohmann::json::parse_event_t event, nlohmann::json&) {
        nested |= depth > 0 && (event == nlohmann::json::parse_event_t::object_start ||
                                event == nlohmann::json::parse_event_t::array_start);
        return !nested;
      },
      false);
  if (nested || !parsed.is_object())
    refuse(nested ? "a list or an object inside the map" : "text that is not a JSON object");
  JointMap map;
  for (const auto& [joint, node] : parsed.items()) {
    if (!node.is_string()) refuse("joint '" + joint + "' with a value that is not a string");
    map.emplace(joint, node.get<std::string>());
  }
  return map;
}

std::vector<std::string> JointsOf(const CharacterFile& file, const JointMap& map) {
  std::map<std::string, std::string> joint_of;
  for (const auto& [joint, node] : map) joint_of.emplace(node, joint);
  std::vector<bool> wanted(file.nodes.size());
  bool skin = false;
  for (size_t i = 0; i < file.nodes.size(); ++i) skin |= wanted[i] = file.nodes[i].bind.has_value();
  if (!skin) {
    for (const CharacterClip& clip : file.clips) {
      for (const NodeChannel& channel : clip.channels) wanted[channel.node] = true;
    }
  }
  std::vector<std::string> joints;
  std::map<std::string, std::string> node_of;
  for (size_t i = 0; i < file.nodes.size(); ++i) {
    const std::string& node = file.nodes[i].name;
    const auto named = joint_of.find(node);
    if ((!wanted[i] && named == joint_of.end()) || file.nodes[i].helper) continue;
    joints.push_back(named == joint_of.end() ? node : named->second);
    const auto [other, fresh] = node_of.emplace(joints.back(), node);
    if (fresh || other->second == node) continue;
    throw converter::Error({.path = file.path,
                            .tensor = {},
                            .found = "the nodes '" + other->second + "' and '" + node +
                                     "', which the map gives the same joint '" + joints.back() + "'",
                            .expected = "one node for each joint",
                            .mend = "map both nodes, or choose another name in --map"});
  }
  return joints;
}

std::vector<size_t> FindJoints(const CharacterFile& file, const JointMap& map, std::span<const std::string> joints) {
  std::unordered_map<std::string, std::vector<size_t>> index;
  std::vector<std::string> held;
  for (size_t i = 0; i < file.nodes.size(); ++i) {
    if (file.nodes[i].helper) continue;
    index[file.nodes[i].name].push_back(i);
    held.push_back(file.nodes[i].name);
  }
  std::vector<size_t> nodes;
  std::string missing;
  for (const std::string& joint : joints) {
    const auto mapped = map.find(joint);
    const std::string& name = mapped == map.end() ? joint : mapped->second;
    const auto found = index.find(name);
    if (found == index.end()) {
      missing += (missing.empty() ? "'" : "; '") + joint + (mapped == map.end() ? "'" : "' (mapped to '" + name + "')");
      const std::vector<std::string> nearest = NearestNames(name, held, 3);
      for (size_t k = 0; k < nearest.size(); ++k)
        missing += (k == 0 ? ", the closest names are '" : "', '") + nearest[k];
      if (!nearest.empty()) missing += "'";
      continue;
    }
    if (found->second.size() > 1) {
      throw converter::Error({.path = file.path,
                              .tensor = {},
                              .found = std::to_string(found->second.size()) + " nodes called '" + name + "'",
                              .expected = "one node for the joint '" + joint + "'",
                              .mend = "rename the nodes and export again"});
    }
    nodes.push_back(found->second.front());
  }
  if (!missing.empty()) {
    throw converter::Error({.path = file.path,
                            .tensor = {},
                            .found = "no node for the joints " + missing,
                            .expected = "a node for every joint of the garment",
                            .mend = "name the nodes in a file, {\"joint\": \"node\", ...}, and pass it with --map"});
  }
  return nodes;
}

std::vector<std::string> NearestNames(const std::string& name, std::span<const std::string> held, size_t count) {
  const std::string plain = Plain(name);
  std::set<std::pair<size_t, std::string>> ranked;  // distance, name
  for (const std::string& other : held) {
    const std::string word = Plain(other);
    if (word.empty() || word.size() > 256 || plain.size() > 256) continue;
    ranked.emplace(EditDistance(plain, word), other);
  }
  std::vector<std::string> nearest;
  for (const auto& [distance, other] : ranked) {
    // More letters changed than the shorter word has: no likeness at all.
    if (nearest.size() == count || distance >= std::max<size_t>(plain.size(), 1)) break;
    nearest.push_back(other);
  }
  return nearest;
}

std::vector<std::string> OwnNames(const CharacterFile& file) {
  std::vector<std::string> names;
  std::vector<size_t> joints;
  const bool skin = std::ranges::any_of(file.nodes, [](const CharacterNode& node) { return node.bind.has_value(); });
  for (size_t i = 0; i < file.nodes.size(); ++i) {
    names.push_back(file.nodes[i].name);
    if (!file.nodes[i].helper && (!skin || file.nodes[i].bind)) joints.push_back(i);
  }
  if (joints.size() < 5) return names;
  const auto nearly_all = [&](const auto& has) {
    return 10 * static_cast<size_t>(std::ranges::count_if(joints, has)) >= 9 * joints.size();
  };
  const auto number = [](const std::string& name) {  // where a number of the name's own begins
    const size_t end = name.find_last_not_of("0123456789");
    return end != name.npos && end > 0 && end + 1 < name.size() && name[end] == '_' ? end : name.size();
  };
  if (nearly_all([&](size_t i) { return number(names[i]) < names[i].size(); })) {
    for (std::string& name : names) name.erase(number(name));
  }
  const std::string sample = names[joints[joints.size() / 2]];
  for (size_t end = sample.find_last_of("_:|.- "); end != sample.npos && end > 0;
       end = sample.find_last_of("_:|.- ", end - 1)) {
    const std::string prefix = sample.substr(0, end + 1);
    if (!nearly_all([&](size_t i) { return names[i].starts_with(prefix); })) continue;
    for (std::string& name : names) {
      if (name.size() > prefix.size() && name.starts_with(prefix)) name.erase(0, prefix.size());
    }
    break;
  }
  return names;
}

std::string JsonList(std::span<const std::string> names) {
  return nlohmann::json(std::vector<std::string>(names.begin(), names.end()))
      .dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace dcloth::tools

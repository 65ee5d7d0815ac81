#include "tools/cli.h"

#include <cstdio>
#include <limits>
#include <string>
#include <system_error>
#include <utility>

#include "converter/error.h"

namespace dcloth::tools {
namespace {

CLI::Validator Check(double low, double high, const std::string& allowed, std::string name) {
  return CLI::Validator(
      [low, high, allowed](std::string& text) {
        double value = 0;
        const bool good = CLI::detail::lexical_cast(text, value) && value >= low && value <= high;  // false for NaN
        return good ? std::string() : "found " + text + ", expected " + allowed;
      },
      std::move(name));
}

std::string Text(double value) {
  char text[32];
  std::snprintf(text, sizeof(text), "%g", value);
  return text;
}

namespace fs = std::filesystem;

// With links followed as far as there are files.
fs::path Whole(const fs::path& path) {
  std::error_code failed;
  const fs::path absolute = fs::absolute(path, failed);
  const fs::path whole = fs::weakly_canonical(absolute, failed);
  return failed ? absolute.lexically_normal() : whole;
}

[[noreturn]] void Refuse(const fs::path& path, const std::string& option, const std::string& taken) {
  throw converter::Error({.path = path,
                          .tensor = {},
                          .found = "the same file for " + option + " and " + taken,
                          .expected = {},
                          .mend = "give " + option + " a different name"});
}

}  // namespace

CLI::Validator NumberWithin(double low, double high) {
  const std::string from = Text(low), to = Text(high);
  return Check(low, high, "a number from " + from + " to " + to, "in [" + from + " - " + to + "]");
}

CLI::Validator NumberAboveZero() {
  return Check(std::numeric_limits<double>::denorm_min(), std::numeric_limits<double>::max(), "a number above 0",
               "above 0");
}

bool IsSameFile(const fs::path& a, const fs::path& b) {
  std::error_code failed;  // where one of them is not there
  return fs::equivalent(a, b, failed) || Whole(a) == Whole(b);
}

void CommandFiles::Reads(std::string what, const fs::path& path) {
  if (!path.empty()) inputs_.push_back({std::move(what), path});
}

void CommandFiles::Reads(const std::string& what, std::span<const fs::path> paths) {
  for (const fs::path& path : paths) Reads(what, path);
}

void CommandFiles::Writes(std::string option, const fs::path& path) {
  if (!path.empty()) outputs_.push_back({std::move(option), path});
}

void CommandFiles::Check() const {
  for (size_t i = 0; i < outputs_.size(); ++i) {
    const Named& output = outputs_[i];
    for (const Named& input : inputs_) {
      if (IsSameFile(output.path, input.path)) Refuse(output.path, output.name, input.name);
    }
    for (const Named& other : std::span(outputs_).first(i)) {
      if (IsSameFile(output.path, other.path)) Refuse(output.path, output.name, other.name);
    }
  }
}

}  // namespace dcloth::tools

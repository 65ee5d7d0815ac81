#include "tools/number_check.h"

#include <cstdio>
#include <limits>
#include <string>
#include <utility>

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

}  // namespace

CLI::Validator NumberWithin(double low, double high) {
  const std::string from = Text(low), to = Text(high);
  return Check(low, high, "a number from " + from + " to " + to, "in [" + from + " - " + to + "]");
}

CLI::Validator NumberAboveZero() {
  return Check(std::numeric_limits<double>::denorm_min(), std::numeric_limits<double>::max(), "a number above 0",
               "above 0");
}

}  // namespace dcloth::tools

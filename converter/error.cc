#include "converter/error.h"

#include <cstdint>
#include <cstdio>
#include <utility>

namespace dcloth::converter {
namespace {

// Length of the well-formed UTF-8 sequence at `at`, 0 where there is none (Unicode 15, table 3-7).
size_t Utf8Length(const std::string& text, size_t at) {
  // At most one past the end, which reads as zero: no byte behind that goes with it is looked at.
  auto byte = [&](size_t i) { return static_cast<uint8_t>(text[i]); };
  auto within = [&](size_t i, uint8_t low, uint8_t high) { return byte(i) >= low && byte(i) <= high; };
  auto tail = [&](size_t i) { return within(i, 0x80, 0xBF); };
  const uint8_t lead = byte(at);
  if (lead < 0x80) return 1;
  if (lead >= 0xC2 && lead <= 0xDF) return tail(at + 1) ? 2 : 0;
  if (lead >= 0xE0 && lead <= 0xEF) {
    const bool second = within(at + 1, lead == 0xE0 ? 0xA0 : 0x80, lead == 0xED ? 0x9F : 0xBF);
    return second && tail(at + 2) ? 3 : 0;
  }
  if (lead >= 0xF0 && lead <= 0xF4) {
    const bool second = within(at + 1, lead == 0xF0 ? 0x90 : 0x80, lead == 0xF4 ? 0x8F : 0xBF);
    return second && tail(at + 2) && tail(at + 3) ? 4 : 0;
  }
  return 0;
}

// Of the character at `at`, `length` bytes long: U+0000 to U+001F and U+007F to U+009F, which terminals take for
// orders.
bool IsControl(const std::string& text, size_t at, size_t length) {
  const auto lead = static_cast<uint8_t>(text[at]);
  return lead < 0x20 || lead == 0x7F || (length == 2 && lead == 0xC2 && static_cast<uint8_t>(text[at + 1]) < 0xA0);
}

std::string Compose(const ErrorParts& parts) {
  std::string text = PathText(parts.path);
  auto join = [&](const char* separator, const char* label, const std::string& more) {
    if (more.empty()) return;
    if (!text.empty()) text.append(separator);
    text.append(label).append(PrintableText(more));
  };
  join(": ", "tensor ", parts.tensor);
  join(": ", "found ", parts.found);
  join(parts.found.empty() ? ": " : ", ", "expected ", parts.expected);
  join("; ", "", parts.mend);
  return text;
}

}  // namespace

std::string PrintableText(const std::string& raw) {
  std::string text;
  for (size_t at = 0; at < raw.size();) {
    const size_t length = Utf8Length(raw, at);
    if (length == 0 || IsControl(raw, at, length)) {
      text += '?';
    } else {
      text.append(raw, at, length);
    }
    at += length == 0 ? 1 : length;
  }
  return text;
}

std::string PathText(const std::filesystem::path& path) {
#if defined(_WIN32)
  const std::u8string wide = path.u8string();
  const std::string raw(wide.begin(), wide.end());
#else
  const std::string& raw = path.native();
#endif
  return PrintableText(raw);
}

std::string NumberText(double value) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.6g", value);
  return text;
}

Error::Error(ErrorParts parts) : std::runtime_error(Compose(parts)), parts_(std::move(parts)) {}

}  // namespace dcloth::converter

#include "tools/obj.h"

#include <charconv>

#include "converter/error.h"

namespace dcloth::tools {
namespace {

template <typename Number>
void Append(Number value, std::string* text) {
  char digits[32];
  text->push_back(' ');
  text->append(digits, std::to_chars(digits, digits + sizeof(digits), value).ptr);
}

}  // namespace

std::string ObjText(const std::string& name, std::span<const float> positions, std::span<const uint16_t> triangles) {
  std::string text = "# metres, +Y up, +Z front\no " + converter::PrintableText(name) + "\n";
  for (size_t i = 0; i + 2 < positions.size(); i += 3) {
    text += 'v';
    for (size_t a = 0; a < 3; ++a) Append(positions[i + a], &text);
    text += '\n';
  }
  for (size_t i = 0; i + 2 < triangles.size(); i += 3) {
    text += 'f';
    for (size_t a = 0; a < 3; ++a) Append(triangles[i + a] + 1, &text);
    text += '\n';
  }
  return text;
}

}  // namespace dcloth::tools

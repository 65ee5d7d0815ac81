#include "engine/format/diagnostic.h"

#include <cstddef>
#include <cstring>

namespace dcloth::format {

Text& Text::Add(const char* text) {
  for (; *text != '\0' && left_ > 1; ++text, --left_) *out_++ = *text;
  *out_ = '\0';
  return *this;
}

Text& Text::AddName(const char* name) {
  for (; *name != '\0' && left_ > 1; ++name, --left_) {
    const auto byte = static_cast<unsigned char>(*name);
    *out_++ = byte < 0x20 || byte == 0x7F ? '?' : *name;
  }
  *out_ = '\0';
  return *this;
}

Text& Text::Add(uint64_t value) {
  char digits[21];
  char* first = digits + sizeof(digits) - 1;
  *first = '\0';
  do {
    *--first = static_cast<char>('0' + value % 10);
    value /= 10;
  } while (value != 0);
  return Add(first);
}

Text& Text::Add(const Path& path) {
  if (path.parent != nullptr) Add(*path.parent);
  if (path.name != nullptr) {
    if (path.parent != nullptr) Add(".");
    Add(path.name);
  }
  if (path.index != Path::kNoIndex) Add("[").Add(static_cast<uint64_t>(path.index)).Add("]");
  return *this;
}

Text& Text::AddNumber(double value) {
  if (value != value) return Add("NaN");
  if (value < 0) Add("-");
  double magnitude = value < 0 ? -value : value;
  if (magnitude > 1.7e308) return Add("infinity");
  uint64_t down = 0, up = 0;  // decimal places moved, so that magnitude lies in [1, 10) or is 0
  while (magnitude >= 10) magnitude /= 10, ++down;
  while (magnitude > 0 && magnitude < 1) magnitude *= 10, ++up;
  auto scaled = static_cast<uint64_t>(magnitude * 100000 + 0.5);
  if (scaled == 1000000) {  // rounded up to the next power of ten
    scaled = 100000;
    up != 0 ? --up : ++down;
  }
  Add(scaled / 100000).Add(".");
  for (uint64_t place = 10000, rest = scaled % 100000; place != 0; rest %= place, place /= 10) Add(rest / place);
  if (down != 0) return Add("e").Add(down);
  if (up != 0) return Add("e-").Add(up);
  return *this;
}

namespace {

constexpr size_t kFirstErrorBytes = offsetof(dcloth_error, text) + sizeof(dcloth_error::text);

// Adds what `add` does; which bytes of the text it is.
template <typename Add>
void AddPart(Text* text, uint16_t* at, uint16_t* size, Add add) {
  const size_t before = text->size();
  add();
  *at = static_cast<uint16_t>(before);
  *size = static_cast<uint16_t>(text->size() - before);
}

}  // namespace

// 0.1.0 knew no parts of the text.
Diagnostic::Diagnostic(dcloth_error* error)
    : error_(error != nullptr && error->struct_size >= kFirstErrorBytes ? error : nullptr) {}

bool Diagnostic::Fail(dcloth_status status, uint64_t offset, const Path* path, const char* found, const char* allowed,
                      const char* fix) {
  if (status_ != DCLOTH_OK) return false;
  status_ = status;
  if (error_ == nullptr) return false;
  error_->status = status;
  error_->offset_bytes = offset;
  dcloth_error parts = {};
  Text text(error_->text, sizeof(error_->text));
  text.Add("");
  AddPart(&text, &parts.what_at, &parts.what_size, [&] { path != nullptr ? void(text.Add(*path)) : void(); });
  text.Add(path != nullptr ? ": found " : "found ");
  AddPart(&text, &parts.found_at, &parts.found_size, [&] { text.Add(found); });
  text.Add("; allowed: ");
  AddPart(&text, &parts.allowed_at, &parts.allowed_size, [&] { text.Add(allowed); });
  if (*fix != '\0') text.Add("; ");
  AddPart(&text, &parts.mend_at, &parts.mend_size, [&] { text.Add(fix); });
  if (error_->struct_size >= sizeof(dcloth_error)) {
    std::memcpy(&error_->what_at, &parts.what_at, sizeof(dcloth_error) - offsetof(dcloth_error, what_at));
  }
  return false;
}

bool Diagnostic::FailCount(dcloth_status status, uint64_t offset, const Path* path, uint64_t found, const char* unit,
                           const char* allowed, const char* fix) {
  char number[64];
  Text(number, sizeof(number)).Add(found).Add(unit);
  return Fail(status, offset, path, number, allowed, fix);
}

}  // namespace dcloth::format

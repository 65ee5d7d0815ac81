// Says what is wrong with a model: where (a path of field names and a byte), what was found, what is allowed, what
// helps.
//
// A check calls Fail and returns its result, which is always false, so that checks chain with &&. The first failure
// wins. The text is written into the caller's dcloth_error, if there is one; what is checked never depends on it.
#ifndef DCLOTH_ENGINE_FORMAT_DIAGNOSTIC_H_
#define DCLOTH_ENGINE_FORMAT_DIAGNOSTIC_H_

#include <cstddef>
#include <cstdint>

#include "dcloth/dcloth.h"

namespace dcloth::format {

constexpr uint64_t kNoOffset = UINT64_MAX;

// A field's place, as a chain on the stack from the field up to the root: "mesh_stage.layers[1].output".
struct Path {
  static constexpr int64_t kNoIndex = -1;
  const Path* parent;  // null for a field of Model
  const char* name;    // null where `index` alone tells elements of the parent apart
  int64_t index = kNoIndex;
};

// Terminated text in memory of a fixed size; what does not fit is cut off.
class Text {
 public:
  Text(char* out, size_t size) : begin_(out), out_(out), left_(size) {}
  size_t size() const { return static_cast<size_t>(out_ - begin_); }
  Text& Add(const char* text);
  Text& AddName(
      const char* name);  // of a file: ASCII control characters become '?', as it may go to a terminal or a log
  Text& Add(uint64_t value);
  Text& Add(const Path& path);
  Text& AddNumber(double value);  // six significant digits

 private:
  const char* begin_;
  char* out_;
  size_t left_;  // the terminator's byte included
};

class Diagnostic {
 public:
  explicit Diagnostic(dcloth_error* error);

  dcloth_status status() const { return status_; }

  // `found`, `allowed` and `fix` complete "found ...; allowed ...; ...". Always false.
  bool Fail(dcloth_status status, uint64_t offset, const Path* path, const char* found, const char* allowed,
            const char* fix);

  // A number that was found. `unit` follows it and names what it counts.
  bool FailCount(dcloth_status status, uint64_t offset, const Path* path, uint64_t found, const char* unit,
                 const char* allowed, const char* fix);

 private:
  dcloth_error* error_;  // null where the caller wants no text
  dcloth_status status_ = DCLOTH_OK;
};

}  // namespace dcloth::format

#endif  // DCLOTH_ENGINE_FORMAT_DIAGNOSTIC_H_

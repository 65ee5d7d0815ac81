#include <cstring>

#include "converter/convert.h"
#include "converter/error.h"
#include "tests/attack/open_and_run.h"
#include "tests/fuzz/targets.h"

namespace dcloth::testing {

Verdict FuzzBundle(const uint8_t* bytes, size_t size) {
  converter::AlignedBytes file(size);
  if (size != 0) std::memcpy(file.data(), bytes, size);
  converter::AlignedBytes model;
  try {
    const converter::Bundle bundle = converter::BundleFrom(converter::SafeFile::Parse(std::move(file), "bundle"));
    converter::ConvertOptions options;
    options.precision = converter::Precision::kInt8;
    model = converter::Convert(bundle, options).bytes;
  } catch (const converter::Error& error) {
    return {*error.what() != '\0' ? "" : "a refusal without a word", false};
  }
  const Outcome outcome = OpenAndRun(model.data(), model.size());
  if (outcome.status != DCLOTH_OK) return {"a converted model that does not open: " + outcome.text, false};
  return {outcome.broken_promise, true};
}

}  // namespace dcloth::testing

// Why the converter refuses a bundle; empty where it takes it.
#ifndef DCLOTH_TESTS_UNIT_CONVERTER_BUNDLE_REFUSAL_H_
#define DCLOTH_TESTS_UNIT_CONVERTER_BUNDLE_REFUSAL_H_

#include <string>

#include "tests/unit/converter/bundle_builder.h"
#include "tests/unit/converter/error_text.h"

namespace dcloth::testing {

inline std::string Refusal(const RawFile& raw) {
  return ErrorText([&] { ParseRawBundle(raw); });
}

}  // namespace dcloth::testing

#endif  // DCLOTH_TESTS_UNIT_CONVERTER_BUNDLE_REFUSAL_H_

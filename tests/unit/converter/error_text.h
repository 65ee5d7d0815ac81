// What a call's converter::Error says.
#ifndef DCLOTH_TESTS_UNIT_CONVERTER_ERROR_TEXT_H_
#define DCLOTH_TESTS_UNIT_CONVERTER_ERROR_TEXT_H_

#include <gtest/gtest.h>

#include <string>
#include <string_view>
#include <utility>

#include "converter/error.h"

namespace dcloth::testing {

// The text of the Error that the call throws, empty where it throws none. Anything else escapes and fails the test.
template <typename Call>
std::string ErrorText(Call&& call) {
  try {
    std::forward<Call>(call)();
  } catch (const converter::Error& error) {
    return error.what();
  }
  return "";
}

// Whether the text holds every part; EXPECT_TRUE prints what is missing.
template <typename... Parts>
::testing::AssertionResult Mentions(std::string_view text, const Parts&... parts) {
  for (const std::string_view part : {std::string_view(parts)...}) {
    if (text.find(part) == std::string_view::npos) {
      return ::testing::AssertionFailure() << "'" << part << "' is not in '" << text << "'";
    }
  }
  return ::testing::AssertionSuccess();
}

}  // namespace dcloth::testing

#endif  // DCLOTH_TESTS_UNIT_CONVERTER_ERROR_TEXT_H_

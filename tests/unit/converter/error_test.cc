#include "converter/error.h"

#include <gtest/gtest.h>

namespace dcloth::converter {
namespace {

TEST(ErrorTest, NamesEveryPartInOrder) {
  const Error error(
      {"dir/skirt.safetensors", "template.positions", "shape [3, 4]", "[n, 3]", "export the bundle again"});
  EXPECT_STREQ(
      error.what(),
      "dir/skirt.safetensors: tensor template.positions: found shape [3, 4], expected [n, 3]; export the bundle again");
}

TEST(ErrorTest, LeavesEmptyPartsOut) {
  EXPECT_STREQ(Error({"a", "", "no such file", "", ""}).what(), "a: found no such file");
  EXPECT_STREQ(Error({"", "", "", "a file", "pass one"}).what(), "expected a file; pass one");
}

TEST(ErrorTest, ThresholdIsAnErrorOfItsOwn) {
  bool threshold = false;
  try {
    throw ThresholdError({"", "", "2 mm", "1 mm", ""});
  } catch (const Error& error) {
    threshold = dynamic_cast<const ThresholdError*>(&error) != nullptr;
  }
  EXPECT_TRUE(threshold);
}

TEST(ErrorTest, HostileNamesReachNoTerminal) {
  const Error error({"", std::string("a\x1B[2J\n\0b", 8), "\xFF", "", ""});
  EXPECT_STREQ(error.what(), "tensor a?[2J??b: found ?");
}

#if !defined(_WIN32)
TEST(ErrorTest, PathTextKeepsUtf8AndReplacesTheRest) {
  EXPECT_EQ(PathText("gr\xC3\xBC\xC3\x9F.bin"), "gr\xC3\xBC\xC3\x9F.bin");
  EXPECT_EQ(PathText("\xE2\x82\xAC \xF0\x9F\x91\x97"), "\xE2\x82\xAC \xF0\x9F\x91\x97");
  EXPECT_EQ(PathText("a\xFF"
                     "b"),
            "a?b");
  EXPECT_EQ(PathText("\xC0\xAF"), "??");            // overlong
  EXPECT_EQ(PathText("\xED\xA0\x80"), "???");       // surrogate
  EXPECT_EQ(PathText("\xF4\x90\x80\x80"), "????");  // beyond U+10FFFF
  EXPECT_EQ(PathText("x\xE2\x82"), "x??");          // cut off
}
#endif

}  // namespace
}  // namespace dcloth::converter

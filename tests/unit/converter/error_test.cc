#include "converter/error.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <string>

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

TEST(ErrorTest, NumbersAreShort) {
  EXPECT_EQ(NumberText(3e38), "3e+38");
  EXPECT_EQ(NumberText(static_cast<double>(0.1f)), "0.1");
  EXPECT_EQ(NumberText(-1e-9), "-1e-09");
  EXPECT_EQ(NumberText(24), "24");
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
  // U+0080 to U+009F are orders too: U+009B is ESC and [ in one.
  EXPECT_EQ(PrintableText("a\xC2\x80"
                          "b\xC2\x9B"
                          "2J\xC2\x9F\x7F\x1F"),
            "a?b?2J???");
  EXPECT_EQ(PrintableText(" ~\xC2\xA0\xC3\x80\xE1\x82\x80"), " ~\xC2\xA0\xC3\x80\xE1\x82\x80");
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

// Every lead with every second byte, by the code point they stand for: one character where it needs as many bytes as it
// has, is no surrogate and not beyond U+10FFFF; a byte that leads nowhere costs itself alone.
TEST(ErrorTest, Utf8EndsWhereUnicodeDoes) {
  constexpr uint32_t kLeast[] = {0, 0, 0x80, 0x800, 0x10000};
  size_t kept = 0;
  for (uint32_t lead = 0x80; lead <= 0xFF; ++lead) {
    const size_t length = lead < 0xC0 ? 1 : lead < 0xE0 ? 2 : lead < 0xF0 ? 3 : 4;
    for (uint32_t second = 0; second <= 0xFF; ++second) {
      std::string text = {static_cast<char>(lead), static_cast<char>(second)};
      uint32_t point = (lead & (0x7Fu >> length)) << 6 | (second & 0x3F);
      for (size_t i = 2; i < length; ++i) {
        text += '\x80';
        point <<= 6;
      }
      const bool sound = length > 1 && lead < 0xF8 && second >= 0x80 && second <= 0xBF && point >= kLeast[length] &&
                         point <= 0x10FFFF && !(point >= 0xD800 && point <= 0xDFFF);
      const std::string expected = sound && point < 0xA0 ? "?" : sound ? text : "?" + PathText(text.substr(1));
      EXPECT_EQ(PathText(text), expected) << lead << " " << second;
      kept += sound ? 1 : 0;
    }
  }
  EXPECT_EQ(kept, 30u * 64 + 14 * 64 + 2 * 32 + 48 + 3 * 64 + 16);  // C2-DF; E0-EF, E0 and ED halved; F0, F1-F3, F4
}
#endif

}  // namespace
}  // namespace dcloth::converter

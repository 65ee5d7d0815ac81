// What an error says: text that never leaves its memory, numbers as they are read, the first failure alone.
#include "engine/format/diagnostic.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

namespace dcloth::format {
namespace {

std::string Number(double value) {
  char out[64];
  Text(out, sizeof(out)).AddNumber(value);
  return out;
}

TEST(DiagnosticText, FillsItsMemoryAndEndsIt) {
  const std::string whole = "mesh_stage";
  for (size_t size = 1; size <= whole.size() + 2; ++size) {
    std::vector<char> out(size + 1, '#');
    Text(out.data(), size).Add(whole.c_str());
    EXPECT_EQ(std::string(out.data()), whole.substr(0, size - 1)) << size;
    EXPECT_EQ(out[size], '#') << size;
  }
  char out[8];
  Text text(out, sizeof(out));
  text.Add("four").Add("").Add("five");  // goes on where it ended
  EXPECT_STREQ(out, "fourfiv");
}

// A name out of a file goes to terminals and logs, where control characters are orders.
TEST(DiagnosticText, NamesGiveNoOrders) {
  char out[32];
  Text(out, sizeof(out)).AddName("\x01 a\x1B[2J\n~\x7F\xC3\xA9\x1F");
  EXPECT_STREQ(out, "? a?[2J?~?\xC3\xA9?");
  const std::string whole = "thigh_l";
  for (size_t size = 1; size <= whole.size() + 2; ++size) {
    std::vector<char> small(size + 1, '#');
    Text(small.data(), size).AddName(whole.c_str());
    EXPECT_EQ(std::string(small.data()), whole.substr(0, size - 1)) << size;
    EXPECT_EQ(small[size], '#') << size;
  }
}

TEST(DiagnosticText, WritesWholeNumbers) {
  for (const uint64_t value : {uint64_t{0}, uint64_t{7}, uint64_t{10}, uint64_t{99}, uint64_t{65536}, UINT64_MAX}) {
    char out[32];
    Text(out, sizeof(out)).Add(value);
    EXPECT_EQ(out, std::to_string(value));
  }
}

TEST(DiagnosticText, WritesPathsFromTheRoot) {
  const Path stage = {nullptr, "mesh_stage"}, layer = {&stage, "layers", 0}, output = {&layer, "output"};
  const Path element = {&output, nullptr, 41};
  char out[64];
  Text(out, sizeof(out)).Add(element);
  EXPECT_STREQ(out, "mesh_stage.layers[0].output[41]");
}

// Six significant digits, powers of ten behind an e.
TEST(DiagnosticText, WritesNumbersWithSixDigits) {
  EXPECT_EQ(Number(0), "0.00000");
  EXPECT_EQ(Number(-0.0), "0.00000");
  EXPECT_EQ(Number(1), "1.00000");
  EXPECT_EQ(Number(-1), "-1.00000");
  EXPECT_EQ(Number(9.5), "9.50000");
  EXPECT_EQ(Number(10), "1.00000e1");
  EXPECT_EQ(Number(-1234.5), "-1.23450e3");
  EXPECT_EQ(Number(0.5), "5.00000e-1");
  EXPECT_EQ(Number(0.001), "1.00000e-3");
  EXPECT_EQ(Number(1.23456), "1.23456");
  EXPECT_EQ(Number(1.234567), "1.23457");
  EXPECT_EQ(Number(1.7e308), "1.70000e308");
  EXPECT_EQ(Number(std::numeric_limits<double>::infinity()), "infinity");
  EXPECT_EQ(Number(-std::numeric_limits<double>::infinity()), "-infinity");
  EXPECT_EQ(Number(NAN), "NaN");
}

// Six digits that round up to the next power of ten.
TEST(DiagnosticText, CarriesIntoThePower) {
  EXPECT_EQ(Number(static_cast<double>(-1e-9f)), "-1.00000e-9");
  EXPECT_EQ(Number(9.999999), "1.00000e1");
  EXPECT_EQ(Number(0.9999999), "1.00000");
  EXPECT_EQ(Number(999999.9), "1.00000e6");
  for (int power = -300; power <= 300; ++power) {
    const std::string text = std::to_string(power);
    EXPECT_EQ(Number(std::stod("1e" + text)), power == 0 ? "1.00000" : "1.00000e" + text);
    EXPECT_EQ(Number(std::stod("9.9999999e" + text)), power == -1 ? "1.00000" : "1.00000e" + std::to_string(power + 1));
  }
}

TEST(Diagnostic, TellsTheFirstFailureAlone) {
  dcloth_error error = {};
  error.struct_size = sizeof(error);
  Diagnostic diagnostic(&error);
  EXPECT_EQ(diagnostic.status(), DCLOTH_OK);
  const Path path = {nullptr, "tick_rate"};
  EXPECT_FALSE(diagnostic.Fail(DCLOTH_ERROR_SEMANTICS, 40, &path, "0 Hz", "more", "convert it again"));
  EXPECT_FALSE(diagnostic.FailCount(DCLOTH_ERROR_FORMAT, 80, nullptr, 3, " bytes", "64", ""));
  EXPECT_EQ(diagnostic.status(), DCLOTH_ERROR_SEMANTICS);
  EXPECT_EQ(error.status, DCLOTH_ERROR_SEMANTICS);
  EXPECT_EQ(error.offset_bytes, 40u);
  EXPECT_STREQ(error.text, "tick_rate: found 0 Hz; allowed: more; convert it again");
}

TEST(Diagnostic, NeedsNobodyToListen) {
  Diagnostic deaf(nullptr);
  EXPECT_FALSE(deaf.FailCount(DCLOTH_ERROR_FORMAT, 0, nullptr, 3, " bytes", "64", ""));
  EXPECT_EQ(deaf.status(), DCLOTH_ERROR_FORMAT);
  constexpr uint32_t kFirst = offsetof(dcloth_error, text) + sizeof(dcloth_error::text);
  dcloth_error older;
  std::memset(&older, 0x55, sizeof(older));
  const dcloth_error before = [&] {
    older.struct_size = kFirst - 1;
    return older;
  }();
  Diagnostic small(&older);
  EXPECT_FALSE(small.Fail(DCLOTH_ERROR_FORMAT, 0, nullptr, "a", "b", ""));
  EXPECT_EQ(std::memcmp(&older, &before, sizeof(older)), 0);
  // 0.1.0's error ended with its text.
  older.struct_size = kFirst;
  Diagnostic first(&older);
  EXPECT_FALSE(first.Fail(DCLOTH_ERROR_FORMAT, 0, nullptr, "a", "b", ""));
  EXPECT_STREQ(older.text, "found a; allowed: b");
  EXPECT_EQ(std::memcmp(&older.what_at, &before.what_at, sizeof(older) - kFirst), 0);
}

// The parts of a text lie where it says, cut off where it is.
TEST(Diagnostic, TellsThePartsOfItsText) {
  const Path parent = {nullptr, "mesh_stage"}, path = {&parent, "layers", 2};
  const std::string longest(300, 'x');
  for (const std::string& found : {std::string("3"), longest}) {
    dcloth_error error = {};
    error.struct_size = sizeof(error);
    Diagnostic diagnostic(&error);
    EXPECT_FALSE(diagnostic.Fail(DCLOTH_ERROR_SEMANTICS, 5, &path, found.c_str(), "1 or 2", "convert it again"));
    const auto part = [&](uint16_t at, uint16_t size) { return std::string(error.text).substr(at, size); };
    EXPECT_EQ(part(error.what_at, error.what_size), "mesh_stage.layers[2]");
    const bool whole = found != longest;
    EXPECT_EQ(part(error.found_at, error.found_size), whole ? found : found.substr(0, sizeof(error.text) - 1 - 28));
    EXPECT_EQ(part(error.allowed_at, error.allowed_size), whole ? "1 or 2" : "");
    EXPECT_EQ(part(error.mend_at, error.mend_size), whole ? "convert it again" : "");
    EXPECT_LE(error.mend_at + error.mend_size, sizeof(error.text) - 1);
  }
  dcloth_error error = {};
  error.struct_size = sizeof(error);
  Diagnostic diagnostic(&error);
  EXPECT_FALSE(diagnostic.Fail(DCLOTH_ERROR_ARGUMENT, 5, nullptr, "a", "b", ""));
  EXPECT_EQ(error.what_size, 0);
  EXPECT_EQ(error.mend_size, 0);
}

}  // namespace
}  // namespace dcloth::format

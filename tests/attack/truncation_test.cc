// Files that end too early: each prefix of each variant, alone and filled up with zeros as a download that
// stopped.
#include <gtest/gtest.h>

#include <algorithm>
#include <iostream>

#include "tests/attack/open_and_run.h"
#include "tests/attack/variants.h"

namespace dcloth::testing {
namespace {

// In a heap block of exactly the prefix's size, so that a sanitizer sees the first byte read past it.
TEST(Truncation, EveryPrefixOfEveryVariantIsRefused) {
  size_t refused = 0;
  for (const Variant& variant : Variants()) {
    const AlignedBytes whole = BuildModel(variant.spec).Bytes();
    const Outcome sound = OpenAndRun(whole.data(), whole.size());
    ASSERT_EQ(sound.status, DCLOTH_OK) << variant.name << ": " << sound.text;
    ASSERT_EQ(sound.broken_promise, "") << variant.name;
    for (size_t size = 0; size < whole.size(); ++size) {
      const AlignedBytes prefix(whole.data(), size);
      const Outcome outcome = OpenAndRun(prefix.data(), size);
      ASSERT_EQ(outcome.broken_promise, "") << variant.name << ", " << size << " bytes";
      ASSERT_NE(outcome.status, DCLOTH_OK) << variant.name << ", " << size << " bytes";
      ++refused;
    }
  }
  EXPECT_GT(refused, Variants().size() * 2000);
  std::cout << "prefixes refused: " << refused << " of " << Variants().size() << " variants\n";
}

// A size that is right, an end that never arrived. Lost weights are weights of zero and may pass; nothing
// else may.
TEST(Truncation, ZeroFilledPrefixesNeverHarm) {
  size_t refused = 0, tried = 0;
  for (const Variant& variant : Variants()) {
    const AlignedBytes whole = BuildModel(variant.spec).Bytes();
    AlignedBytes filled = whole;
    for (size_t size = whole.size(); size-- > 0;) {
      filled.data()[size] = 0;
      if (size % 8 != 0) continue;
      const Outcome outcome = OpenAndRun(filled.data(), filled.size());
      ASSERT_EQ(outcome.broken_promise, "") << variant.name << ", " << size << " bytes";
      refused += outcome.status != DCLOTH_OK;
      ++tried;
    }
  }
  EXPECT_GT(refused, tried / 2);
  std::cout << "zero-filled prefixes refused: " << refused << " of " << tried << "\n";
}

}  // namespace
}  // namespace dcloth::testing

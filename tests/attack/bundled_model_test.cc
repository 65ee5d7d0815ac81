// The bundled skirt, converted as a user would: damage sampled over its tables and weights, prefixes, the
// files it comes from cut short. Argument of the build: where the bundle lies.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <iostream>
#include <random>

#include "converter/convert.h"
#include "converter/error.h"
#include "tests/attack/open_and_run.h"

namespace dcloth::testing {
namespace {

constexpr size_t kLine = 64;

class BundledModelTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    converter::ConvertOptions options;
    options.precision = converter::Precision::kInt8;
    bytes_ = converter::Convert(converter::ReadBundle(DCLOTH_BUNDLE), options).bytes;
  }
  static void TearDownTestSuite() { bytes_ = {}; }

  // Changes one byte, opens and runs, mends it. Whether it opened.
  static bool RunsWith(size_t place, uint8_t value) {
    const std::byte good = bytes_[place];
    bytes_[place] = std::byte{value};
    const Outcome outcome = OpenAndRun(bytes_.data(), bytes_.size());
    bytes_[place] = good;
    EXPECT_EQ(outcome.broken_promise, "") << "byte " << place << ", now " << int{value};
    return outcome.status == DCLOTH_OK;
  }

  static converter::AlignedBytes bytes_;
};

converter::AlignedBytes BundledModelTest::bytes_;

TEST_F(BundledModelTest, IsSound) {
  const Outcome outcome = OpenAndRun(bytes_.data(), bytes_.size());
  EXPECT_EQ(outcome.status, DCLOTH_OK) << outcome.text;
  EXPECT_EQ(outcome.broken_promise, "");
  EXPECT_TRUE(outcome.finite);
}

// Tables lie at both ends of a file, weights between: both ends closely, the middle thinly.
TEST_F(BundledModelTest, DamagedBytesNeverHarm) {
  std::mt19937 random(3);
  size_t refused = 0, ran = 0;
  const auto try_at = [&](size_t place) {
    const auto good = std::to_integer<uint8_t>(bytes_[place]);
    const uint8_t values[] = {0x00, 0xFF, 0x80, static_cast<uint8_t>(good ^ (1u << random() % 8))};
    const uint8_t value = values[random() % 4];
    if (value != good) (RunsWith(place, value) ? ran : refused) += 1;
  };
  for (int i = 0; i < 150; ++i) {
    try_at(random() % 6000);
    try_at(bytes_.size() - 1 - random() % 1000);
    try_at(random() % bytes_.size());
  }
  EXPECT_GT(refused, 50u);
  EXPECT_GT(ran, 50u);
  std::cout << bytes_.size() << " bytes: " << refused << " changes refused, " << ran << " run\n";
}

TEST_F(BundledModelTest, PrefixesAreRefused) {
  std::mt19937 random(4);
  for (int i = 0; i < 60; ++i) {
    size_t size = i < 20 ? static_cast<size_t>(i) * kLine : random() % bytes_.size();
    if (i % 2 == 0) size -= size % kLine;
    converter::AlignedBytes prefix(bytes_.begin(), bytes_.begin() + static_cast<std::ptrdiff_t>(size));
    prefix.shrink_to_fit();
    const Outcome outcome = OpenAndRun(prefix.data(), size);
    EXPECT_EQ(outcome.broken_promise, "") << size;
    EXPECT_NE(outcome.status, DCLOTH_OK) << size;
  }
}

}  // namespace
}  // namespace dcloth::testing

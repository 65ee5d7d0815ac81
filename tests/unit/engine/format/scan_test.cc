// Passes over tensors against plain loops: every width, every offender, before, on and behind the borders of blocks.
#include "engine/format/scan.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include "tests/unit/kernels/guarded_buffer.h"

namespace dcloth::format {
namespace {

constexpr size_t kCounts[] = {1, 2, 255, 256, 257, 511, 512, 600};
constexpr float kLargest = std::numeric_limits<float>::max(), kSmallest = std::numeric_limits<float>::min();

// Of `count` elements: the first, the last, and both sides of each block's border.
std::vector<size_t> Places(size_t count) {
  std::vector<size_t> places;
  for (const size_t place : {size_t{0}, size_t{1}, size_t{255}, size_t{256}, size_t{511}, size_t{512}, count - 1}) {
    if (place < count) places.push_back(place);
  }
  return places;
}

TEST(ScanTest, FindsTheFirstNumberOutOfRange) {
  const float bad[] = {NAN, INFINITY, -INFINITY};
  const float not_positive[] = {NAN, INFINITY, 0.0f, -0.0f, -1.0f, kSmallest / 2};
  for (const size_t count : kCounts) {
    std::vector<float> values(count, kLargest);
    EXPECT_EQ(FindNotFinite(values.data(), count), count);
    EXPECT_EQ(FindNotPositive(values.data(), count), count);
    values.assign(count, kSmallest);
    EXPECT_EQ(FindNotPositive(values.data(), count), count);
    values.assign(count, -kLargest);
    EXPECT_EQ(FindNotFinite(values.data(), count), count);
    values.assign(count, 1.0f);
    for (const size_t place : Places(count)) {
      const auto found_at = [&](float value, auto find) {
        values[place] = values[count - 1] = value;  // of two the first
        const size_t found = find(values.data(), count);
        values[place] = values[count - 1] = 1.0f;
        return found;
      };
      for (const float value : bad) EXPECT_EQ(found_at(value, FindNotFinite), place) << value;
      for (const float value : not_positive) EXPECT_EQ(found_at(value, FindNotPositive), place) << value;
    }
  }
}

template <typename T>
void ExpectIndicesBelow(uint32_t limit) {
  for (const size_t count : kCounts) {
    std::vector<T> values(count, static_cast<T>(limit - 1));
    EXPECT_EQ(FindNotBelow(values.data(), count, limit), count) << limit;
    for (const size_t place : Places(count)) {
      values[place] = static_cast<T>(limit);
      EXPECT_EQ(FindNotBelow(values.data(), count, limit), place) << limit;
      values[place] = static_cast<T>(limit - 1);
    }
  }
}

TEST(ScanTest, FindsTheFirstIndexNotBelow) {
  for (const uint32_t limit : {1u, 2u, 128u, 255u}) ExpectIndicesBelow<uint8_t>(limit);
  for (const uint32_t limit : {1u, 255u, 256u, 257u, 65535u}) ExpectIndicesBelow<uint16_t>(limit);
  const std::vector<uint8_t> bytes(300, 255);
  const std::vector<uint16_t> words(300, 65535);
  for (const uint32_t limit : {0x10000u, 0x10001u, ~0u}) {  // above any value of the type
    EXPECT_EQ(FindNotBelow(bytes.data(), 300, limit), 300u);
    EXPECT_EQ(FindNotBelow(words.data(), 300, limit), 300u);
  }
  EXPECT_EQ(FindNotBelow(bytes.data(), 300, 256), 300u);
}

TEST(ScanTest, FindsTheFirstBadRowOfEveryWidth) {
  for (size_t width = 1; width <= 8; ++width) {
    for (const size_t rows : kCounts) {
      const float share = 1.0f / static_cast<float>(width);
      std::vector<float> weights(rows * width, share);
      EXPECT_EQ(FindBadWeightRow(weights.data(), rows, width), rows) << width;
      for (const size_t row : Places(rows)) {
        for (size_t k = 0; k < width; ++k) {
          float& weight = weights[row * width + k];
          for (const float bad : {NAN, INFINITY, -0.5f, share + 2e-4f, share - 2e-4f}) {
            weight = bad;
            EXPECT_EQ(FindBadWeightRow(weights.data(), rows, width), row) << width << " " << k << " " << bad;
          }
          for (const float good : {share + 5e-5f, share - 5e-5f}) {  // within the tolerance
            weight = good;
            EXPECT_EQ(FindBadWeightRow(weights.data(), rows, width), rows) << width << " " << k << " " << good;
          }
          weight = share;
        }
        if (width < 2) continue;
        weights[row * width] = -0.25f;  // sums to 1 all the same
        weights[row * width + 1] += share + 0.25f;
        EXPECT_EQ(FindBadWeightRow(weights.data(), rows, width), row) << width;
        weights[row * width] = weights[row * width + 1] = share;
      }
    }
  }
}

TEST(ScanTest, SumsAtTheToleranceAreWithinIt) {
  for (const float bound : {1.0f - kWeightSumTolerance, 1.0f + kWeightSumTolerance}) {
    const float beyond = std::nextafter(bound, bound < 1 ? 0.0f : 2.0f);
    EXPECT_EQ(FindBadWeightRow(&bound, 1, 1), 1u) << bound;
    EXPECT_EQ(FindBadWeightRow(&beyond, 1, 1), 0u) << beyond;
  }
}

TEST(ScanTest, FindsTheFirstStartThatDoesNotRise) {
  for (const size_t count : kCounts) {
    std::vector<uint32_t> starts(count + 1);
    std::iota(starts.begin(), starts.end(), 0u);
    EXPECT_EQ(FindNotRising(starts.data(), count), count);
    for (const size_t place : Places(count)) {
      const uint32_t next = starts[place + 1];
      starts[place + 1] = starts[place];
      EXPECT_EQ(FindNotRising(starts.data(), count), place);
      starts[place + 1] = next;
    }
  }
}

TEST(ScanTest, FindsWhatIsThereTwiceInAnyPieceOfTheRange) {
  for (const uint32_t count : {1u, 2u, 64u, 65u, 2047u, 2048u, 2049u, 6000u, 65535u, 65536u}) {
    std::vector<uint16_t> values(count);
    std::iota(values.begin(), values.end(), uint16_t{0});
    std::reverse(values.begin(), values.end());
    EXPECT_EQ(FindRepeated(values.data(), count, count), count);
    for (const size_t place : {size_t{2}, size_t{count} / 2, size_t{count} - 1}) {
      if (place < 2 || place >= count) continue;
      const uint16_t kept = values[place];
      values[place] = values[0];
      EXPECT_EQ(FindRepeated(values.data(), count, count), place) << count;
      values[place] = values[place - 1];  // right before it
      EXPECT_EQ(FindRepeated(values.data(), count, count), count);
      values[place] = kept;
    }
  }
}

// A tensor may be the last of its file, and the file end with a page.
TEST(ScanTest, ReadsNothingBehindTheLastElement) {
  for (const size_t count : kCounts) {
    const kernels::GuardedBuffer<float> ones(std::vector<float>(count, 1.0f));
    EXPECT_EQ(FindNotFinite(ones.data(), count), count);
    EXPECT_EQ(FindNotPositive(ones.data(), count), count);
    EXPECT_EQ(FindBadWeightRow(ones.data(), count, 1), count);
    const kernels::GuardedBuffer<uint16_t> words(std::vector<uint16_t>(count, 1));
    EXPECT_EQ(FindNotBelow(words.data(), count, 2), count);
    const kernels::GuardedBuffer<int8_t> bytes(std::vector<int8_t>(count, 1));
    EXPECT_EQ(FindBelow(bytes.data(), count, 0), count);
    std::vector<uint32_t> rising(count + 1);
    std::iota(rising.begin(), rising.end(), 0u);
    const kernels::GuardedBuffer<uint32_t> starts(rising);
    EXPECT_EQ(FindNotRising(starts.data(), count), count);
  }
}

}  // namespace
}  // namespace dcloth::format

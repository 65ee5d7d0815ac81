// Bytes that changed on the way: every one of the tables, and a sample of the weights.
#include <gtest/gtest.h>

#include <cstring>
#include <iostream>
#include <random>

#include "tests/attack/open_and_run.h"
#include "tests/attack/variants.h"

namespace dcloth::testing {
namespace {

// Offsets of the bytes that are tables and names, and of those that are weights.
struct Places {
  std::vector<size_t> tables, weights;
};

Places Split(const AlignedBytes& whole) {
  const auto* weights = format::GetModel(whole.data())->weights();
  const size_t begin = static_cast<size_t>(weights->data() - whole.data()), end = begin + weights->size();
  Places places;
  for (size_t i = 0; i < whole.size(); ++i) (i >= begin && i < end ? places.weights : places.tables).push_back(i);
  return places;
}

struct Tally {
  size_t refused = 0, accepted = 0;
};

class ByteDamageTest : public ::testing::TestWithParam<Variant> {
 protected:
  // Opens the file with `value` at `place`, then mends it.
  void Try(size_t place, uint8_t value, Tally* tally) {
    const uint8_t good = bytes_.data()[place];
    if (value == good) return;
    bytes_.data()[place] = value;
    Open(tally, place);
    bytes_.data()[place] = good;
  }
  void Open(Tally* tally, size_t place) {
    const Outcome outcome = OpenAndRun(bytes_.data(), bytes_.size());
    ASSERT_EQ(outcome.broken_promise, "") << "byte " << place << ", now " << int{bytes_.data()[place]};
    (outcome.status == DCLOTH_OK ? tally->accepted : tally->refused) += 1;
  }
  // The three values that break most, and each bit alone.
  void TryAll(size_t place, Tally* tally) {
    for (const uint8_t value : {0x00, 0xFF, 0x80}) Try(place, value, tally);
    for (int bit = 0; bit < 8; ++bit) Try(place, bytes_.data()[place] ^ static_cast<uint8_t>(1u << bit), tally);
  }

  AlignedBytes bytes_ = BuildModel(GetParam().spec).Bytes();  // of exactly the file's size
  Places places_ = Split(bytes_);
  std::mt19937 random_{17};
};

TEST_P(ByteDamageTest, EveryByteOfTheTables) {
  Tally tally;
  for (const size_t place : places_.tables) TryAll(place, &tally);
  // Names, padding and free numbers may change; offsets, lengths, types and shapes may not.
  EXPECT_GT(tally.refused, tally.accepted);
  std::cout << GetParam().name << ": " << places_.tables.size() << " bytes of tables, " << tally.refused
            << " changes refused, " << tally.accepted << " run\n";
}

TEST_P(ByteDamageTest, SampledWeights) {
  Tally tally;
  for (int i = 0; i < 2000; ++i) TryAll(places_.weights[random_() % places_.weights.size()], &tally);
  EXPECT_GT(tally.accepted, 0u);
  EXPECT_GT(tally.refused, 0u) << "no index, scale or float was hit";
}

// Several wild bytes at once, which single changes do not reach.
TEST_P(ByteDamageTest, WildBytes) {
  Tally tally;
  const AlignedBytes whole = bytes_;
  for (int i = 0; i < 5000; ++i) {
    size_t place = 0;
    for (uint32_t hits = 2 + random_() % 6; hits > 0; --hits) {
      place = places_.tables[random_() % places_.tables.size()];
      bytes_.data()[place] = static_cast<uint8_t>(random_());
    }
    Open(&tally, place);
    std::memcpy(bytes_.data(), whole.data(), whole.size());
  }
  EXPECT_GT(tally.refused, 2500u);
}

INSTANTIATE_TEST_SUITE_P(Every, ByteDamageTest, ::testing::ValuesIn(Variants()),
                         [](const auto& test) { return test.param.name; });

}  // namespace
}  // namespace dcloth::testing

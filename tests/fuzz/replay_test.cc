// The fuzzers' corpora without a fuzzer: every seed, every input that once broke something, and a fixed
// number of mutations of the seeds, with any compiler.
#include <gtest/gtest.h>

#include <algorithm>
#include <iostream>
#include <random>

#include "tests/fuzz/targets.h"

namespace dcloth::testing {
namespace {

using Bytes = std::vector<uint8_t>;

Verdict Feed(const FuzzTarget& target, const Bytes& bytes) {
  const Bytes exact(bytes);  // no capacity behind the end
  return target.run(exact.data(), exact.size());
}

// libFuzzer's basic moves: change, insert, erase, copy, number at the edge, cut, another file's part.
void Mutate(const Bytes& other, std::mt19937* random, Bytes* bytes) {
  const auto below = [&](size_t limit) { return limit == 0 ? 0 : static_cast<size_t>((*random)()) % limit; };
  for (size_t moves = 1 + below(4); moves > 0 && !bytes->empty(); --moves) {
    const size_t at = below(bytes->size());
    const auto place = bytes->begin() + static_cast<std::ptrdiff_t>(at);
    const size_t length = std::min<size_t>(1 + below(32), bytes->size() - at);
    switch (below(7)) {
      case 0:
        (*bytes)[at] ^= static_cast<uint8_t>(1u << below(8));
        break;
      case 1:
        bytes->insert(place, length, static_cast<uint8_t>((*random)()));
        break;
      case 2:
        bytes->erase(place, place + static_cast<std::ptrdiff_t>(length));
        break;
      case 3:
        std::copy_n(place, length, bytes->begin() + static_cast<std::ptrdiff_t>(below(bytes->size() - length + 1)));
        break;
      case 4: {
        constexpr uint8_t kEdges[] = {0x00, 0xFF, 0x7F, 0x80, 0x01, '9', '"', '}'};
        std::fill_n(place, std::min<size_t>(length, 4), kEdges[below(8)]);
        break;
      }
      case 5:
        if (below(8) == 0) bytes->resize(at);
        break;
      default: {
        const size_t from = below(other.size());
        const size_t count = std::min({length, other.size() - from});
        std::copy_n(other.begin() + static_cast<std::ptrdiff_t>(from), count, place);
        break;
      }
    }
  }
}

class ReplayTest : public ::testing::TestWithParam<FuzzTarget> {};

TEST_P(ReplayTest, SeedsKeepEveryPromise) {
  size_t sound = 0;
  for (const Seed& seed : Seeds(GetParam().name)) {
    const Verdict verdict = Feed(GetParam(), seed.bytes);
    EXPECT_EQ(verdict.broken_promise, "") << seed.name;
    EXPECT_EQ(verdict.accepted, seed.sound) << seed.name;
    sound += verdict.accepted;
  }
  EXPECT_GT(sound, 2u);
}

TEST_P(ReplayTest, FindingsStayMended) {
  const std::vector<KeptInput> findings = Findings(GetParam().name);
  for (const KeptInput& input : findings) EXPECT_EQ(Feed(GetParam(), input.bytes).broken_promise, "") << input.name;
  std::cout << GetParam().name << ": " << findings.size() << " findings\n";
}

TEST_P(ReplayTest, PackedInputsKeepEveryPromise) {
  const std::vector<KeptInput> inputs = PackedInputs(GetParam().name);
  size_t accepted = 0;
  for (const KeptInput& input : inputs) {
    const Verdict verdict = Feed(GetParam(), input.bytes);
    EXPECT_EQ(verdict.broken_promise, "") << input.name;
    accepted += verdict.accepted;
  }
  EXPECT_GT(inputs.size(), 50u);
  EXPECT_GT(accepted, 0u);
  std::cout << GetParam().name << ": " << accepted << " of " << inputs.size() << " packed inputs accepted\n";
}

TEST_P(ReplayTest, MutatedSeedsKeepEveryPromise) {
  const std::vector<Seed> seeds = Seeds(GetParam().name);
  std::mt19937 random(41);
  size_t accepted = 0;
  for (int i = 0; i < 3000; ++i) {
    Bytes bytes = seeds[random() % seeds.size()].bytes;
    Mutate(seeds[random() % seeds.size()].bytes, &random, &bytes);
    const Verdict verdict = Feed(GetParam(), bytes);
    ASSERT_EQ(verdict.broken_promise, "") << "mutation " << i;
    accepted += verdict.accepted;
  }
  EXPECT_GT(accepted, 10u);
  EXPECT_LT(accepted, 2700u);
  std::cout << GetParam().name << ": " << accepted << " of 3000 mutations accepted\n";
}

INSTANTIATE_TEST_SUITE_P(Every, ReplayTest, ::testing::ValuesIn(kFuzzTargets),
                         [](const auto& test) { return std::string(test.param.name); });

}  // namespace
}  // namespace dcloth::testing

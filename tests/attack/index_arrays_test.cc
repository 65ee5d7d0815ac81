// Indices that lead elsewhere: entries of every index array of a file are repeated, left out, swapped and put past the
// end, and what opens is played. The arrays are those of the schema, so that none can be forgotten: a field of vertices
// or joints that no test model has fails the first test.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <functional>
#include <iostream>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "tests/attack/open_and_run.h"
#include "tests/attack/tensor_walk.h"
#include "tests/attack/variants.h"

namespace dcloth::testing {
namespace {

// Those of every kind, and one with enough cloth and skin for each step of a frame.
std::vector<Variant> Models() {
  std::vector<Variant> models = Variants();
  ModelSpec spec;
  spec.precision = format::DType_I8;
  spec.parents = spec.body = spec.touch = spec.coarse = spec.texture = true;
  models.push_back({"I8_large_touch", spec});
  spec.touch = false;
  models.push_back({"I8_large_body", spec});
  spec.patches = 4;
  models.push_back({"I8_large_patches", spec});
  return models;
}

TEST(IndexArraysTest, AModelHasEachOfThem) {
  std::set<std::string> allowed, present;
  for (const Variant& variant : Models()) {
    AlignedBytes file = BuildModel(variant.spec).Bytes();
    const FieldWalk walk(&file);
    allowed.insert(walk.allowed().begin(), walk.allowed().end());
    present.insert(walk.present().begin(), walk.present().end());
  }
  EXPECT_GE(allowed.size(), 70u);
  for (const char* path :
       {"displacement.basis.bias", "displacement.head.bias", "patch_stage.hidden_gates.bias",
        "patch_stage.enter.row_scales", "patch_stage.mix.row_scales", "patch_stage.input_gates.row_scales",
        "patch_stage.hidden_gates.row_scales", "patch_stage.out.row_scales", "patch_stage.map.row_scales"})
    EXPECT_EQ(allowed.erase(path), 1u) << path << ", which no file may have";
  for (const std::string& path : allowed) EXPECT_EQ(present.count(path), 1u) << path << ": no model of Models() has it";
}

class IndexArraysOfTest : public ::testing::TestWithParam<Variant> {};

TEST_P(IndexArraysOfTest, ChangedTheyAreRefusedOrHarmless) {
  AlignedBytes file = BuildModel(GetParam().spec).Bytes();
  FieldWalk walk(&file);
  ASSERT_GE(walk.arrays().size(), 4u);
  std::mt19937 random(11);
  size_t opened = 0, refused = 0;
  for (IndexArray& array : walk.arrays()) {
    const size_t count = array.count, last = count - 1;
    const std::vector<uint8_t> sound(array.data, array.data + count * array.width_bytes);
    const auto attempt = [&](const std::string& how, const std::function<void()>& change) {
      SCOPED_TRACE(array.path + ": " + how);
      change();
      const Outcome outcome = OpenAndRun(file.data(), file.size());
      EXPECT_EQ(outcome.broken_promise, "");
      ++(outcome.status == DCLOTH_OK ? opened : refused);
      std::memcpy(array.data, sound.data(), sound.size());
    };
    uint32_t largest = 0;
    for (size_t i = 0; i < count; ++i) largest = std::max(largest, array.at(i));
    const auto swap = [&](size_t i, size_t j) {
      const uint32_t kept = array.at(i);
      array.Put(i, array.at(j));
      array.Put(j, kept);
    };
    const auto fill = [&](uint32_t value) {
      for (size_t i = 0; i < count; ++i) array.Put(i, value);
    };
    for (const size_t i : {size_t{0}, count / 3, random() % count, random() % count, last}) {
      const std::string at = " at " + std::to_string(i);
      attempt("repeats the next" + at, [&] { array.Put(i, array.at(i == last ? 0 : i + 1)); });
      attempt("repeats any" + at, [&] { array.Put(i, array.at(random() % count)); });
      attempt("swapped" + at, [&] { swap(i, random() % count); });
      attempt("left out" + at, [&] { array.Put(i, 0); });
      attempt("one past" + at, [&] { array.Put(i, largest + 1); });
      attempt("all bits" + at, [&] { array.Put(i, ~0u); });
    }
    for (const uint32_t value : {array.at(0), array.at(last), largest, 0u, ~0u})
      attempt("all " + std::to_string(value), [&] { fill(value); });
    attempt("reversed", [&] {
      for (size_t i = 0; i < count / 2; ++i) swap(i, last - i);
    });
    for (int trial = 0; trial < 4; ++trial) {
      attempt("shuffled", [&] {
        for (size_t i = 0; i < count; ++i) swap(i, random() % count);
      });
      attempt("any of its own", [&] {
        for (size_t i = 0; i < count; ++i) array.Put(i, array.at(random() % count));
      });
      attempt("half of it twice", [&] {
        for (size_t i = 0; i + 1 < count; i += 2) array.Put(i, array.at(i + 1));
      });
    }
  }
  std::cout << walk.arrays().size() << " arrays, " << refused << " changes refused, " << opened << " played\n";
  EXPECT_GT(refused, 20 * walk.arrays().size() / 4);
  EXPECT_GT(opened, 20u);
}

INSTANTIATE_TEST_SUITE_P(Every, IndexArraysOfTest, ::testing::ValuesIn(Models()),
                         [](const auto& test) { return test.param.name; });

}  // namespace
}  // namespace dcloth::testing

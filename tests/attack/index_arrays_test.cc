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
#include "tests/attack/variants.h"

namespace dcloth::testing {
namespace {

namespace fb = flatbuffers;

// Integers in a file, as they lie there.
struct IndexArray {
  std::string path;
  uint8_t* data;
  size_t count;
  size_t width_bytes;

  uint32_t at(size_t i) const {
    uint32_t value = 0;
    std::memcpy(&value, data + i * width_bytes, width_bytes);
    return value;
  }
  void Put(size_t i, uint32_t value) { std::memcpy(data + i * width_bytes, &value, width_bytes); }
};

// All tensors and all vectors of integers that the schema allows, and those that a file has.
class FieldWalk {
 public:
  explicit FieldWalk(AlignedBytes* file)
      : weights_(const_cast<uint8_t*>(format::GetModel(file->data())->weights()->Data())) {
    Visit(*format::ModelTypeTable(), fb::GetRoot<fb::Table>(file->data()), "");
  }

  const std::set<std::string>& allowed() const { return allowed_; }
  const std::set<std::string>& present() const { return present_; }
  std::vector<IndexArray>& arrays() { return arrays_; }

 private:
  // `table` is null where the file has none.
  void Visit(const fb::TypeTable& type, const fb::Table* table, const std::string& parent) {
    for (size_t i = 0; i < type.num_elems; ++i) {
      const fb::TypeCode code = type.type_codes[i];
      const auto field = fb::FieldIndexToOffset(static_cast<fb::voffset_t>(i));
      const std::string path = parent + type.names[i];
      const bool there = table != nullptr && table->CheckField(field);
      if (code.base_type == fb::ET_SEQUENCE && code.sequence_ref >= 0) {
        const fb::TypeTable& child = *type.type_refs[code.sequence_ref]();
        if (&child == format::TensorTypeTable()) {
          Note(path, there);
          if (there) AddTensor(path, *table->GetPointer<const format::Tensor*>(field));
        } else if (code.is_repeating == 0) {
          Visit(child, there ? table->GetPointer<const fb::Table*>(field) : nullptr, path + ".");
        } else {
          Visit(child, nullptr, path + ".");
          const auto* tables = there ? table->GetPointer<const fb::Vector<fb::Offset<fb::Table>>*>(field) : nullptr;
          for (uint32_t k = 0; tables != nullptr && k < tables->size(); ++k) Visit(child, tables->Get(k), path + ".");
        }
      } else if (code.is_repeating != 0 && code.base_type != fb::ET_STRING && path != "weights") {
        Note(path, there);
        ASSERT_EQ(code.base_type, fb::ET_USHORT) << path << ": say here how wide its integers are";
        if (!there) continue;
        auto* vector = const_cast<fb::Vector<uint16_t>*>(table->GetPointer<const fb::Vector<uint16_t>*>(field));
        arrays_.push_back({path, vector->Data(), vector->size(), 2});
      }
    }
  }
  void Note(const std::string& path, bool there) {
    allowed_.insert(path);
    if (there) present_.insert(path);
  }
  void AddTensor(const std::string& path, const format::Tensor& tensor) {
    const format::DType dtype = tensor.dtype();
    if (dtype != format::DType_U8 && dtype != format::DType_U16 && dtype != format::DType_U32) return;
    size_t count = 1;
    for (const uint32_t side : *tensor.shape()) count *= side;
    arrays_.push_back({path, weights_ + tensor.offset(), count,
                       size_t{dtype == format::DType_U8    ? 1u
                              : dtype == format::DType_U16 ? 2u
                                                           : 4u}});
  }

  uint8_t* weights_;
  std::set<std::string> allowed_, present_;
  std::vector<IndexArray> arrays_;
};

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

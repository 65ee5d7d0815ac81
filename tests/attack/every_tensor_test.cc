// The same faults in every tensor of every kind of model: wherever one check is forgotten, a file could reach past its
// bytes or bring in a number that no stage expects.
#include <gtest/gtest.h>

#include <cstring>
#include <functional>
#include <iostream>
#include <regex>
#include <string>

#include "tests/attack/open_and_run.h"
#include "tests/attack/tensor_walk.h"
#include "tests/attack/variants.h"

namespace dcloth::testing {
namespace {

using M = format::ModelT;

struct Verdict {
  dcloth_error error = {};

  bool Says(const char* text) const { return std::string(error.text).find(text) != std::string::npos; }
  // Whether the text begins with the field, whichever element of a list it is of.
  bool Names(const std::string& field) const {
    return std::regex_replace(error.text, std::regex(R"(\[\d+\])"), "").find(field) == 0;
  }
};

Verdict Open(const TestModel& model) {
  const AlignedBytes bytes = model.Bytes();
  const Outcome outcome = OpenAndRun(bytes.data(), bytes.size());
  EXPECT_EQ(outcome.broken_promise, "");
  AlignedBytes storage(dcloth_model_storage_size());
  dcloth_model* opened = nullptr;
  Verdict verdict;
  verdict.error.struct_size = sizeof(verdict.error);
  EXPECT_EQ(dcloth_model_open(bytes.data(), bytes.size(), storage.data(), storage.size(), &opened, &verdict.error),
            outcome.status);
  return verdict;
}

// One tensor of a model of its own.
struct Subject {
  M* model = nullptr;
  format::TensorT* tensor = nullptr;
  std::string name;                    // "garment.faces"
  bool linear_weights = false;         // any numbers will do
  size_t bytes = 0;                    // as stored, a multiple of 64
  format::TensorT* weights = nullptr;  // those of a linear layer, another tensor

  // A copy behind all other tensors.
  void MoveToTheEnd() {
    const size_t end = model->weights.size();
    model->weights.resize(end + bytes);
    std::memcpy(model->weights.data() + end, model->weights.data() + tensor->offset, bytes);
    tensor->offset = end;
  }
};

class EveryTensorTest : public ::testing::TestWithParam<Variant> {
 protected:
  void ForEach(const std::function<void(const TestModel&, Subject)>& spoil) {
    const TestModel sound = BuildModel(GetParam().spec);
    const size_t count = TensorWalk(sound.tables.get()).tensors().size();
    AlignedBytes file = sound.Bytes();
    const FieldWalk fields(&file);
    ASSERT_GE(count, 14u);
    for (size_t i = 0; i < count; ++i) {
      const TestModel model = BuildModel(GetParam().spec);
      M* m = model.tables.get();
      const TensorWalk walk(m);
      Subject subject;
      subject.model = m;
      subject.tensor = walk.tensors()[i];
      subject.name = fields.names().at(subject.tensor->offset);
      SCOPED_TRACE(subject.name);
      subject.bytes = (StoredElements(*subject.tensor) * ElementBytes(subject.tensor->dtype) + 63) / 64 * 64;
      subject.weights = walk.linears()[0]->weights.get();
      for (const format::LinearT* linear : walk.linears()) {
        if (linear->weights.get() != subject.tensor) continue;
        subject.linear_weights = true;
        subject.bytes = walk.StoredBytes(*linear, m->weights.size());
        if (linear == walk.linears()[0]) subject.weights = walk.linears()[1]->weights.get();
      }
      spoil(model, subject);
    }
  }
};

// Where it ends exactly with the weights it is read; where its last line lies behind them it is not.
TEST_P(EveryTensorTest, EndsWithTheWeightsAtTheLatest) {
  ForEach([](const TestModel& model, Subject subject) {
    subject.MoveToTheEnd();
    const Verdict whole = Open(model);
    EXPECT_EQ(whole.error.status, DCLOTH_OK) << whole.error.text;
    subject.model->weights.resize(subject.model->weights.size() - 64);
    const Verdict cut = Open(model);
    EXPECT_EQ(cut.error.status, DCLOTH_ERROR_SEMANTICS) << cut.error.text;
    EXPECT_TRUE(cut.Names(subject.name + ".offset: ") && cut.Says("a range within the")) << cut.error.text;
  });
}

// Its last line is its own, and so is the first line of another.
TEST_P(EveryTensorTest, SharesNoLineWithAnother) {
  ForEach([](const TestModel& model, Subject subject) {
    subject.MoveToTheEnd();
    subject.model->weights.resize(subject.model->weights.size() + (size_t{1} << 16));
    subject.weights->offset = subject.tensor->offset + subject.bytes;
    const Verdict beside = Open(model);
    EXPECT_EQ(beside.error.status, DCLOTH_OK) << beside.error.text;
    subject.weights->offset -= 64;
    const Verdict over = Open(model);
    EXPECT_EQ(over.error.status, DCLOTH_ERROR_SEMANTICS);
    EXPECT_TRUE(over.Says("found a range that overlaps")) << over.error.text;
  });
}

TEST_P(EveryTensorTest, HasItsTypeAlone) {
  ForEach([](const TestModel& model, Subject subject) {
    format::TensorT* tensor = subject.tensor;
    const format::DType right = tensor->dtype;
    for (int dtype = 0; dtype < 256; ++dtype) {
      if (dtype == right || (subject.linear_weights && dtype <= format::DType_I8)) continue;
      tensor->dtype = static_cast<format::DType>(dtype);
      const Verdict verdict = Open(model);
      EXPECT_EQ(verdict.error.status, DCLOTH_ERROR_SEMANTICS) << dtype;
      EXPECT_TRUE(verdict.Names(subject.name + ".dtype: found")) << verdict.error.text;
      if (dtype > format::DType_U32) dtype += 31;
    }
  });
}

// Sizes that decide others' may change, but then these no longer fit. On the number of faces nothing depends, and on
// the mesh stage's coefficients a basis that is padded to even rows.
TEST_P(EveryTensorTest, HasItsShapeAlone) {
  ForEach([](const TestModel& model, Subject subject) {
    format::TensorT* tensor = subject.tensor;
    const auto& garment = *subject.model->garment;
    if (tensor == garment.faces.get() || tensor == garment.coarse_faces.get()) return;
    if (subject.model->mesh_stage && tensor == subject.model->mesh_stage->coefficients->weights.get()) return;
    const std::vector<uint32_t> right = tensor->shape;
    std::vector<std::vector<uint32_t>> wrong = {{}, {static_cast<uint32_t>(StoredElements(*tensor)), 1, 1}};
    for (size_t side = 0; side < right.size(); ++side) {
      for (const uint32_t size : {0u, right[side] - 1, right[side] + 1, right[side] * 3, 1u << 31, ~0u}) {
        wrong.push_back(right);
        wrong.back()[side] = size;
      }
    }
    for (const std::vector<uint32_t>& shape : wrong) {
      tensor->shape = shape;
      const Verdict verdict = Open(model);
      EXPECT_EQ(verdict.error.status, DCLOTH_ERROR_SEMANTICS) << shape.size() << " " << (shape.empty() ? 0 : shape[0]);
    }
  });
}

// The first element and the last are looked at, and the error points at them. Not linear layers' weights: any bits will
// do.
TEST_P(EveryTensorTest, HoldsNoWildElement) {
  ForEach([](const TestModel& model, Subject subject) {
    format::TensorT* tensor = subject.tensor;
    if (subject.linear_weights) return;
    const size_t width = ElementBytes(tensor->dtype), count = StoredElements(*tensor);
    const std::vector<uint8_t> sound = subject.model->weights;
    for (const size_t element : {size_t{0}, count - 1}) {
      uint8_t* place = subject.model->weights.data() + tensor->offset + element * width;
      // NaN, the largest index, or the one integer that no converter writes.
      std::memset(place, tensor->dtype == format::DType_I8 ? 0x80 : 0xFF, width);
      const Verdict verdict = Open(model);
      EXPECT_EQ(verdict.error.status, DCLOTH_ERROR_SEMANTICS) << element;
      const AlignedBytes file = model.Bytes();
      const format::Model* root = format::GetModel(file.data());
      const uint64_t at =
          static_cast<uint64_t>(root->weights()->Data() - file.data()) + tensor->offset + element * width;
      EXPECT_EQ(verdict.error.offset_bytes, at) << verdict.error.text;
      EXPECT_TRUE(verdict.Names(subject.name + ": found ")) << verdict.error.text;
      subject.model->weights = sound;
    }
  });
}

INSTANTIATE_TEST_SUITE_P(Models, EveryTensorTest, ::testing::ValuesIn(Variants()),
                         [](const auto& test) { return test.param.name; });

}  // namespace
}  // namespace dcloth::testing

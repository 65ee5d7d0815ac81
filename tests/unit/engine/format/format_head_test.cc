// Faults of a reduced basis: the head between the stages' coefficients and the basis' rows.
#include <functional>
#include <string>

#include "tests/unit/engine/cloth_fixture.h"

namespace dcloth::testing {
namespace {

struct Fault {
  const char* name;
  dcloth_status status;
  const char* field;  // must occur in the error text
  std::function<void(format::ModelT*)> spoil;
  uint32_t rank;  // of the sound model's reduced basis
};

void PrintTo(const Fault& fault, std::ostream* out) { *out << fault.name; }

constexpr dcloth_status kSemantics = DCLOTH_ERROR_SEMANTICS;

// BuildModel's default in int8 with a basis reduced to 14 rows.
std::vector<Fault> HeadFaults() {
  using M = format::ModelT;
  constexpr uint32_t kRank = 14;
  const auto widen = [](format::LinearT* linear, uint32_t columns) { linear->weights->shape[1] = columns; };
  return {
      // What a reader that knows no heads sees, as one of format 1.0.
      {"head_dropped", kSemantics, "displacement.skeleton_rows", [](M* m) { m->displacement->head.reset(); }, kRank},
      {"head_alone", kSemantics, "displacement.head",
       [](M* m) {
         m->skeleton_stage.reset();
         m->mesh_stage.reset();
       },
       kRank},
      {"head_rows", kSemantics, "displacement.head.weights.shape",
       [](M* m) { m->displacement->head->weights->shape[0] = 20; }, kRank},
      {"head_columns_odd", kSemantics, "displacement.head.weights",
       [=](M* m) { widen(m->displacement->head.get(), 13); }, kRank},
      {"head_columns_none", kSemantics, "displacement.head.weights.shape[1]",
       [=](M* m) { widen(m->displacement->head.get(), 0); }, kRank},
      // Nothing else needs a basis then.
      {"head_columns_none_and_no_basis", kSemantics, "displacement.head.weights.shape[1]",
       [=](M* m) {
         widen(m->displacement->head.get(), 0);
         m->mesh_stage.reset();
         m->displacement->basis.reset();
         m->displacement->skeleton_rows = 0;
       },
       kRank},
      {"head_columns_wide", kSemantics, "displacement.head.weights.shape[1]",
       [=](M* m) { widen(m->displacement->head.get(), 1u << 31); }, kRank},
      {"head_columns_not_the_meshs", kSemantics, "displacement.head.weights",
       [=](M* m) { widen(m->displacement->head.get(), 16); }, kRank},
      {"mesh_columns_not_the_heads", kSemantics, "displacement.head.weights",
       [=](M* m) { widen(m->mesh_stage->coefficients.get(), 16); }, kRank},
      {"head_bias", kSemantics, "displacement.head.bias",
       [](M* m) {
         m->displacement->head->bias = std::make_unique<format::TensorT>(*m->mesh_stage->coefficients->bias);
       },
       kRank},
      {"head_dtype", kSemantics, "displacement.head.weights.dtype",
       [](M* m) { m->displacement->head->weights->dtype = format::DType_U16; }, kRank},
      {"head_scales", kSemantics, "displacement.head.row_scales",
       [](M* m) { m->displacement->head->row_scales.reset(); }, kRank},
      {"head_offset", kSemantics, "displacement.basis.weights.offset",
       [](M* m) { m->displacement->basis->weights->offset = m->displacement->head->weights->offset; }, kRank},
      {"skeleton_rows_with_head", kSemantics, "displacement.skeleton_rows",
       [](M* m) { m->displacement->skeleton_rows = 20; }, kRank},
      {"mesh_rows_with_head", kSemantics, "displacement.mesh_rows", [](M* m) { m->displacement->mesh_rows = 14; },
       kRank},
      {"basis_rows_with_head", kSemantics, "displacement.basis.weights.shape",
       [](M* m) { m->displacement->basis->weights->shape[0] = 12; }, kRank},
      {"no_basis_with_head", kSemantics, "displacement.basis", [](M* m) { m->displacement->basis.reset(); }, kRank},
  };
}

class HeadFaultTest : public ::testing::TestWithParam<Fault> {};

TEST_P(HeadFaultTest, IsRefusedByName) {
  ModelSpec spec;
  spec.precision = format::DType_I8;
  spec.rank = GetParam().rank;
  TestModel model = BuildModel(spec);
  ASSERT_EQ(OpenedModel(model).status(), DCLOTH_OK);
  GetParam().spoil(model.tables.get());
  const OpenedModel opened(model);
  EXPECT_EQ(opened.status(), GetParam().status) << opened.error().text;
  EXPECT_EQ(opened.error().status, opened.status());
  EXPECT_NE(std::string(opened.error().text).find(GetParam().field), std::string::npos) << opened.error().text;
  EXPECT_NE(std::string(opened.error().text).find("allowed"), std::string::npos) << opened.error().text;
  EXPECT_LT(opened.error().offset_bytes, opened.bytes().size());
  EXPECT_EQ(opened.get(), nullptr) << "outputs stay untouched";

  // The same verdict when nobody listens.
  AlignedBytes storage(dcloth_model_storage_size());
  dcloth_model* untouched = nullptr;
  EXPECT_EQ(dcloth_model_open(opened.bytes().data(), opened.bytes().size(), storage.data(), storage.size(), &untouched,
                              nullptr),
            GetParam().status);
  dcloth_error small = EmptyError();
  small.struct_size = 8;
  EXPECT_EQ(dcloth_model_open(opened.bytes().data(), opened.bytes().size(), storage.data(), storage.size(), &untouched,
                              &small),
            GetParam().status);
  EXPECT_EQ(small.status, DCLOTH_OK) << "a smaller error struct is not written to";
}

INSTANTIATE_TEST_SUITE_P(NamedReduced, HeadFaultTest, ::testing::ValuesIn(HeadFaults()),
                         [](const auto& test) { return test.param.name; });

TEST(HeadFormat, OneLayerSpeaksTheHeadsCoefficientsToo) {
  ModelSpec spec;
  spec.rank = 14;
  spec.layers = 1;
  TestModel model = BuildModel(spec);
  ASSERT_EQ(OpenedModel(model).status(), DCLOTH_OK);
  model.tables->mesh_stage->coefficients->weights->shape[1] = 16;
  const OpenedModel opened(model);
  EXPECT_EQ(opened.status(), kSemantics);
  EXPECT_EQ(std::string(opened.error().text).find("displacement.head.weights: found 14 columns"), 0u)
      << opened.error().text;
}

}  // namespace
}  // namespace dcloth::testing

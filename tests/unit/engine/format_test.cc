// The verification ladder: sound models pass, and each named fault is refused with a text that names the field.
#include <cmath>
#include <functional>
#include <limits>

#include "tests/unit/engine/cloth_fixture.h"

namespace dcloth::testing {
namespace {

// The first stored element of a tensor, as T.
template <typename T>
T* Data(format::ModelT* model, const format::TensorT& tensor, size_t element = 0) {
  return reinterpret_cast<T*>(model->weights.data() + tensor.offset) + element;
}

struct Fault {
  const char* name;
  dcloth_status status;
  const char* field;  // must occur in the error text
  std::function<void(format::ModelT*)> spoil;
  uint32_t rank = 0;  // of the sound model's reduced basis
};

void PrintTo(const Fault& fault, std::ostream* out) { *out << fault.name; }

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr dcloth_status kSemantics = DCLOTH_ERROR_SEMANTICS;

// The model is BuildModel's default in int8: three stages, three layers.
std::vector<Fault> Faults() {
  using M = format::ModelT;
  return {
      {"version", DCLOTH_ERROR_VERSION, "format_major", [](M* m) { m->format_major = 2; }},
      {"no_garment", DCLOTH_ERROR_FORMAT, "garment", [](M* m) { m->garment.reset(); }},
      {"no_influence_bones", DCLOTH_ERROR_FORMAT, "static_stage",
       [](M* m) { m->static_stage->influence_bones.reset(); }},
      {"tick_rate_zero", kSemantics, "tick_rate", [](M* m) { m->tick_rate = 0; }},
      {"tick_rate_nan", kSemantics, "tick_rate", [](M* m) { m->tick_rate = kNaN; }},
      {"tick_rate_huge", kSemantics, "tick_rate", [](M* m) { m->tick_rate = 1001; }},
      {"vertices_zero", kSemantics, "garment.vertices", [](M* m) { m->garment->vertices = 0; }},
      {"vertices_many", kSemantics, "garment.vertices", [](M* m) { m->garment->vertices = 65536; }},
      {"empty_name", kSemantics, "garment.name", [](M* m) { m->garment->name = ""; }},
      {"zero_in_name", kSemantics, "garment.name", [](M* m) { m->garment->name = std::string("a\0b", 3); }},
      {"positions_shape", kSemantics, "garment.template_positions.shape",
       [](M* m) {
         m->garment->template_positions->shape = {60, 4};
       }},
      {"positions_rank", kSemantics, "garment.template_positions.shape",
       [](M* m) { m->garment->template_positions->shape = {180}; }},
      {"positions_nan", kSemantics, "garment.template_positions[7]",
       [](M* m) { *Data<float>(m, *m->garment->template_positions, 7) = kNaN; }},
      {"positions_dtype", kSemantics, "garment.template_positions.dtype",
       [](M* m) { m->garment->template_positions->dtype = format::DType_F16; }},
      {"face_index", kSemantics, "garment.faces[5]", [](M* m) { *Data<uint16_t>(m, *m->garment->faces, 5) = 60; }},
      {"no_faces", kSemantics, "garment.faces.shape",
       [](M* m) {
         m->garment->faces->shape = {0, 3};
       }},
      {"faces_rank", kSemantics, "garment.faces.shape", [](M* m) { m->garment->faces->shape = {}; }},
      {"hips", kSemantics, "character.hips", [](M* m) { m->character->hips = 9; }},
      {"no_joints", kSemantics, "character.joint_names", [](M* m) { m->character->joint_names.clear(); }},
      {"joint_twice", kSemantics, "character.joint_names[4]", [](M* m) { m->character->joint_names[4] = "joint_1"; }},
      {"joint_long", kSemantics, "character.joint_names[2]",
       [](M* m) { m->character->joint_names[2].assign(256, 'x'); }},
      {"inverse_bind_infinite", kSemantics, "character.inverse_bind[0]",
       [](M* m) { *Data<float>(m, *m->character->inverse_bind) = kInfinity; }},
      {"feature_joint", kSemantics, "features.joints[1]", [](M* m) { m->features->joints[1] = 9; }},
      {"feature_bounds", kSemantics, "features.low[3]", [](M* m) { *Data<float>(m, *m->features->low, 3) = 10; }},
      {"feature_mean_short", kSemantics, "features.mean.shape", [](M* m) { m->features->mean->shape = {48}; }},
      {"root_motion_off", kSemantics, "features.mean.shape", [](M* m) { m->features->root_motion = false; }},
      {"bone", kSemantics, "static_stage.bones[0]", [](M* m) { m->static_stage->bones[0] = 65535; }},
      {"no_bones", kSemantics, "static_stage.bones", [](M* m) { m->static_stage->bones.clear(); }},
      {"influences_zero", kSemantics, "static_stage.influences", [](M* m) { m->static_stage->influences = 0; }},
      {"influences_nine", kSemantics, "static_stage.influences", [](M* m) { m->static_stage->influences = 9; }},
      {"influence_bone", kSemantics, "static_stage.influence_bones[11]",
       [](M* m) { *Data<uint8_t>(m, *m->static_stage->influence_bones, 11) = 5; }},
      {"influence_negative", kSemantics, "static_stage.influence_weights[0]",
       [](M* m) { *Data<float>(m, *m->static_stage->influence_weights) = -0.1f; }},
      {"influence_sum", kSemantics, "static_stage.influence_weights[2]",
       [](M* m) { *Data<float>(m, *m->static_stage->influence_weights, 9) += 0.01f; }},
      {"hidden_rows", kSemantics, "static_stage.hidden.weights.shape",
       [](M* m) { m->static_stage->hidden->weights->shape[0] += 1; }},
      {"hidden_wide", kSemantics, "static_stage.hidden.weights.shape[1]",
       [](M* m) { m->static_stage->hidden->weights->shape[1] = 1u << 31; }},
      {"increments_columns", kSemantics, "static_stage.increments.weights.shape",
       [](M* m) { m->static_stage->increments->weights->shape[1] = 14; }},
      {"weights_dtype", kSemantics, "static_stage.hidden.weights.dtype",
       [](M* m) { m->static_stage->hidden->weights->dtype = format::DType_U32; }},
      {"unknown_dtype", kSemantics, "static_stage.hidden.weights.dtype",
       [](M* m) { m->static_stage->hidden->weights->dtype = static_cast<format::DType>(200); }},
      {"bias_nan", kSemantics, "static_stage.hidden.bias[2]",
       [](M* m) { *Data<float>(m, *m->static_stage->hidden->bias, 2) = kNaN; }},
      {"bias_short", kSemantics, "static_stage.hidden.bias.shape",
       [](M* m) { m->static_stage->hidden->bias->shape = {21}; }},
      {"no_row_scales", kSemantics, "skeleton_stage.input.row_scales",
       [](M* m) { m->skeleton_stage->input->row_scales.reset(); }},
      {"row_scale_zero", kSemantics, "skeleton_stage.input.row_scales[1]",
       [](M* m) { *Data<float>(m, *m->skeleton_stage->input->row_scales, 1) = 0; }},
      {"column_scale_negative", kSemantics, "skeleton_stage.hidden.column_scales[0]",
       [](M* m) { *Data<float>(m, *m->skeleton_stage->hidden->column_scales) = -1; }},
      {"gru_columns", kSemantics, "skeleton_stage.hidden.weights.shape",
       [](M* m) { m->skeleton_stage->hidden->weights->shape[1] = 56; }},
      {"gru_empty", kSemantics, "skeleton_stage.hidden.weights.shape[0]",
       [](M* m) { m->skeleton_stage->hidden->weights->shape[0] = 0; }},
      {"mesh_alone", kSemantics, "mesh_stage", [](M* m) { m->skeleton_stage.reset(); }},
      {"body_joint", kSemantics, "mesh_stage.body_joints[0]",
       [](M* m) { *Data<uint8_t>(m, *m->mesh_stage->body_joints) = 9; }},
      {"body_weight_nan", kSemantics, "mesh_stage.body_weights[4]",
       [](M* m) { *Data<float>(m, *m->mesh_stage->body_weights, 4) = kNaN; }},
      {"row_starts_first", kSemantics, "mesh_stage.row_starts[0]",
       [](M* m) { *Data<uint32_t>(m, *m->mesh_stage->row_starts) = 1; }},
      {"row_starts_fall", kSemantics, "mesh_stage.row_starts[9]",
       [](M* m) { *Data<uint32_t>(m, *m->mesh_stage->row_starts, 9) = 2; }},
      {"row_starts_end", kSemantics, "mesh_stage.row_starts[60]",
       [](M* m) { *Data<uint32_t>(m, *m->mesh_stage->row_starts, 60) = 0xFFFFFFFF; }},
      {"row_starts_one_more", kSemantics, "mesh_stage.columns.shape",
       [](M* m) { *Data<uint32_t>(m, *m->mesh_stage->row_starts, 60) += 1; }},
      {"column_index", kSemantics, "mesh_stage.columns[3]",
       [](M* m) { *Data<uint16_t>(m, *m->mesh_stage->columns, 3) = 60; }},
      {"feature_width_odd", kSemantics, "mesh_stage.feature_width", [](M* m) { m->mesh_stage->feature_width = 12; }},
      {"feature_width_wide", kSemantics, "mesh_stage.feature_width", [](M* m) { m->mesh_stage->feature_width = 72; }},
      {"no_layers", kSemantics, "mesh_stage.layers", [](M* m) { m->mesh_stage->layers.clear(); }},
      {"layer_shape", kSemantics, "mesh_stage.layers[1].output.shape",
       [](M* m) {
         m->mesh_stage->layers[1]->output->shape = {16, 15};
       }},
      {"layer_nan", kSemantics, "mesh_stage.layers[2].hidden_gates[1]",
       [](M* m) { *Data<float>(m, *m->mesh_stage->layers[2]->hidden_gates, 1) = kNaN; }},
      {"slope_infinite", kSemantics, "mesh_stage.layers[0].prelu_slope",
       [](M* m) { m->mesh_stage->layers[0]->prelu_slope = kInfinity; }},
      {"embed_bias_nan", kSemantics, "mesh_stage.embed_bias", [](M* m) { m->mesh_stage->embed_bias = kNaN; }},
      {"vertex_mlp_rows", kSemantics, "mesh_stage.hidden.weights.shape",
       [](M* m) { m->mesh_stage->hidden->weights->shape[0] = 61; }},
      {"skeleton_rows", kSemantics, "displacement.skeleton_rows", [](M* m) { m->displacement->skeleton_rows = 22; }},
      {"mesh_rows", kSemantics, "displacement.mesh_rows", [](M* m) { m->displacement->mesh_rows = 13; }},
      {"no_displacement", kSemantics, "displacement.skeleton_rows", [](M* m) { m->displacement.reset(); }},
      {"no_basis", kSemantics, "displacement.basis", [](M* m) { m->displacement->basis.reset(); }},
      {"basis_columns", kSemantics, "displacement.basis.weights.shape",
       [](M* m) { m->displacement->basis->weights->shape[1] = 181; }},
      {"offset_odd", kSemantics, "features.mean.offset", [](M* m) { m->features->mean->offset += 4; }},
      {"offset_far", kSemantics, "features.mean.offset", [](M* m) { m->features->mean->offset = ~uint64_t{63}; }},
      {"offset_overlap", kSemantics, "features.high.offset",
       [](M* m) { m->features->high->offset = m->features->low->offset; }},
      {"weights_cut", kSemantics, "displacement.basis", [](M* m) { m->weights.resize(m->weights.size() - 64); }},
  };
}

// The same with a basis reduced to 14 rows.
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
      {"head_columns_wide", kSemantics, "displacement.head.weights.shape[1]",
       [=](M* m) { widen(m->displacement->head.get(), 1u << 31); }, kRank},
      {"head_columns_not_the_meshs", kSemantics, "displacement.head.weights",
       [=](M* m) { widen(m->displacement->head.get(), 16); }, kRank},
      {"mesh_columns_not_the_heads", kSemantics, "displacement.head.weights",
       [=](M* m) { widen(m->mesh_stage->coefficients.get(), 16); }, kRank},
      {"head_bias", kSemantics, "displacement.head.bias",
       [](M* m) { m->displacement->head->bias = std::make_unique<format::TensorT>(*m->mesh_stage->coefficients->bias); },
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

class FaultTest : public ::testing::TestWithParam<Fault> {};

TEST_P(FaultTest, IsRefusedByName) {
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

INSTANTIATE_TEST_SUITE_P(Named, FaultTest, ::testing::ValuesIn(Faults()),
                         [](const auto& test) { return test.param.name; });
INSTANTIATE_TEST_SUITE_P(NamedReduced, FaultTest, ::testing::ValuesIn(HeadFaults()),
                         [](const auto& test) { return test.param.name; });

TEST(Open, DescribesTheModel) {
  const TestModel model = BuildModel({});
  const OpenedModel opened(model);
  ASSERT_EQ(opened.status(), DCLOTH_OK) << opened.error().text;
  const dcloth_model_info info = opened.info();
  EXPECT_EQ(info.joint_count, 9u);
  EXPECT_EQ(info.vertex_count, 60u);
  EXPECT_EQ(info.triangle_count, 100u);
  EXPECT_EQ(info.stages, static_cast<uint32_t>(DCLOTH_STAGES_MESH));
  EXPECT_EQ(info.tick_seconds, 1.0f / 30.0f);
  EXPECT_EQ(info.format_major, 1u);
  EXPECT_STREQ(info.name, "tube");
  EXPECT_STREQ(info.precision, "test");
  EXPECT_EQ(std::vector<uint16_t>(info.triangles, info.triangles + 300), model.numbers.faces);
  EXPECT_STREQ(dcloth_model_joint_name(opened.get(), 8), "joint_8");
  EXPECT_EQ(dcloth_model_joint_name(opened.get(), 9), nullptr);
  EXPECT_EQ(dcloth_model_joint_name(nullptr, 0), nullptr);
}

TEST(Open, RefusesBadArguments) {
  const AlignedBytes bytes = BuildModel({}).Bytes();
  AlignedBytes storage(dcloth_model_storage_size() + 64);
  dcloth_model* model = nullptr;
  const auto open = [&](const void* data, size_t size, void* place, size_t place_size) {
    return dcloth_model_open(data, size, place, place_size, &model, nullptr);
  };
  const size_t needed = dcloth_model_storage_size();
  EXPECT_EQ(open(nullptr, bytes.size(), storage.data(), needed), DCLOTH_ERROR_ARGUMENT);
  EXPECT_EQ(open(bytes.data(), bytes.size(), nullptr, needed), DCLOTH_ERROR_ARGUMENT);
  EXPECT_EQ(dcloth_model_open(bytes.data(), bytes.size(), storage.data(), needed, nullptr, nullptr),
            DCLOTH_ERROR_ARGUMENT);
  EXPECT_EQ(open(bytes.data(), bytes.size(), storage.data(), needed - 1), DCLOTH_ERROR_MEMORY);
  EXPECT_EQ(open(bytes.data(), bytes.size(), storage.data() + 32, needed), DCLOTH_ERROR_ALIGNMENT);
  EXPECT_EQ(open(bytes.data(), 0, storage.data(), needed), DCLOTH_ERROR_FORMAT);
  AlignedBytes shifted(bytes.size() + 64);
  std::memcpy(shifted.data() + 4, bytes.data(), bytes.size());
  EXPECT_EQ(open(shifted.data() + 4, bytes.size(), storage.data(), needed), DCLOTH_ERROR_ALIGNMENT);
  AlignedBytes other = bytes;
  other.data()[4] = 'X';
  EXPECT_EQ(open(other.data(), other.size(), storage.data(), needed), DCLOTH_ERROR_FORMAT);
  EXPECT_EQ(model, nullptr);
  EXPECT_EQ(open(bytes.data(), bytes.size(), storage.data(), needed), DCLOTH_OK);
}

}  // namespace
}  // namespace dcloth::testing

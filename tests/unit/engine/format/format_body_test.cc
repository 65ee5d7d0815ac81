// Named faults of the body table, field by field, and files without one.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <limits>
#include <random>
#include <string>

#include "tests/unit/engine/cloth_fixture.h"
#include "tests/unit/engine/test_body.h"

namespace dcloth::testing {
namespace {

using B = format::BodyT;

struct Fault {
  const char* name;
  const char* field;   // begins the error text
  const char* reason;  // occurs in it
  std::function<void(format::ModelT*, B*)> spoil;
  dcloth_status status = DCLOTH_ERROR_SEMANTICS;
};

void PrintTo(const Fault& fault, std::ostream* out) { *out << fault.name; }

template <typename T>
T* Data(format::ModelT* model, const format::TensorT& tensor, size_t element = 0) {
  return reinterpret_cast<T*>(model->weights.data() + tensor.offset) + element;
}

// Of a sound body with 14 x 20 + 2 vertices and 560 faces on 9 joints.
std::vector<Fault> Faults() {
  using M = format::ModelT;
  constexpr float kNaN = std::numeric_limits<float>::quiet_NaN(), kInfinity = std::numeric_limits<float>::infinity();
  return {
      {"influences_zero", "body.influences: ", "found 0; allowed: 1 to 8", [](M*, B* b) { b->influences = 0; }},
      {"influences_nine", "body.influences: ", "found 9; allowed: 1 to 8", [](M*, B* b) { b->influences = 9; }},
      {"influences_other_than_stored", "body.joints.shape: ", "found [282, 2]; allowed: [282, 3]",
       [](M*, B* b) { b->influences = 3; }},
      {"clearance_zero", "body.clearance: ", "allowed: 0.0001 to 0.1 m", [](M*, B* b) { b->clearance = 0; }},
      {"clearance_negative", "body.clearance: ", "found -2.00000e-3 m", [](M*, B* b) { b->clearance = -0.002f; }},
      {"clearance_nan", "body.clearance: ", "found NaN", [](M*, B* b) { b->clearance = kNaN; }},
      {"clearance_wide", "body.clearance: ", "found 2.00000e-1 m", [](M*, B* b) { b->clearance = 0.2f; }},
      {"reach_below_clearance", "body.reach: ", "found 1.00000e-3 m", [](M*, B* b) { b->reach = 0.001f; }},
      {"reach_infinite", "body.reach: ", "found infinity", [](M*, B* b) { b->reach = kInfinity; }},
      {"reach_nan", "body.reach: ", "found NaN", [](M*, B* b) { b->reach = kNaN; }},
      {"positions_few", "body.positions.shape[0]: ", "found 2; allowed: 3 to 8192",
       [](M*, B* b) { b->positions->shape[0] = 2; }},
      {"positions_many", "body.positions.shape[0]: ", "found 4294967295; allowed: 3 to 8192",
       [](M*, B* b) { b->positions->shape[0] = ~0u; }},
      {"positions_flat", "body.positions.shape: ", "allowed: [282, 3]", [](M*, B* b) { b->positions->shape = {282}; }},
      {"position_infinite", "body.positions[845]: ", "found infinity",
       [](M* m, B* b) { *Data<float>(m, *b->positions, 845) = kInfinity; }},
      {"joint_one_past", "body.joints[563]: ", "found 9; allowed: indices below 9",
       [](M* m, B* b) { *Data<uint8_t>(m, *b->joints, 563) = 9; }},
      {"joints_dtype", "body.joints.dtype: ", "found u16; allowed: u8",
       [](M*, B* b) { b->joints->dtype = format::DType_U16; }},
      {"weight_nan", "body.weights[1]: ", "found NaN", [](M* m, B* b) { *Data<float>(m, *b->weights, 1) = kNaN; }},
      {"weights_sum", "body.weights[4]: ", "found a row with a negative weight",
       [](M* m, B* b) { *Data<float>(m, *b->weights, 8) += 0.01f; }},
      {"weight_nan_behind_a_sum", "body.weights[20]: ", "found NaN",  // numbers first, then rows
       [](M* m, B* b) {
         *Data<float>(m, *b->weights, 8) += 0.01f;
         *Data<float>(m, *b->weights, 20) = kNaN;
       }},
      {"weight_infinite", "body.weights[5]: ", "found infinity",
       [](M* m, B* b) { *Data<float>(m, *b->weights, 5) = kInfinity; }},
      {"faces_none", "body.faces.shape[0]: ", "found 0; allowed: 1 to 16384", [](M*, B* b) { b->faces->shape[0] = 0; }},
      {"faces_many", "body.faces.shape[0]: ", "found 16385; allowed: 1 to 16384",
       [](M*, B* b) { b->faces->shape[0] = 16385; }},
      {"face_index_one_past", "body.faces[1679]: ", "found 282; allowed: indices below 282",
       [](M* m, B* b) { *Data<uint16_t>(m, *b->faces, 1679) = 282; }},
      {"face_index_all_bits", "body.faces[0]: ", "found 65535",
       [](M* m, B* b) { *Data<uint16_t>(m, *b->faces) = 65535; }},
      {"faces_past_the_weights", "body.faces.offset: ", "a range within the ",
       [](M* m, B* b) { b->faces->offset = m->weights.size(); }},
      {"faces_over_positions", "body.faces.offset: ", "found a range that overlaps",
       [](M*, B* b) { b->faces->offset = b->positions->offset; }},
      {"rows_begin_late", "body.row_starts[0]: ", "found a first row that does not start at 0; allowed: 0",
       [](M* m, B* b) { *Data<uint32_t>(m, *b->row_starts) = 1; }},
      {"row_empty", "body.row_starts[10]: ", "found a row start that is not above the one before it",
       [](M* m, B* b) { Data<uint32_t>(m, *b->row_starts)[10] = Data<uint32_t>(m, *b->row_starts)[9]; }},
      {"row_start_huge", "body.row_starts[31]: ", "found a row start that is not above the one before it",
       [](M* m, B* b) { *Data<uint32_t>(m, *b->row_starts, 30) = 0x80000000u; }},
      {"row_long", "body.row_starts[10]: ", "found more than 32 faces around a vertex; allowed: 1 to 32",
       [](M* m, B* b) {
         for (size_t i = 10; i < 283; ++i) *Data<uint32_t>(m, *b->row_starts, i) += 40;
       }},
      {"row_long_first", "body.row_starts[1]: ", "found more than 32 faces around a vertex",
       [](M* m, B* b) {
         for (size_t i = 1; i < 283; ++i) *Data<uint32_t>(m, *b->row_starts, i) += 40;
       }},
      {"row_long_last", "body.row_starts[282]: ", "found more than 32 faces around a vertex",
       [](M* m, B* b) { *Data<uint32_t>(m, *b->row_starts, 282) += 40; }},
      {"row_end_one_less", "body.row_starts[282]: ", "found 1679; allowed: 1680",
       [](M* m, B* b) { *Data<uint32_t>(m, *b->row_starts, 282) -= 1; }},
      {"rows_one_less", "body.row_starts.shape: ", "found [282]; allowed: [283]",
       [](M*, B* b) { b->row_starts->shape = {282}; }},
      {"column_one_past", "body.columns[3]: ", "found 560; allowed: indices below 560",
       [](M* m, B* b) { *Data<uint16_t>(m, *b->columns, 3) = 560; }},
      {"column_of_another_vertex",
       "body.columns[0]: ", "found a face that is not around its vertex, or twice; allowed: ",
       [](M* m, B* b) { *Data<uint16_t>(m, *b->columns) = 559; }},
      {"column_twice", "body.columns[1679]: ", "found a face that is not around its vertex, or twice",
       [](M* m, B* b) { Data<uint16_t>(m, *b->columns)[1679] = Data<uint16_t>(m, *b->columns)[1678]; }},
      {"columns_short", "body.columns.shape: ", "found [1679]; allowed: [1680]",
       [](M*, B* b) { b->columns->shape = {1679}; }},
      {"positions_missing", "body: ", "a missing required field", [](M*, B* b) { b->positions.reset(); },
       DCLOTH_ERROR_FORMAT},
      {"joints_missing", "body: ", "a missing required field", [](M*, B* b) { b->joints.reset(); },
       DCLOTH_ERROR_FORMAT},
      {"weights_missing", "body: ", "a missing required field", [](M*, B* b) { b->weights.reset(); },
       DCLOTH_ERROR_FORMAT},
      {"faces_missing", "body: ", "a missing required field", [](M*, B* b) { b->faces.reset(); }, DCLOTH_ERROR_FORMAT},
      {"row_starts_missing", "body: ", "a missing required field", [](M*, B* b) { b->row_starts.reset(); },
       DCLOTH_ERROR_FORMAT},
      {"columns_missing", "body: ", "a missing required field", [](M*, B* b) { b->columns.reset(); },
       DCLOTH_ERROR_FORMAT},
  };
}

ModelSpec SmallSpec() {
  ModelSpec spec;
  spec.rings = 3;
  spec.segments = 4;
  spec.skeleton = spec.mesh = false;
  return spec;
}

class BodyFaultTest : public ::testing::TestWithParam<Fault> {};

TEST_P(BodyFaultTest, IsRefusedByName) {
  const Fault& fault = GetParam();
  ModelSpec spec;
  spec.precision = format::DType_I8;
  TestModel model = BuildModel(spec);
  AddBody(&model);
  ASSERT_EQ(OpenedModel(model).status(), DCLOTH_OK);
  fault.spoil(model.tables.get(), model.tables->body.get());
  const OpenedModel opened(model);
  const std::string text = opened.error().text;
  EXPECT_EQ(opened.status(), fault.status) << text;
  EXPECT_EQ(text.find(fault.field), 0u) << text;
  EXPECT_NE(text.find(fault.reason), std::string::npos) << text;
  EXPECT_NE(text.find("allowed"), std::string::npos) << text;
  EXPECT_LT(opened.error().offset_bytes, opened.bytes().size());
  EXPECT_EQ(opened.get(), nullptr) << "outputs stay untouched";
  unsigned row = 0;
  if (std::sscanf(text.c_str(), "body.row_starts[%u]", &row) == 1) {
    const format::Model& file = *format::GetModel(opened.bytes().data());
    const auto* starts = file.weights()->Data() + model.tables->body->row_starts->offset;
    EXPECT_EQ(opened.error().offset_bytes, static_cast<uint64_t>(starts - opened.bytes().data()) + 4 * row) << text;
  }

  // The same verdict when nobody listens.
  AlignedBytes storage(dcloth_model_storage_size());
  dcloth_model* untouched = nullptr;
  EXPECT_EQ(dcloth_model_open(opened.bytes().data(), opened.bytes().size(), storage.data(), storage.size(), &untouched,
                              nullptr),
            fault.status);
}

INSTANTIATE_TEST_SUITE_P(NamedBody, BodyFaultTest, ::testing::ValuesIn(Faults()),
                         [](const auto& test) { return test.param.name; });

TEST(BodyFormat, LimitsThemselvesAreAllowed) {
  TestModel model = BuildModel({});
  AddBody(&model);
  B* body = model.tables->body.get();
  const auto opens = [&](float clearance, float reach) {
    body->clearance = clearance;
    body->reach = reach;
    return OpenedModel(model).status() == DCLOTH_OK;
  };
  EXPECT_TRUE(opens(0.0001f, 10.0f));
  EXPECT_TRUE(opens(0.0001f, 0.0001f));
  EXPECT_TRUE(opens(0.1f, 0.1f));
  EXPECT_FALSE(opens(std::nextafter(0.0001f, 0.0f), 1.0f));
  EXPECT_FALSE(opens(std::nextafter(0.1f, 1.0f), 1.0f));
  EXPECT_FALSE(opens(0.1f, std::nextafter(0.1f, 0.0f)));
  EXPECT_FALSE(opens(0.1f, std::nextafter(10.0f, 11.0f)));
}

TEST(BodyFormat, ARingHasAtMostThirtyTwoFaces) {
  for (const uint32_t around_a_pole : {32u, 33u}) {
    TestModel model = BuildModel({});
    AddBody(&model, 3, around_a_pole);
    const OpenedModel opened(model);
    EXPECT_EQ(opened.status(), around_a_pole == 32 ? DCLOTH_OK : DCLOTH_ERROR_SEMANTICS) << opened.error().text;
  }
}

// Any classes of any vertices against what the format asks, face by face: a vertex has those alone that all three
// corners of one of its faces have.
TEST(BodyFormat, AClassTouchesWholeFaces) {
  std::mt19937 random(7);
  size_t opened_count = 0;
  for (int trial = 0; trial < 3000; ++trial) {
    TestModel model = BuildModel(SmallSpec());
    const EggBody egg = AddBody(&model, 3, 5);
    const size_t b = egg.positions.size() / 3, f = egg.faces.size() / 3;
    // One class of a few whole faces, and in two of three trials one corner more or fewer.
    std::vector<uint8_t> touched(b, 0);
    for (size_t k = 0, count = 1 + random() % 6; k < count; ++k) {
      const size_t face = random() % f;
      for (size_t corner = 0; corner < 3; ++corner) touched[egg.faces[3 * face + corner]] = 2;
    }
    if (trial % 3 != 0) touched[random() % b] ^= 2;
    std::vector<uint8_t> whole(b, 0);
    for (size_t face = 0; face < f; ++face) {
      const uint16_t* corner = egg.faces.data() + 3 * face;
      const uint8_t all = touched[corner[0]] & touched[corner[1]] & touched[corner[2]];
      for (size_t k = 0; k < 3; ++k) whole[corner[k]] |= all;
    }
    size_t bare = 0;
    while (bare < b && touched[bare] == whole[bare]) ++bare;

    AddTouch(&model, std::vector<uint8_t>(model.numbers.n, 0), touched);
    const OpenedModel opened(model);
    ASSERT_EQ(opened.status(), bare == b ? DCLOTH_OK : DCLOTH_ERROR_SEMANTICS) << opened.error().text;
    opened_count += bare == b ? 1 : 0;
    if (bare == b) continue;
    ASSERT_EQ(std::string(opened.error().text).find("body.touched_by[" + std::to_string(bare) + "]: "), 0u)
        << opened.error().text;
  }
  EXPECT_GT(opened_count, 1000u);
  EXPECT_LT(opened_count, 2500u);
}

TEST(BodyFormat, OlderFilesOpen) {
  TestModel model = BuildModel({});
  for (const uint16_t minor : {0, 1, 2}) {
    model.tables->format_minor = minor;
    const OpenedModel opened(model);
    EXPECT_EQ(opened.status(), DCLOTH_OK) << opened.error().text;
    EXPECT_EQ(opened.info().format_minor, minor);
    EXPECT_EQ(dcloth_model_body_vertex_count(opened.get()), 0u);
  }
}

}  // namespace
}  // namespace dcloth::testing

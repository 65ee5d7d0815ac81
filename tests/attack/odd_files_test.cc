// Files that are strange and good: at the edges of every limit, laid out like no converter does, by later
// writers, with weights that are no numbers. A verifier that refused them would be as wrong as one that lets
// a fault pass.
#include <algorithm>
#include <optional>

#include "tests/attack/corruption.h"
#include "tests/attack/open_and_run.h"
#include "tests/attack/tensor_walk.h"
#include "tests/unit/engine/cloth_fixture.h"

namespace dcloth::testing {
namespace {

using M = format::ModelT;

struct OddFile {
  const char* name;
  std::function<void(ModelSpec*)> spec = [](ModelSpec*) {};
  std::function<void(M*)> tables = [](M*) {};
  std::optional<bool> finite = true;  // of the frame drawn; empty where large numbers may overflow
};

void PrintTo(const OddFile& file, std::ostream* out) { *out << file.name; }

// Moves every tensor: last ones first, lines of 0xFF between them.
void LayOutBackwards(M* m) {
  const TensorWalk walk(m);
  std::vector<format::TensorT*> order = walk.tensors();
  const auto by_offset = [](const auto* a, const auto* b) { return a->offset < b->offset; };
  std::sort(order.begin(), order.end(), by_offset);
  std::vector<uint8_t> moved(64, 0xFF);
  size_t end = m->weights.size();
  for (size_t i = order.size(); i-- > 0;) {
    const std::vector<uint8_t> stored(m->weights.begin() + static_cast<std::ptrdiff_t>(order[i]->offset),
                                      m->weights.begin() + static_cast<std::ptrdiff_t>(end));
    end = order[i]->offset;
    order[i]->offset = moved.size();
    moved.insert(moved.end(), stored.begin(), stored.end());
    moved.resize(moved.size() + 64, 0xFF);
  }
  m->weights = moved;
}

void FillLinearWeights(M* m, uint8_t byte) {
  const TensorWalk walk(m);
  for (const format::LinearT* linear : walk.linears()) {
    std::memset(m->weights.data() + linear->weights->offset, byte, walk.StoredBytes(*linear, m->weights.size()));
  }
}

// What follows a tensor in its last line of 64 bytes.
void FillPadding(M* m) {
  const TensorWalk walk(m);
  for (const format::TensorT* tensor : walk.tensors()) {
    const bool any_bits = std::any_of(walk.linears().begin(), walk.linears().end(),
                                      [&](const auto* linear) { return linear->weights.get() == tensor; });
    const size_t bytes = StoredElements(*tensor) * ElementBytes(tensor->dtype);
    if (!any_bits) std::memset(m->weights.data() + tensor->offset + bytes, 0xFF, (64 - bytes % 64) % 64);
  }
}

// Vertex 0 sees every vertex, vertex 1 itself a hundred times, all others only vertex 2.
void TangleTheGraph(M* m) {
  std::vector<uint32_t> starts = {0};
  std::vector<uint16_t> columns;
  for (uint32_t i = 0; i < m->garment->vertices; ++i) {
    for (uint16_t j = 0; j < m->garment->vertices && i == 0; ++j) columns.push_back(j);
    if (i == 1) columns.insert(columns.end(), 100, 1);
    if (i > 1) columns.push_back(2);
    starts.push_back(static_cast<uint32_t>(columns.size()));
  }
  std::memcpy(Data<uint32_t>(m, *m->mesh_stage->row_starts), starts.data(), 4 * starts.size());
  m->mesh_stage->columns->offset = m->weights.size();
  m->mesh_stage->columns->shape = {static_cast<uint32_t>(columns.size())};
  const auto* bytes = reinterpret_cast<const uint8_t*>(columns.data());
  m->weights.insert(m->weights.end(), bytes, bytes + 2 * columns.size());
}

template <typename T>
void Fill(M* m, const format::TensorT& tensor, size_t count, T value) {
  std::fill_n(Data<T>(m, tensor), count, value);
}

std::vector<OddFile> OddFiles() {
  const auto none = [](ModelSpec*) {};
  return {
      {"later_minor_version", none, [](M* m) { m->format_minor = 65535; }},
      {"nobody_wrote_it", none,
       [](M* m) {
         m->producer.clear();
         m->precision.clear();
       }},
      {"texts_that_are_no_text", none,
       [](M* m) {
         m->producer.assign(10000, '\xFF');
         m->precision = std::string("\0\x01\xC0", 3);
         m->garment->name = "\xFF\xFE%s%n\x1B[2J";
         m->character->joint_names[3].assign(255, '\x80');
       }},
      {"laid_out_backwards", none, LayOutBackwards},
      {"weights_that_no_tensor_owns", none, [](M* m) { m->weights.resize(m->weights.size() + 4096, 0xAA); }},
      {"padding_full_of_ones", [](ModelSpec* s) { s->body = s->touch = true; }, FillPadding},
      {"padding_of_crossed_bounds", none,
       [](M* m) {
         const format::TensorT &low = *m->features->low, &high = *m->features->high;
         for (size_t i = StoredElements(low); i % 16 != 0; ++i) {
           *Data<float>(m, low, i) = 1;
           *Data<float>(m, high, i) = 0;
         }
       }},
      {"names_of_one_letter", none,
       [](M* m) {
         for (size_t j = 0; j < m->character->joint_names.size(); ++j)
           m->character->joint_names[j] = static_cast<char>('a' + j);
       }},
      {"weights_all_zero", none, [](M* m) { FillLinearWeights(m, 0); }},
      {"weights_all_least_int8", none, [](M* m) { FillLinearWeights(m, 0x80); }},
      {"weights_all_nan", [](ModelSpec* s) { s->precision = format::DType_F32; },
       [](M* m) { FillLinearWeights(m, 0xFF); }, false},
      // Not finite with AVX2 and above; SSE4 has no instruction that converts halves, and NaN becomes a large number.
      {"weights_all_half_nan", [](ModelSpec* s) { s->precision = format::DType_F16; },
       [](M* m) { FillLinearWeights(m, 0xFF); }, std::nullopt},
      {"scales_that_overflow", none,
       [](M* m) {
         const TensorWalk walk(m);
         for (const format::LinearT* linear : walk.linears())
           Fill(m, *linear->row_scales, linear->row_scales->shape[0], 3e38f);
       },
       std::nullopt},
      {"scales_least_normal", none,
       [](M* m) {
         const TensorWalk walk(m);
         for (const format::LinearT* linear : walk.linears())
           Fill(m, *linear->column_scales, linear->column_scales->shape[0], 1.17549435e-38f);
       }},
      {"faces_all_one_corner", none,
       [](M* m) { Fill<uint16_t>(m, *m->garment->faces, 3 * m->garment->faces->shape[0], 59); }},
      {"one_face", none, [](M* m) { m->garment->faces->shape[0] = 1; }},
      {"tangled_graph", none, TangleTheGraph},
      {"clamps_of_no_width", none,
       [](M* m) {
         Fill(m, *m->features->low, 49, 0.5f);
         Fill(m, *m->features->high, 49, 0.5f);
       }},
      {"deviation_zero_and_negative", none,
       [](M* m) {
         Fill(m, *m->features->inverse_deviation, 20, 0.0f);
         Fill(m, *m->features->mean, 49, -3e38f);
       }},
      {"singular_bind", none, [](M* m) { Fill(m, *m->character->inverse_bind, 108, 0.0f); }},
      {"every_joint_of_hips", none,
       [](M* m) { std::fill(m->features->joints.begin(), m->features->joints.end(), m->character->hips); }},
      {"fastest_tick", none, [](M* m) { m->tick_rate = 1000; }},
      {"slowest_tick", none, [](M* m) { m->tick_rate = 0.001f; }},
      {"slopes_negative", none,
       [](M* m) {
         for (const auto& layer : m->mesh_stage->layers) layer->prelu_slope = -5;
       }},
      {"three_vertices",
       [](ModelSpec* s) {
         s->rings = 3;
         s->segments = 1;
       }},
      {"most_vertices",
       [](ModelSpec* s) {
         s->rings = 255;
         s->segments = 257;
         s->units = s->mesh_basis = s->mesh_width = 1;
         s->layers = 1;
         s->feature_width = 8;
         s->influences = s->body_influences = 1;
       }},
      {"most_joints_and_bones",
       [](ModelSpec* s) {
         s->joints = 256;
         s->bones = 256;
       }},
      {"one_joint",
       [](ModelSpec* s) {
         s->joints = 1;
         s->bones = 1;
       }},
      {"most_influences", [](ModelSpec* s) { s->influences = s->body_influences = 8; }},
      {"one_influence", [](ModelSpec* s) { s->influences = s->body_influences = 1; }},
      {"most_layers_and_widest",
       [](ModelSpec* s) {
         s->layers = 8;
         s->feature_width = 64;
       }},
      {"fewest_patches",
       [](ModelSpec* s) {
         s->patches = s->mixes = s->capsules = 1;
         s->patch_points = s->sources = 2;
         s->patch_width = 8;
         s->patch_neighbours = s->embedding = 0;
       }},
      {"most_patches",
       [](ModelSpec* s) {
         s->segments = s->patches = s->patch_width = 256;
         s->rings = s->patch_points = 16;
         s->patch_neighbours = 4;
         s->mixes = 8;
         s->capsules = s->embedding = s->sources = 32;
       }},
      {"patches_without_extent", [](ModelSpec* s) { s->patches = 4; },
       [](M* m) {
         Fill<float>(m, *m->patch_stage->axes, 36, 0);
         Fill<float>(m, *m->patch_stage->capsules, 40, 0);
         Fill<float>(m, *m->patch_stage->point_parts, 192, 0);
       }},
      {"patches_that_keep_all_and_follow_one_point", [](ModelSpec* s) { s->patches = 4; },
       [](M* m) {
         Fill<float>(m, *m->patch_stage->keep, 3, 1);
         Fill<uint16_t>(m, *m->patch_stage->sources, 48, 7);
       }},
      {"ones_everywhere",
       [](ModelSpec* s) { s->static_width = s->units = s->mesh_width = s->mesh_basis = s->layers = 1; }},
      {"cloth_that_touches_nothing", [](ModelSpec* s) { s->body = s->touch = true; },
       [](M* m) {
         Fill<uint8_t>(m, *m->body->touched_by, 17, 0);
         m->body->sites.reset();
       }},
      {"cloth_of_eight_classes", [](ModelSpec* s) { s->body = s->touch = true; },
       [](M* m) {
         Fill<uint8_t>(m, *m->body->touched_by, 17, 0xFF);
         for (uint8_t i = 0; i < 60; ++i) *Data<uint8_t>(m, *m->body->touch_classes, i) = i % 8;
         m->body->garment_order.reset();  // of other classes
         m->body->sites.reset();
       }},
      {"static_with_empty_displacement", [](ModelSpec* s) { s->skeleton = s->mesh = false; },
       [](M* m) { m->displacement = std::make_unique<format::DisplacementT>(); }},
      {"root_motion_and_no_joint", [](ModelSpec* s) { s->skeleton = s->mesh = false; },
       [](M* m) {
         m->features->joints.clear();
         for (auto* tensor : {m->features->mean.get(), m->features->inverse_deviation.get(), m->features->low.get(),
                              m->features->high.get()})
           tensor->shape = {4};
         m->static_stage->hidden->weights->shape[0] = 4;
         m->static_stage->hidden->row_scales->shape[0] = 4;
       }},
  };
}

class OddFileTest : public ::testing::TestWithParam<OddFile> {};

TEST_P(OddFileTest, OpensAndRuns) {
  ModelSpec spec;
  spec.precision = format::DType_I8;
  GetParam().spec(&spec);
  TestModel model = BuildModel(spec);
  GetParam().tables(model.tables.get());
  const AlignedBytes bytes = model.Bytes();
  const Outcome outcome = OpenAndRun(bytes.data(), bytes.size());
  EXPECT_EQ(outcome.status, DCLOTH_OK) << outcome.text;
  EXPECT_EQ(outcome.broken_promise, "");
  EXPECT_EQ(outcome.finite, GetParam().finite.value_or(outcome.finite));
}

INSTANTIATE_TEST_SUITE_P(Named, OddFileTest, ::testing::ValuesIn(OddFiles()),
                         [](const auto& test) { return test.param.name; });

// Where tensors lie is the writer's choice: the same garment to the bit.
TEST(OddFile, LayoutDoesNotMatter) {
  TestModel model = BuildModel({});
  const OpenedModel straight(model);
  LayOutBackwards(model.tables.get());
  const OpenedModel backwards(model);
  OwnedCloth a(straight), b(backwards);
  for (int tick = 0; tick < 5; ++tick) {
    const std::vector<float> pose = PoseAt(model.numbers, tick / 30.0);
    for (OwnedCloth* cloth : {&a, &b}) {
      ASSERT_EQ(cloth->Tick(pose, DCLOTH_STAGES_MESH), DCLOTH_OK);
      ASSERT_EQ(cloth->Skin(pose, 1), DCLOTH_OK);
    }
    ASSERT_EQ(a.positions(), b.positions());
  }
}

// A file with lines behind its end, as an archive or a page-sized read leaves them.
TEST(OddFile, LinesBehindTheEndAreIgnored) {
  const AlignedBytes whole = BuildModel({}).Bytes();
  for (const size_t more : {64u, 4096u}) {
    AlignedBytes longer(whole.size() + more);
    std::memcpy(longer.data(), whole.data(), whole.size());
    EXPECT_EQ(OpenAndRun(longer.data(), longer.size()).status, DCLOTH_OK) << more;
  }
}

// A later minor version: tables with fields that this release does not know.
TEST(OddFile, UnknownFieldsOfALaterWriterAreIgnored) {
  const TestModel model = BuildModel({});
  const M& m = *model.tables;
  flatbuffers::FlatBufferBuilder builder;
  const auto garment = format::CreateGarment(builder, m.garment.get());
  const auto character = format::CreateCharacter(builder, m.character.get());
  const auto features = format::CreateFeatures(builder, m.features.get());
  const auto static_stage = format::CreateStaticStage(builder, m.static_stage.get());
  const auto skeleton = format::CreateSkeletonStage(builder, m.skeleton_stage.get());
  const auto mesh = format::CreateMeshStage(builder, m.mesh_stage.get());
  const auto displacement = format::CreateDisplacement(builder, m.displacement.get());
  const auto unknown_text = builder.CreateString("a field of format 1.9");
  builder.ForceVectorAlignment(m.weights.size(), 1, 64);
  const auto weights = builder.CreateVector(m.weights);
  constexpr flatbuffers::voffset_t kNext = format::Model::VT_PATCH_STAGE + 2;
  const flatbuffers::uoffset_t start = builder.StartTable();
  builder.AddElement<uint64_t>(kNext + 2, 0x123456789ABCDEF0u, 0);
  builder.AddOffset(kNext, unknown_text);
  builder.AddOffset(format::Model::VT_WEIGHTS, weights);
  builder.AddOffset(format::Model::VT_DISPLACEMENT, displacement);
  builder.AddOffset(format::Model::VT_MESH_STAGE, mesh);
  builder.AddOffset(format::Model::VT_SKELETON_STAGE, skeleton);
  builder.AddOffset(format::Model::VT_STATIC_STAGE, static_stage);
  builder.AddOffset(format::Model::VT_FEATURES, features);
  builder.AddOffset(format::Model::VT_CHARACTER, character);
  builder.AddOffset(format::Model::VT_GARMENT, garment);
  builder.AddElement<float>(format::Model::VT_TICK_RATE, 30, 0);
  builder.AddElement<uint16_t>(format::Model::VT_FORMAT_MINOR, 9, 0);
  builder.AddElement<uint16_t>(format::Model::VT_FORMAT_MAJOR, 1, 0);
  builder.Finish(flatbuffers::Offset<format::Model>(builder.EndTable(start)), format::ModelIdentifier());
  const AlignedBytes bytes(builder.GetBufferPointer(), builder.GetSize());
  ASSERT_EQ(bytes.size() % 64, 0u);
  const Outcome outcome = OpenAndRun(bytes.data(), bytes.size());
  EXPECT_EQ(outcome.status, DCLOTH_OK) << outcome.text;
  EXPECT_TRUE(outcome.finite);
}

}  // namespace
}  // namespace dcloth::testing

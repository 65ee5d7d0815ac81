// How long one call can keep the host's thread, whatever a file that passes the checks asks for: files that are at
// every limit at once, each dear in its own way. Products are small in all of them, as their time is that of reading
// the file.
#include <algorithm>
#include <array>
#include <cmath>
#include <ctime>
#include <functional>
#include <iostream>
#include <memory>
#include <random>
#include <string>

#include "engine/format/limits.h"
#include "tests/attack/corruption.h"
#include "tests/unit/engine/all_finite.h"
#include "tests/unit/engine/cloth_fixture.h"
#include "tests/unit/engine/tensor_writer.h"

namespace dcloth::testing {
namespace {

using M = format::ModelT;

// Processor seconds a byte of the file. Measured: 3e-8 with AVX-512, 4e-8 with AVX2, 1.4e-7 with SSE4 and up to
// 2.4e-7 beside other work; before subnormals were flushed 1.4e-6.
constexpr double kMostSecondsPerByte = 5e-7;
// Of the time of a tick with a mesh stage, what keeping the dearest garment outside of the dearest body may take.
// Measured: a twentieth to a quarter; before the search had a budget twice the tick's.
constexpr double kMostOutside = 1;

struct CostlyFile {
  const char* name;
  std::function<void(ModelSpec*)> shape;
  std::function<void(M*, std::mt19937*)> spoil;
};
void PrintTo(const CostlyFile& file, std::ostream* out) { *out << file.name; }

// As many neighbours as a file may have, each in another line of the cache.
void FillTheGraph(M* m, std::mt19937* random) {
  constexpr uint32_t kMostEdges = 1u << 24;
  TensorWriter writer(format::DType_F32, 1, &m->weights);
  const uint32_t n = m->garment->vertices, row = kMostEdges / n;
  std::vector<uint32_t> starts(n + 1);
  for (uint32_t i = 0; i <= n; ++i) starts[i] = i * row;
  std::vector<uint16_t> columns(starts[n]);
  for (uint16_t& column : columns) column = static_cast<uint16_t>((*random)() % n);
  m->mesh_stage->row_starts = writer.Add(format::DType_U32, {n + 1}, starts);
  m->mesh_stage->columns = writer.Add(format::DType_U16, {starts[n]}, columns);
}

// Numbers that many processors need 100 cycles for.
void MakeLayersSubnormal(M* m, std::mt19937*) {
  for (const auto& layer : m->mesh_stage->layers) {
    for (const auto* matrix : {&layer->input_gates, &layer->hidden_gates, &layer->hidden_candidate, &layer->output}) {
      const format::TensorT& tensor = **matrix;
      std::fill_n(Data<float>(m, tensor), size_t{tensor.shape[0]} * tensor.shape[1], 1e-40f);
    }
  }
}

// Faces at random all through the garment, so that every vertex is under some and each push leads under others. A few
// vertices have nearly all of the faces, as many each as a file may give them; the others lie far away, three a face.
void AddTangledBody(M* m, std::mt19937* random) {
  constexpr uint32_t kVertices = 8192, kFaces = 16384, kRing = 32, kBusy = (3 * kFaces - kVertices) / (kRing - 1);
  TensorWriter writer(format::DType_F32, 1, &m->weights);
  const auto between = [&](float low, float high) { return std::uniform_real_distribution<float>(low, high)(*random); };
  std::vector<float> positions;
  std::vector<uint16_t> faces, columns;
  std::vector<std::vector<uint16_t>> around(kVertices);
  for (uint32_t i = 0; i < kVertices; ++i) {
    const bool busy = i < kBusy;
    for (const float half : {0.6f, 0.0f, 0.6f}) {
      const float place = half != 0 ? between(-half, half) : between(-0.1f, 1.1f);
      positions.push_back(busy ? place : 50);
    }
    faces.insert(faces.end(), busy ? kRing : 1, static_cast<uint16_t>(i));
  }
  while (faces.size() < 3 * kFaces) faces.push_back(static_cast<uint16_t>(kVertices - 1));
  std::shuffle(faces.begin(), faces.begin() + kBusy * kRing, *random);
  for (size_t corner = 0; corner < faces.size(); ++corner)
    around[faces[corner]].push_back(static_cast<uint16_t>(corner / 3));
  std::vector<uint32_t> starts = {0};
  for (const std::vector<uint16_t>& ring : around) {
    columns.insert(columns.end(), ring.begin(), ring.end());
    starts.push_back(static_cast<uint32_t>(columns.size()));
  }
  m->body = std::make_unique<format::BodyT>();
  m->body->influences = 1;
  m->body->positions = writer.Add(format::DType_F32, {kVertices, 3}, positions);
  m->body->joints = writer.Add(format::DType_U8, {kVertices, 1}, std::vector<uint8_t>(kVertices, 0));
  m->body->weights = writer.Add(format::DType_F32, {kVertices, 1}, std::vector<float>(kVertices, 1.0f));
  m->body->faces = writer.Add(format::DType_U16, {kFaces, 3}, faces);
  m->body->row_starts = writer.Add(format::DType_U32, {kVertices + 1}, starts);
  m->body->columns = writer.Add(format::DType_U16, {3 * kFaces}, columns);
  m->body->clearance = 0.1f;
  m->body->reach = 10;
}

// Eight classes of cloth, each kept out of all.
void AddClasses(M* m, std::mt19937* random) {
  TensorWriter writer(format::DType_F32, 1, &m->weights);
  std::vector<uint8_t> classes(m->garment->vertices), touched(m->body->positions->shape[0], 0xFF);
  for (uint8_t& each : classes) each = static_cast<uint8_t>((*random)() % 8);
  m->body->touch_classes = writer.Add(format::DType_U8, {m->garment->vertices}, classes);
  m->body->touched_by = writer.Add(format::DType_U8, {m->body->positions->shape[0]}, touched);
}

// Each weight of a layer counts for 256 patches, and a vertex has as few weights of its own as it may.
void ShapeMostPatches(ModelSpec* spec) {
  spec->precision = format::DType_I8;
  spec->patches = format::kMaxPatches;
  spec->patch_points = format::kMaxPatchPoints;
  spec->patch_width = format::kMaxPatchWidth;
  spec->patch_neighbours = format::kMaxPatchNeighbours;
  spec->mixes = format::kMaxMixes;
  spec->capsules = format::kMaxCapsules;
  spec->embedding = format::kMaxEmbedding;
  spec->sources = 2;
}

std::vector<CostlyFile> CostlyFiles() {
  const auto as_it_is = [](ModelSpec*) {};
  return {{"most_neighbours", as_it_is, FillTheGraph},
          {"most_neighbours_integer_layers_classes", [](ModelSpec* spec) { spec->integer_layers = true; },
           [](M* m, std::mt19937* random) {
             FillTheGraph(m, random);
             AddClasses(m, random);
           }},
          {"subnormal_layers", as_it_is, MakeLayersSubnormal},
          {"most_patches", ShapeMostPatches, [](M*, std::mt19937*) {}}};
}

class CostliestTest : public ::testing::TestWithParam<CostlyFile> {
 protected:
  static TestModel Build() {
    ModelSpec spec;
    spec.rings = 255;
    spec.segments = 257;  // 65,535 vertices
    spec.joints = spec.bones = 256;
    spec.influences = spec.body_influences = 8;
    spec.layers = 8;
    spec.feature_width = 64;
    spec.units = spec.mesh_basis = spec.mesh_width = spec.static_width = 1;
    GetParam().shape(&spec);
    TestModel model = BuildModel(spec);
    std::mt19937 random(7);
    AddTangledBody(model.tables.get(), &random);
    GetParam().spoil(model.tables.get(), &random);
    return model;
  }

  // Processor time, which others on the machine have no part in.
  double Seconds(const std::string& call, const std::function<void()>& make) {
    const std::clock_t begin = std::clock();
    make();
    const double seconds = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
    std::cout << call << ' ' << 1e3 * seconds << " ms\n";
    EXPECT_LE(seconds, kMostSecondsPerByte * static_cast<double>(bytes_.size())) << call;
    return seconds;
  }

  TestModel model_ = Build();
  AlignedBytes bytes_ = model_.Bytes();
};

TEST_P(CostliestTest, NoCallTakesLongerThanItsFileExplains) {
  std::cout << GetParam().name << ", " << bytes_.size() << " bytes, " << dcloth_isa_name() << '\n';
  std::unique_ptr<OpenedModel> opened;
  Seconds("open", [&] { opened = std::make_unique<OpenedModel>(bytes_); });
  ASSERT_EQ(opened->status(), DCLOTH_OK) << opened->error().text;
  std::unique_ptr<OwnedCloth> cloth;
  Seconds("create", [&] { cloth = std::make_unique<OwnedCloth>(*opened); });
  const std::vector<float> matrices = PoseAt(model_.numbers, 0);
  const auto run = [&] { ASSERT_EQ(cloth->Tick(matrices, DCLOTH_STAGES_MESH), DCLOTH_OK); };
  const double tick = Seconds("tick", run), again = Seconds("tick with its memory in place", run);
  const dcloth_pose hitched = OwnedCloth::Pose(matrices);
  const dcloth_frame hitch = {sizeof(dcloth_frame), DCLOTH_STAGES_MESH, 10, 0, nullptr};
  const double update = Seconds("an update of two ticks", [&] {
    ASSERT_EQ(dcloth_cloth_update(cloth->get(), &hitched, &hitch, nullptr, nullptr), DCLOTH_OK);
  });
  EXPECT_GT(update, 1.2 * std::min(tick, again)) << "one tick only";
  Seconds("draw", [&] { ASSERT_EQ(cloth->Skin(matrices, 1), DCLOTH_OK); });
  std::vector<float> positions(cloth->positions().size()), normals(positions.size());
  dcloth_output output = FloatOutput(positions.size() / 3, positions.data(), 12, normals.data());
  output.flags = DCLOTH_OUTPUT_OUTSIDE_BODY;
  const dcloth_pose pose = OwnedCloth::Pose(matrices);
  const double outside = Seconds("draw outside of the body", [&] {
    ASSERT_EQ(dcloth_cloth_skin(cloth->get(), &pose, 1, &output, nullptr), DCLOTH_OK);
  });
  EXPECT_TRUE(model_.tables->mesh_stage == nullptr || outside <= kMostOutside * tick)
      << outside << " s beside " << tick;
  EXPECT_TRUE(AllFinite(positions));
  EXPECT_NE(positions, cloth->positions()) << "nothing was under the body";
  std::vector<uint8_t> state(dcloth_cloth_state_size(cloth->get()));
  Seconds("save", [&] { ASSERT_EQ(dcloth_cloth_save(cloth->get(), state.data(), state.size(), nullptr), DCLOTH_OK); });
  Seconds("restore",
          [&] { ASSERT_EQ(dcloth_cloth_restore(cloth->get(), state.data(), state.size(), 0, nullptr), DCLOTH_OK); });
}

// A garment in the middle of a ball: every site of the body is as near to each vertex as the others. Small files are
// worse than large ones here, as nothing else in them takes time.
TEST(CostliestBodyTest, AGarmentInsideABallTakesNoLongerThanItsFileExplains) {
  constexpr uint32_t kRings = 64, kAround = 128;
  ModelSpec spec;
  spec.rings = 255;
  spec.segments = 257;
  spec.influences = spec.static_width = 1;
  spec.skeleton = spec.mesh = false;
  TestModel model = BuildModel(spec);
  M* m = model.tables.get();
  std::mt19937 random(5);
  for (size_t i = 0; i < 3 * model.numbers.n; ++i) {
    *Data<float>(m, *m->garment->template_positions, i) =
        std::uniform_real_distribution<float>(-1e-3f, 1e-3f)(random) + (i % 3 == 1 ? 0.5f : 0.0f);
  }
  TensorWriter writer(format::DType_F32, 1, &m->weights);
  std::vector<float> positions;
  std::vector<std::vector<uint16_t>> around(size_t{kRings} * kAround);
  std::vector<uint16_t> faces, columns;
  std::vector<uint32_t> starts = {0};
  for (uint32_t r = 0; r < kRings; ++r) {
    const double polar = std::acos(1 - 2 * (r + 0.5) / kRings);
    for (uint32_t a = 0; a < kAround; ++a) {
      const double angle = 2 * 3.14159265358979 * a / kAround;
      for (const double x : {std::sin(polar) * std::cos(angle), std::cos(polar), std::sin(polar) * std::sin(angle)})
        positions.push_back(static_cast<float>(x) + (positions.size() % 3 == 1 ? 0.5f : 0.0f));
    }
  }
  const auto corner = [](uint32_t r, uint32_t a) { return static_cast<uint16_t>(r * kAround + a % kAround); };
  const auto add = [&](std::array<uint16_t, 3> face) {
    for (const uint16_t v : face) around[v].push_back(static_cast<uint16_t>(faces.size() / 3));
    faces.insert(faces.end(), face.begin(), face.end());
  };
  for (uint32_t r = 0; r + 1 < kRings; ++r) {
    for (uint32_t a = 0; a < kAround; ++a) {
      add({corner(r, a), corner(r, a + 1), corner(r + 1, a)});
      add({corner(r, a + 1), corner(r + 1, a + 1), corner(r + 1, a)});
    }
  }
  for (const std::vector<uint16_t>& ring : around) {
    columns.insert(columns.end(), ring.begin(), ring.end());
    starts.push_back(static_cast<uint32_t>(columns.size()));
  }
  const auto b = static_cast<uint32_t>(positions.size() / 3), f = static_cast<uint32_t>(faces.size() / 3);
  m->body = std::make_unique<format::BodyT>();
  m->body->influences = 1;
  m->body->positions = writer.Add(format::DType_F32, {b, 3}, positions);
  m->body->joints = writer.Add(format::DType_U8, {b, 1}, std::vector<uint8_t>(b, 0));
  m->body->weights = writer.Add(format::DType_F32, {b, 1}, std::vector<float>(b, 1.0f));
  m->body->faces = writer.Add(format::DType_U16, {f, 3}, faces);
  m->body->row_starts = writer.Add(format::DType_U32, {b + 1}, starts);
  m->body->columns = writer.Add(format::DType_U16, {3 * f}, columns);
  m->body->clearance = 0.002f;
  m->body->reach = 10;
  const AlignedBytes bytes = model.Bytes();
  const OpenedModel opened(bytes);
  ASSERT_EQ(opened.status(), DCLOTH_OK) << opened.error().text;
  const std::vector<float> matrices = PoseAt(model.numbers, 0);
  for (const std::string& isa : UsableIsas()) {
    ASSERT_EQ(dcloth_isa_select(isa.c_str()), DCLOTH_OK);
    OwnedCloth cloth(opened);
    std::vector<float> drawn(cloth.positions().size());
    dcloth_output output = FloatOutput(drawn.size() / 3, drawn.data(), 12, nullptr);
    output.flags = DCLOTH_OUTPUT_OUTSIDE_BODY;
    const dcloth_pose pose = OwnedCloth::Pose(matrices);
    double seconds = 1e9;  // the fastest of three
    for (int run = 0; run < 3; ++run) {
      const std::clock_t begin = std::clock();
      ASSERT_EQ(dcloth_cloth_skin(cloth.get(), &pose, 1, &output, nullptr), DCLOTH_OK);
      seconds = std::min(seconds, static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC);
    }
    std::cout << isa << ": " << 1e3 * seconds << " ms, " << 1e9 * seconds / static_cast<double>(bytes.size())
              << " ns a byte\n";
    EXPECT_LE(seconds, kMostSecondsPerByte * static_cast<double>(bytes.size())) << isa;
    EXPECT_TRUE(AllFinite(drawn));
  }
  ASSERT_EQ(dcloth_isa_select(nullptr), DCLOTH_OK);
}

INSTANTIATE_TEST_SUITE_P(Every, CostliestTest, ::testing::ValuesIn(CostlyFiles()),
                         [](const auto& test) { return test.param.name; });

}  // namespace
}  // namespace dcloth::testing

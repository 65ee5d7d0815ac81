// Damaged files: every truncation is refused, and no flipped bit harms the host, whether the file is refused or runs.
#include <random>

#include "tests/unit/engine/cloth_fixture.h"

namespace dcloth::testing {
namespace {

ModelSpec SmallSpec(format::DType precision) {
  ModelSpec spec;
  spec.precision = precision;
  spec.rings = 4;
  spec.segments = 5;
  spec.feature_width = 8;
  spec.mesh_width = 9;
  if (precision == format::DType_F16) spec.rank = 10;  // one of the three with a reduced basis
  return spec;
}

// Opens `bytes`; runs a tick of every stage and a frame when that succeeds. Memory has exactly the sizes asked for.
dcloth_status OpenAndRun(const AlignedBytes& bytes) {
  const OpenedModel opened(bytes);
  if (opened.status() != DCLOTH_OK) return opened.status();
  OwnedCloth cloth(opened);
  const dcloth_model_info info = opened.info();
  std::vector<float> pose;
  for (uint32_t j = 0; j < info.joint_count; ++j) {
    for (int element = 0; element < 16; ++element) pose.push_back(element % 5 == 0 ? 1.0f : 0.0f);
  }
  EXPECT_EQ(cloth.Tick(pose, info.stages), DCLOTH_OK);
  EXPECT_EQ(cloth.Tick(pose, info.stages), DCLOTH_OK);
  EXPECT_EQ(cloth.Skin(pose, 0.5f), DCLOTH_OK);
  return DCLOTH_OK;
}

TEST(Truncation, EveryPrefixIsRefused) {
  const AlignedBytes whole = BuildModel(SmallSpec(format::DType_I8)).Bytes();
  ASSERT_EQ(OpenAndRun(whole), DCLOTH_OK);
  AlignedBytes storage(dcloth_model_storage_size());
  size_t refused = 0;
  for (size_t size = 0; size < whole.size(); ++size) {
    const AlignedBytes prefix(whole.data(), size);
    dcloth_model* model = nullptr;
    dcloth_error error = EmptyError();
    ASSERT_NE(dcloth_model_open(prefix.data(), size, storage.data(), storage.size(), &model, &error), DCLOTH_OK)
        << size;
    ASSERT_EQ(model, nullptr);
    ++refused;
  }
  EXPECT_EQ(refused, whole.size());
}

// The bytes of a file that are tables and names, and those that are weights.
struct Bytes {
  std::vector<size_t> tables, weights;
};

Bytes Split(const TestModel& model, const AlignedBytes& whole) {
  const OpenedModel opened(whole);
  const auto* faces = reinterpret_cast<const uint8_t*>(opened.info().triangles);
  const size_t begin = static_cast<size_t>(faces - opened.bytes().data()) - model.tables->garment->faces->offset;
  const size_t end = begin + model.tables->weights.size();
  Bytes bytes;
  for (size_t i = 0; i < whole.size(); ++i) (i >= begin && i < end ? bytes.weights : bytes.tables).push_back(i);
  return bytes;
}

class BitFlipTest : public ::testing::TestWithParam<format::DType> {};

// Every bit of the tables, and bits of the weights at random: indices and scales are among them.
TEST_P(BitFlipTest, NeverHarms) {
  const TestModel model = BuildModel(SmallSpec(GetParam()));
  const AlignedBytes whole = model.Bytes();
  const Bytes bytes = Split(model, whole);
  ASSERT_EQ(bytes.weights.size(), model.tables->weights.size());
  size_t accepted = 0, refused = 0;
  const auto flip = [&](size_t byte, uint32_t bit) {
    AlignedBytes damaged = whole;
    damaged.data()[byte] ^= static_cast<uint8_t>(1u << bit);
    (OpenAndRun(damaged) == DCLOTH_OK ? accepted : refused) += 1;
  };
  for (const size_t byte : bytes.tables) {
    for (uint32_t bit = 0; bit < 8; ++bit) flip(byte, bit);
  }
  // The rest is padding, names, free numbers and offsets that lead to an equal table.
  EXPECT_GT(refused, 4 * bytes.tables.size()) << "of " << 8 * bytes.tables.size() << " bits in the tables";
  std::mt19937 random(7);
  for (int i = 0; i < 5000; ++i) flip(bytes.weights[random() % bytes.weights.size()], random() % 8);
  EXPECT_GT(accepted, 0u);
  RecordProperty("accepted", static_cast<int>(accepted));
  RecordProperty("refused", static_cast<int>(refused));
}

// Several wild bytes at once, which single flips do not reach.
TEST_P(BitFlipTest, WildBytesNeverHarm) {
  const TestModel model = BuildModel(SmallSpec(GetParam()));
  const AlignedBytes whole = model.Bytes();
  const Bytes bytes = Split(model, whole);
  std::mt19937 random(11);
  size_t refused = 0;
  for (int i = 0; i < 5000; ++i) {
    AlignedBytes damaged = whole;
    for (uint32_t hits = 1 + random() % 6; hits > 0; --hits)
      damaged.data()[bytes.tables[random() % bytes.tables.size()]] = static_cast<uint8_t>(random());
    refused += OpenAndRun(damaged) != DCLOTH_OK;
  }
  EXPECT_GT(refused, 1000u);
}

INSTANTIATE_TEST_SUITE_P(EveryPrecision, BitFlipTest,
                         ::testing::Values(format::DType_F32, format::DType_F16, format::DType_I8),
                         [](const auto& test) { return format::EnumNameDType(test.param); });

// Weights are not scanned when a model opens: NaN in them gives NaN vertices and nothing worse.
TEST(NanWeights, GiveNanVerticesAndNoFault) {
  TestModel model = BuildModel(SmallSpec(format::DType_F32));
  const format::TensorT& basis = *model.tables->displacement->basis->weights;
  std::memset(model.tables->weights.data() + basis.offset, 0xFF, 4096);
  const OpenedModel opened(model);
  ASSERT_EQ(opened.status(), DCLOTH_OK) << opened.error().text;
  OwnedCloth cloth(opened);
  const std::vector<float> pose = PoseAt(model.numbers, 0);
  ASSERT_EQ(cloth.Tick(pose, DCLOTH_STAGES_MESH), DCLOTH_OK);
  ASSERT_EQ(cloth.Skin(pose, 1), DCLOTH_OK);
  EXPECT_NE(cloth.positions()[0], cloth.positions()[0]);
}

}  // namespace
}  // namespace dcloth::testing

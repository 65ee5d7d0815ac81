#include "converter/write_model.h"

#include <gtest/gtest.h>

#include <cctype>
#include <cstring>
#include <set>

#ifndef FLATBUFFERS_MAX_ALIGNMENT
#define FLATBUFFERS_MAX_ALIGNMENT 64
#endif
#include "converter/assemble.h"
#include "dcloth_generated.h"
#include "engine/format/checksum.h"
#include "tests/unit/converter/converter_testing.h"

namespace dcloth::converter {
namespace {

TEST(WriteModelTest, StoredTypesAreTheSchemas) {
  for (int type = 0; type < 6; ++type) {
    std::string name = format::EnumNameDType(static_cast<format::DType>(type));
    for (char& letter : name) letter = static_cast<char>(std::tolower(letter));
    EXPECT_EQ(name, StoredTypeName(static_cast<StoredType>(type)));
  }
}

ModelParts Parts(Precision precision) {
  const Bundle bundle = ParseBundle({});
  return Assemble(bundle, FoldBundle(bundle, 4, 4), {precision, {}});
}

// Read with FlatBuffers' own reader: identifier, alignment, every tensor's bytes in its place, nothing but zero
// between.
TEST(WriteModelTest, TensorsLieInPlaceAndGapsAreZero) {
  for (const Precision precision : kPrecisions) {
    const ModelParts parts = Parts(precision);
    const AlignedBytes bytes = WriteModel(parts);
    const auto* const data = reinterpret_cast<const uint8_t*>(bytes.data());
    flatbuffers::Verifier verifier(data, bytes.size());
    ASSERT_TRUE(format::VerifyModelBuffer(verifier));
    const format::Model& model = *format::GetModel(data);
    const uint8_t* const weights = model.weights()->data();
    EXPECT_EQ((weights - data) % 64, 0);
    std::vector<bool> used(model.weights()->size(), false);
    uint64_t at = 0;
    for (const PackedTensor* tensor : TensorsOf(parts)) {
      ASSERT_LE(at + tensor->bytes.size(), used.size());
      EXPECT_EQ(std::memcmp(weights + at, tensor->bytes.data(), tensor->bytes.size()), 0) << tensor->report.name;
      std::fill_n(used.begin() + static_cast<std::ptrdiff_t>(at), tensor->bytes.size(), true);
      at += (tensor->bytes.size() + 63) / 64 * 64;
    }
    EXPECT_EQ(at, used.size());
    for (size_t i = 0; i < used.size(); ++i) {
      if (!used[i]) {
        ASSERT_EQ(weights[i], 0) << i;
      }
    }
    // A spot check that fields were not swapped: the last tensors written are the garment's.
    const format::Tensor& faces = *model.garment()->coarse_faces();
    EXPECT_EQ(faces.offset() + (parts.coarse_faces->bytes.size() + 63) / 64 * 64, used.size());
    EXPECT_EQ(faces.shape()->Get(1), 3u);
    EXPECT_EQ(model.mesh_stage()->layers()->size(), 2u);
    EXPECT_EQ(model.displacement()->skeleton_rows() + model.displacement()->mesh_rows(),
              model.displacement()->basis()->weights()->shape()->Get(0));
  }
}

// The first that has all of a model's parts, so that older libraries open what they can run.
TEST(WriteModelTest, MinorVersionIsThatOfItsParts) {
  const auto minor = [](const ModelParts& parts) {
    const AlignedBytes bytes = WriteModel(parts);
    return format::GetModel(bytes.data())->format_minor();
  };
  const BundleSpec spec{.feature_width = 16};
  const Bundle bundle = ParseBundle(spec);
  const FoldedBundle folded = FoldBundle(bundle, 4, 4);
  ModelParts floats = Assemble(bundle, folded, {Precision::kFp32, {}});
  ModelParts integers = Assemble(bundle, folded, {Precision::kInt8, {}});
  for (ModelParts* parts : {&floats, &integers}) {
    EXPECT_EQ(minor(*parts), 6) << "a coarse mesh";
    ModelParts textured = *parts;
    textured.texture_coordinates = PackFloats("garment.texture_coordinates", Matrix(Matrix::Zero(parts->vertices, 2)));
    EXPECT_EQ(minor(textured), 7);
    parts->coarse_vertices.reset();
    parts->coarse_faces.reset();
  }
  EXPECT_EQ(minor(floats), 2);
  EXPECT_EQ(minor(integers), 3);
  ASSERT_EQ(integers.mesh->layers.size(), 2u);
  ModelParts one = integers;
  one.mesh->layers[0] = floats.mesh->layers[0];
  EXPECT_EQ(minor(one), 3) << "one layer in integers";
  for (ModelParts* parts : {&floats, &integers}) {
    parts->body.emplace();
    EXPECT_LT(minor(*parts), 4);
    parts->body->touch_classes = PackIndices("body.touch_classes", StoredType::kU8, {1}, {0});
    EXPECT_EQ(minor(*parts), 4);
    parts->body->garment_order = PackIndices("body.garment_order", StoredType::kU16, {1}, {0});
    EXPECT_EQ(minor(*parts), 5);
  }
  integers.body.reset();
  EXPECT_EQ(minor(integers), 3);
  integers.parents.assign(integers.joint_names.size(), 65535);
  EXPECT_EQ(minor(integers), 5);
  integers.parents.clear();
  integers.mesh.reset();
  EXPECT_EQ(minor(integers), 2);
}

TEST(WriteModelTest, TensorsTakeWholeLines) {
  ModelParts parts = Parts(Precision::kFp32);
  parts.body.emplace();
  const auto size = [&] {
    const AlignedBytes bytes = WriteModel(parts);
    return format::GetModel(bytes.data())->weights()->size();
  };
  const size_t without = size();
  for (const uint32_t bytes : {1u, 2u, 64u, 65u, 128u}) {
    parts.body->touch_classes =
        PackIndices("body.touch_classes", StoredType::kU8, {bytes}, std::vector<uint32_t>(bytes));
    EXPECT_EQ(size() - without, (bytes + 63) / 64 * 64) << bytes;
  }
}

TEST(WriteModelTest, TensorNamesAreUnique) {
  const ModelParts parts = Parts(Precision::kInt8);
  std::set<std::string> names;
  for (const PackedTensor* tensor : TensorsOf(parts))
    EXPECT_TRUE(names.insert(tensor->report.name).second) << tensor->report.name;
  EXPECT_GT(names.size(), 50u);
}

// The checksum of all else in the file: one more bit anywhere is another model.
TEST(WriteModelTest, IdentityIsTheFilesChecksum) {
  const auto identity = [](const AlignedBytes& bytes) { return format::GetModel(bytes.data())->identity(); };
  std::set<uint64_t> seen;
  for (const Precision precision : kPrecisions) {
    ModelParts parts = Parts(precision);
    AlignedBytes bytes = WriteModel(parts);
    EXPECT_EQ(identity(bytes), identity(WriteModel(parts))) << "the same parts are the same model";
    EXPECT_TRUE(seen.insert(identity(bytes)).second);
    parts.template_positions.bytes[5] ^= std::byte{1};
    EXPECT_TRUE(seen.insert(identity(WriteModel(parts))).second) << "one bit of one tensor";
    const uint64_t written = identity(bytes);
    auto* const root = flatbuffers::GetMutableRoot<flatbuffers::Table>(bytes.data());
    ASSERT_TRUE(root->SetField<uint64_t>(format::Model::VT_IDENTITY, 0));
    EXPECT_EQ(format::Checksum(bytes.data(), bytes.size()), written);
  }
  EXPECT_EQ(seen.size(), 6u);
  EXPECT_EQ(seen.count(0), 0u) << "0 is a file without identity";
}

}  // namespace
}  // namespace dcloth::converter

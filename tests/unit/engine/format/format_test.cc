// Opening a sound model, and bad arguments. The verification ladder's refusals are in tests/attack.
#include <cstring>
#include <vector>

#include "tests/unit/engine/cloth_fixture.h"

namespace dcloth::testing {
namespace {

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

TEST(Open, DescribesOnlyIntoAStructOfItsSize) {
  const OpenedModel opened(BuildModel({}));
  dcloth_model_info info = {};
  const auto untouched = [&] { return info.joint_count == 0 && info.name == nullptr && info.triangles == nullptr; };
  for (const uint32_t size : {0u, 4u, static_cast<uint32_t>(sizeof(info)) - 1}) {
    info.struct_size = size;
    EXPECT_EQ(dcloth_model_describe(opened.get(), &info), DCLOTH_ERROR_ARGUMENT) << size;
    EXPECT_TRUE(untouched()) << size;
  }
  info.struct_size = sizeof(info);
  EXPECT_EQ(dcloth_model_describe(nullptr, &info), DCLOTH_ERROR_ARGUMENT);
  EXPECT_TRUE(untouched());
  EXPECT_EQ(dcloth_model_describe(opened.get(), nullptr), DCLOTH_ERROR_ARGUMENT);
  EXPECT_EQ(dcloth_model_describe(opened.get(), &info), DCLOTH_OK);
  EXPECT_FALSE(untouched());
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

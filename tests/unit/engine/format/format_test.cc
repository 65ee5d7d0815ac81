// Opening a sound model, and bad arguments. The verification ladder's refusals are in tests/attack.
#include <algorithm>
#include <cstddef>
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

TEST(Open, TellsWhereTheGarmentHung) {
  const TestModel model = BuildModel({});
  const OpenedModel opened(model);
  const dcloth_model_info info = opened.info();
  for (size_t i = 0; i < 3 * size_t{info.vertex_count}; ++i)
    EXPECT_EQ(info.positions[i], static_cast<float>(model.numbers.positions[i])) << i;
}

TEST(Open, TellsTheJointAbove) {
  TestModel model = BuildModel({});
  EXPECT_EQ(dcloth_model_joint_parent(OpenedModel(model).get(), 0), DCLOTH_JOINT_UNKNOWN);
  model.tables->character->parents = {1, 4, 1, 2, 65535, 4, 5, 5, 7};
  const OpenedModel opened(model);
  ASSERT_EQ(opened.status(), DCLOTH_OK) << opened.error().text;
  const int32_t expected[] = {1, 4, 1, 2, DCLOTH_JOINT_TOP, 4, 5, 5, 7};
  for (uint32_t j = 0; j < 9; ++j) EXPECT_EQ(dcloth_model_joint_parent(opened.get(), j), expected[j]) << j;
  for (const uint32_t past : {9u, 256u, ~0u})
    EXPECT_EQ(dcloth_model_joint_parent(opened.get(), past), DCLOTH_JOINT_UNKNOWN) << past;
  EXPECT_EQ(dcloth_model_joint_parent(nullptr, 0), DCLOTH_JOINT_UNKNOWN);
}

TEST(Open, GivesTheOutputOfTheGarment) {
  for (const bool body : {false, true}) {
    ModelSpec spec;
    spec.body = body;
    const OpenedModel opened(BuildModel(spec));
    ASSERT_EQ(opened.status(), DCLOTH_OK) << opened.error().text;
    dcloth_output output;
    std::memset(&output, 0xA5, sizeof(output));
    output.struct_size = sizeof(output);
    ASSERT_EQ(dcloth_model_output(opened.get(), &output), DCLOTH_OK);
    EXPECT_EQ(output.flags, body ? uint32_t{DCLOTH_OUTPUT_OUTSIDE_BODY} : 0u);
    // With positions alone it is drawn into; no other pointer is left over.
    OwnedCloth cloth(opened);
    std::vector<float> positions(3 * size_t{opened.info().vertex_count}, -1.0f);
    output.positions = positions.data();
    const std::vector<float> matrices = PoseAt(BuildModel(spec).numbers, 0);
    const dcloth_pose pose = {sizeof(dcloth_pose), opened.info().joint_count, matrices.data(), 0, 0};
    ASSERT_EQ(dcloth_cloth_skin(cloth.get(), &pose, 1, &output, nullptr), DCLOTH_OK);
    EXPECT_EQ(std::count(positions.begin(), positions.end(), -1.0f), 0);
  }
  const OpenedModel opened(BuildModel({}));
  dcloth_output output = {};
  EXPECT_EQ(dcloth_model_output(opened.get(), &output), DCLOTH_ERROR_ARGUMENT) << "struct_size 0";
  EXPECT_EQ(dcloth_model_output(opened.get(), nullptr), DCLOTH_ERROR_ARGUMENT);
  output.struct_size = sizeof(output);
  EXPECT_EQ(dcloth_model_output(nullptr, &output), DCLOTH_ERROR_ARGUMENT);
  EXPECT_EQ(output.vertex_count, 0u);
}

TEST(Open, DescribesOnlyIntoAStructOfItsSize) {
  const OpenedModel opened(BuildModel({}));
  dcloth_model_info info = {};
  const auto untouched = [&] { return info.joint_count == 0 && info.name == nullptr && info.triangles == nullptr; };
  const auto first_version = static_cast<uint32_t>(offsetof(dcloth_model_info, positions));
  for (const uint32_t size : {0u, 4u, first_version - 1}) {
    info.struct_size = size;
    EXPECT_EQ(dcloth_model_describe(opened.get(), &info), DCLOTH_ERROR_ARGUMENT) << size;
    EXPECT_TRUE(untouched()) << size;
  }
  info.struct_size = first_version;
  EXPECT_EQ(dcloth_model_describe(nullptr, &info), DCLOTH_ERROR_ARGUMENT);
  EXPECT_TRUE(untouched());
  EXPECT_EQ(dcloth_model_describe(opened.get(), nullptr), DCLOTH_ERROR_ARGUMENT);
  EXPECT_EQ(dcloth_model_describe(opened.get(), &info), DCLOTH_OK);
  EXPECT_FALSE(untouched());
  EXPECT_EQ(info.positions, nullptr) << "no room for it";
}

// Sizes and addresses that are none are in tests/attack.
TEST(Open, RefusesNullPointers) {
  const AlignedBytes bytes = BuildModel({}).Bytes();
  AlignedBytes storage(dcloth_model_storage_size());
  dcloth_model* model = nullptr;
  EXPECT_EQ(dcloth_model_open(bytes.data(), bytes.size(), nullptr, storage.size(), &model, nullptr),
            DCLOTH_ERROR_ARGUMENT);
  EXPECT_EQ(dcloth_model_open(bytes.data(), bytes.size(), storage.data(), storage.size(), nullptr, nullptr),
            DCLOTH_ERROR_ARGUMENT);
  EXPECT_EQ(model, nullptr);
}

}  // namespace
}  // namespace dcloth::testing

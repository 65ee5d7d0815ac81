// Opening a sound model, null pointers, the body's limits. The verification ladder's refusals are in tests/attack.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <random>
#include <vector>

#include "tests/unit/engine/cloth_fixture.h"
#include "tests/unit/engine/test_body.h"

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

TEST(BodyFormat, LimitsThemselvesAreAllowed) {
  TestModel model = BuildModel({});
  AddBody(&model);
  format::BodyT* const body = model.tables->body.get();
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
    TestModel model = BuildModel({.rings = 3, .segments = 4, .skeleton = false, .mesh = false});
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

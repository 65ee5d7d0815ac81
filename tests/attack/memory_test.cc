// Memory that the host lends: exact sizes, boundaries, guard pages around every buffer, nothing taken for
// granted of what lay there before.
#include <algorithm>
#include <cmath>
#include <cstring>

#include "tests/attack/variants.h"
#include "tests/unit/engine/cloth_fixture.h"
#include "tests/unit/kernels/guarded_buffer.h"

namespace dcloth::testing {
namespace {

using kernels::GuardedBuffer;
using kernels::Place;

// Guarded bytes that start on 64 bytes whatever their size: a multiple of 64 ends at the guard page too.
using Lent = GuardedBuffer<uint8_t>;

class MemoryTest : public ::testing::TestWithParam<Variant> {
 protected:
  std::vector<float> Pose(double tick) const { return PoseAt(model_.numbers, tick / 30); }

  TestModel model_ = BuildModel(GetParam().spec);
  AlignedBytes bytes_ = model_.Bytes();
};

// Word by word from nothing: refused without a trace until the size asked for, then accepted.
TEST_P(MemoryTest, LentWordByWord) {
  constexpr size_t kWord = sizeof(void*);
  const auto expect_refused = [](dcloth_status status, const void* result, const Lent& storage, size_t lent) {
    ASSERT_EQ(status, DCLOTH_ERROR_MEMORY) << lent;
    ASSERT_EQ(result, nullptr) << lent;
    ASSERT_TRUE(std::all_of(storage.data(), storage.data() + storage.size(), [](uint8_t b) { return b == 0xCD; }));
  };
  const size_t view_size = dcloth_model_storage_size();
  Lent view(view_size, Place::kAligned64);
  dcloth_model* model = nullptr;
  for (size_t lent = 0; lent < view_size; lent += kWord) {
    expect_refused(dcloth_model_open(bytes_.data(), bytes_.size(), view.data(), lent, &model, nullptr), model, view,
                   lent);
  }
  dcloth_error error = EmptyError();
  expect_refused(dcloth_model_open(bytes_.data(), bytes_.size(), view.data(), view_size - 1, &model, &error), model,
                 view, view_size - 1);
  EXPECT_EQ(std::string(error.text)
                .find("found " + std::to_string(view_size - 1) + " bytes of storage; allowed: at least " +
                      std::to_string(view_size)),
            0u)
      << error.text;
  ASSERT_EQ(dcloth_model_open(bytes_.data(), bytes_.size(), view.data(), view_size, &model, nullptr), DCLOTH_OK);

  const size_t size = dcloth_cloth_storage_size(model);
  Lent storage(size, Place::kAligned64);
  dcloth_cloth* cloth = nullptr;
  for (size_t lent = 0; lent < size; lent += kWord) {
    expect_refused(dcloth_cloth_create(model, storage.data(), lent, &cloth, nullptr), cloth, storage, lent);
  }
  expect_refused(dcloth_cloth_create(model, storage.data(), size - 1, &cloth, &error), cloth, storage, size - 1);
  EXPECT_NE(std::string(error.text).find("allowed: at least " + std::to_string(size)), std::string::npos);
  ASSERT_EQ(dcloth_cloth_create(model, storage.data(), size, &cloth, nullptr), DCLOTH_OK);
  EXPECT_TRUE(view.SlackUntouched() && storage.SlackUntouched());
}

struct Lender {
  Place aligned, other;  // of buffers that start on 64 bytes, and of those that need not
};

// A second of frames with a guard page right behind every buffer, then right before, model bytes read-only:
// one byte read or written outside ends the test.
TEST_P(MemoryTest, EveryHostBufferBetweenGuardPages) {
  size_t frames = 0;
  for (const std::string& isa : UsableIsas()) {
    ASSERT_EQ(dcloth_isa_select(isa.c_str()), DCLOTH_OK);
    for (const Lender& lender : {Lender{Place::kAligned64, Place::kEnd}, Lender{Place::kStart, Place::kStart}}) {
      Lent bytes(bytes_.size(), lender.aligned);
      std::copy_n(bytes_.data(), bytes_.size(), bytes.data());
      bytes.MakeReadOnly();
      Lent view(dcloth_model_storage_size(), lender.aligned);
      GuardedBuffer<dcloth_error> error(1, lender.other);
      error[0] = EmptyError();
      dcloth_model* model = nullptr;
      ASSERT_EQ(dcloth_model_open(bytes.data(), bytes.size(), view.data(), view.size(), &model, error.data()),
                DCLOTH_OK);
      view.MakeReadOnly();  // an open model never changes
      GuardedBuffer<dcloth_model_info> info(1, lender.other);
      info[0].struct_size = sizeof(dcloth_model_info);
      ASSERT_EQ(dcloth_model_describe(model, info.data()), DCLOTH_OK);
      Lent storage(dcloth_cloth_storage_size(model), lender.aligned);
      dcloth_cloth* cloth = nullptr;
      ASSERT_EQ(dcloth_cloth_create(model, storage.data(), storage.size(), &cloth, error.data()), DCLOTH_OK);

      const uint32_t n = info[0].vertex_count;
      const std::vector<float> first = Pose(0);
      GuardedBuffer<float> matrices(first, lender.other);
      GuardedBuffer<float> positions(3 * n, lender.other), normals(3 * n, lender.other);
      GuardedBuffer<dcloth_pose> pose(1, lender.other);
      pose[0] = {sizeof(dcloth_pose), info[0].joint_count, matrices.data(), 0, 0};
      GuardedBuffer<dcloth_output> output(1, lender.other);
      output[0] = {};
      output[0].struct_size = sizeof(dcloth_output);
      output[0].vertex_count = n;
      output[0].positions = positions.data();
      output[0].normals = normals.data();
      output[0].position_stride_bytes = output[0].normal_stride_bytes = 12;
      GuardedBuffer<dcloth_timer> timer(1, lender.other);
      timer[0] = {};
      timer[0].struct_size = sizeof(dcloth_timer);
      timer[0].now = [](void*) { return uint64_t{0}; };
      for (int tick = 0; tick < 30; ++tick) {
        const std::vector<float> next = Pose(tick);
        std::copy(next.begin(), next.end(), matrices.data());
        ASSERT_EQ(dcloth_cloth_tick(cloth, pose.data(), info[0].stages, timer.data()), DCLOTH_OK);
        ASSERT_EQ(dcloth_cloth_skin(cloth, pose.data(), 0.5f, output.data(), timer.data()), DCLOTH_OK);
        ++frames;
      }
      for (const auto* buffer : {&matrices, &positions, &normals}) {
        ASSERT_TRUE(buffer->SlackUntouched());
        for (size_t i = 0; i < buffer->size(); ++i) ASSERT_FALSE(std::isnan((*buffer)[i])) << i;
      }
      ASSERT_TRUE(bytes.SlackUntouched() && view.SlackUntouched() && storage.SlackUntouched());
      ASSERT_TRUE(error.SlackUntouched() && info.SlackUntouched() && pose.SlackUntouched());
      ASSERT_TRUE(output.SlackUntouched() && timer.SlackUntouched());
    }
  }
  dcloth_isa_select(nullptr);
  ASSERT_GE(frames, 60u);
}

// Whatever lay in lent memory before does not matter, to the bit.
TEST_P(MemoryTest, OldContentDoesNotMatter) {
  const OpenedModel opened(bytes_);
  std::vector<float> expected;
  for (const uint8_t fill : {0x00, 0xFF, 0x7F}) {
    AlignedBytes storage(dcloth_cloth_storage_size(opened.get()));
    std::memset(storage.data(), fill, storage.size());
    dcloth_cloth* cloth = nullptr;
    ASSERT_EQ(dcloth_cloth_create(opened.get(), storage.data(), storage.size(), &cloth, nullptr), DCLOTH_OK);
    std::vector<float> positions(3 * model_.numbers.n);
    dcloth_output output = {};
    output.struct_size = sizeof(output);
    output.vertex_count = static_cast<uint32_t>(model_.numbers.n);
    output.positions = positions.data();
    output.position_stride_bytes = 12;
    for (int tick = 0; tick < 3; ++tick) {
      const std::vector<float> matrices = Pose(tick);
      const dcloth_pose pose = OwnedCloth::Pose(matrices);
      ASSERT_EQ(dcloth_cloth_tick(cloth, &pose, opened.info().stages, nullptr), DCLOTH_OK);
      ASSERT_EQ(dcloth_cloth_skin(cloth, &pose, 1, &output, nullptr), DCLOTH_OK);
    }
    if (expected.empty()) expected = positions;
    ASSERT_EQ(positions, expected) << int{fill};
  }
}

// Every address off its boundary is refused, whatever the buffer, and leaves no trace.
TEST_P(MemoryTest, AddressesOffTheirBoundaryAreRefused) {
  const OpenedModel opened(bytes_);
  OwnedCloth disturbed(opened), twin(opened);
  AlignedBytes room(dcloth_cloth_storage_size(opened.get()) + 64);
  for (size_t shift = 1; shift < 64; ++shift) {
    dcloth_model* model = nullptr;
    dcloth_cloth* cloth = nullptr;
    dcloth_error error = EmptyError();
    ASSERT_EQ(dcloth_model_open(bytes_.data(), bytes_.size(), room.data() + shift, dcloth_model_storage_size(), &model,
                                &error),
              DCLOTH_ERROR_ALIGNMENT);
    ASSERT_EQ(std::string(error.text)
                  .find("found storage that is not aligned to 64 bytes; allowed: an address divisible by 64"),
              0u)
        << error.text;
    ASSERT_EQ(dcloth_cloth_create(opened.get(), room.data() + shift, room.size() - 64, &cloth, nullptr),
              DCLOTH_ERROR_ALIGNMENT);
    ASSERT_TRUE(model == nullptr && cloth == nullptr);
  }
  const uint32_t stages = opened.info().stages;
  const std::vector<float> matrices = Pose(0);
  const auto n = static_cast<uint32_t>(model_.numbers.n);
  std::vector<float> buffer(std::max<size_t>(matrices.size(), 6 * size_t{n}) + 1);
  std::copy(matrices.begin(), matrices.end(), buffer.begin());
  const auto shifted = [&](size_t bytes) {
    return reinterpret_cast<float*>(reinterpret_cast<uint8_t*>(buffer.data()) + bytes);
  };
  for (size_t shift = 1; shift < 4; ++shift) {
    dcloth_pose pose = OwnedCloth::Pose(matrices);
    dcloth_output output = {};
    output.struct_size = sizeof(output);
    output.vertex_count = n;
    output.positions = shifted(shift);
    output.position_stride_bytes = output.normal_stride_bytes = 12;
    EXPECT_EQ(dcloth_cloth_skin(disturbed.get(), &pose, 1, &output, nullptr), DCLOTH_ERROR_ARGUMENT);
    output.positions = buffer.data();
    output.normals = shifted(shift);
    EXPECT_EQ(dcloth_cloth_skin(disturbed.get(), &pose, 1, &output, nullptr), DCLOTH_ERROR_ARGUMENT);
    output.normals = nullptr;
    for (const uint32_t stride : {12u + static_cast<uint32_t>(shift), 12u - static_cast<uint32_t>(shift), 8u, 0u}) {
      output.position_stride_bytes = stride;
      EXPECT_EQ(dcloth_cloth_skin(disturbed.get(), &pose, 1, &output, nullptr), DCLOTH_ERROR_ARGUMENT) << stride;
    }
    pose.joint_matrices = shifted(shift);
    EXPECT_EQ(dcloth_cloth_tick(disturbed.get(), &pose, stages, nullptr), DCLOTH_ERROR_ARGUMENT);
  }
  EXPECT_TRUE(std::equal(matrices.begin(), matrices.end(), buffer.begin())) << "a refused call wrote";
  for (OwnedCloth* cloth : {&disturbed, &twin}) {
    ASSERT_EQ(cloth->Tick(matrices, stages), DCLOTH_OK);
    ASSERT_EQ(cloth->Skin(matrices, 1), DCLOTH_OK);
  }
  EXPECT_EQ(disturbed.positions(), twin.positions());
}

INSTANTIATE_TEST_SUITE_P(Every, MemoryTest, ::testing::ValuesIn(Variants()),
                         [](const auto& test) { return test.param.name; });

}  // namespace
}  // namespace dcloth::testing

// The verification ladder rung by rung: each named corruption of a sound file is refused, and the text names
// field and reason.
#include <gtest/gtest.h>

#include <cstdio>
#include <iostream>
#include <set>
#include <string>

#include "tests/attack/corruption.h"
#include "tests/attack/open_and_run.h"
#include "tests/attack/variants.h"

namespace dcloth::testing {
namespace {

std::vector<Corruption> All() {
  std::vector<Corruption> all;
  for (const auto& rung : {StructureCorruptions(), GarmentCorruptions(), TensorCorruptions(), StageCorruptions(),
                           BodyCorruptions(), PatchCorruptions()})
    all.insert(all.end(), rung.begin(), rung.end());
  return all;
}

dcloth_status Open(const void* bytes, size_t size, dcloth_error* error = nullptr) {
  AlignedBytes storage(dcloth_model_storage_size());
  dcloth_model* model = nullptr;
  const dcloth_status status = dcloth_model_open(bytes, size, storage.data(), storage.size(), &model, error);
  EXPECT_EQ(model == nullptr, status != DCLOTH_OK);
  return status;
}

class LadderTest : public ::testing::TestWithParam<Corruption> {};

TEST_P(LadderTest, RefusesNamingFieldAndReason) {
  const Corruption& fault = GetParam();
  const AlignedBytes sound = SoundTwin(fault);
  const Outcome before = OpenAndRun(sound.data(), sound.size());
  ASSERT_EQ(before.status, DCLOTH_OK) << before.text;
  ASSERT_EQ(before.broken_promise, "");

  const AlignedBytes spoilt = Corrupted(fault);
  const Outcome outcome = OpenAndRun(spoilt.data(), spoilt.size());
  EXPECT_EQ(outcome.broken_promise, "");
  EXPECT_EQ(outcome.status, fault.status) << outcome.text;
  EXPECT_EQ(outcome.text.compare(0, std::strlen(fault.field), fault.field), 0)
      << "'" << outcome.text << "' does not begin with '" << fault.field << "'";
  EXPECT_NE(outcome.text.find(fault.reason), std::string::npos)
      << "'" << outcome.text << "' does not say '" << fault.reason << "'";
  EXPECT_LT(outcome.text.size(), sizeof(dcloth_error::text) - 1) << "cut off: " << outcome.text;
  const size_t allowed = outcome.text.find("; allowed: ");
  ASSERT_NE(allowed, std::string::npos);
  EXPECT_NE(outcome.text.find("; ", allowed + 2), std::string::npos) << "says no way out: " << outcome.text;

  unsigned row = 0;
  const bool of_body = std::sscanf(outcome.text.c_str(), "body.row_starts[%u]", &row) == 1;
  if (of_body || std::sscanf(outcome.text.c_str(), "mesh_stage.row_starts[%u]", &row) == 1) {
    const format::Model& file = *format::GetModel(spoilt.data());
    const format::Tensor& tensor = *(of_body ? file.body()->row_starts() : file.mesh_stage()->row_starts());
    const auto* starts = file.weights()->Data() + tensor.offset();
    dcloth_error error = {};
    error.struct_size = sizeof(error);
    EXPECT_EQ(Open(spoilt.data(), spoilt.size(), &error), fault.status);
    EXPECT_EQ(error.offset_bytes, static_cast<uint64_t>(starts - spoilt.data()) + 4 * row);
  }

  // The same verdict when nobody listens, and for a host of an older header.
  EXPECT_EQ(Open(spoilt.data(), spoilt.size()), fault.status);
  dcloth_error older = {};
  older.struct_size = 8;
  EXPECT_EQ(Open(spoilt.data(), spoilt.size(), &older), fault.status);
  EXPECT_EQ(older.status, DCLOTH_OK) << "a smaller error struct is not written to";
}

INSTANTIATE_TEST_SUITE_P(Named, LadderTest, ::testing::ValuesIn(All()),
                         [](const auto& test) { return test.param.name; });

TEST(Ladder, HasManyRungsAndEachNameOnce) {
  std::set<std::string> names;
  for (const Corruption& corruption : All()) EXPECT_TRUE(names.insert(corruption.name).second) << corruption.name;
  EXPECT_GE(names.size(), 120u);
  std::cout << "named corruptions: " << names.size() << "\n";
}

// The first rung: what the bytes are, before what they say.
TEST(Ladder, BytesOffTheirBoundaryAreRefused) {
  const AlignedBytes whole = BuildModel({}).Bytes();
  AlignedBytes room(whole.size() + 64);
  for (size_t shift = 1; shift < 64; ++shift) {
    std::memcpy(room.data() + shift, whole.data(), whole.size());
    dcloth_error error = {};
    error.struct_size = sizeof(error);
    ASSERT_EQ(Open(room.data() + shift, whole.size(), &error), DCLOTH_ERROR_ALIGNMENT) << shift;
    ASSERT_NE(std::string(error.text)
                  .find("found model bytes that are not aligned to 64 bytes; allowed: an address divisible"),
              std::string::npos)
        << error.text;
  }
}

// Where a child is broken, the error points at the field that leads to it.
TEST(Ladder, ABrokenChildIsFound) {
  for (const auto field : {format::Model::VT_GARMENT, format::Model::VT_CHARACTER, format::Model::VT_FEATURES}) {
    AlignedBytes file = BuildModel({}).Bytes();
    const auto* root = reinterpret_cast<const flatbuffers::Table*>(format::GetModel(file.data()));
    const uint8_t* place = root->GetAddressOf(static_cast<flatbuffers::voffset_t>(field));
    ASSERT_NE(place, nullptr) << field;
    const auto offset = static_cast<size_t>(place - file.data());
    const uint32_t past_the_end = 0x7FFFFFF0;
    std::memcpy(file.data() + offset, &past_the_end, sizeof(past_the_end));
    dcloth_error error = {};
    error.struct_size = sizeof(error);
    ASSERT_EQ(Open(file.data(), file.size(), &error), DCLOTH_ERROR_FORMAT) << field;
    EXPECT_EQ(error.offset_bytes, offset) << error.text;
  }
}

// A table that claims its field just behind the last byte.
TEST(Ladder, AFieldBehindTheFileIsPlacedAtItsTable) {
  AlignedBytes file = BuildModel(Variants().front().spec).Bytes();  // less than vtables reach
  auto* root = reinterpret_cast<uint8_t*>(const_cast<format::Model*>(format::GetModel(file.data())));
  int32_t back;
  std::memcpy(&back, root, sizeof(back));
  const auto to_the_end = static_cast<size_t>(file.data() + file.size() - root);
  ASSERT_LT(to_the_end, 65536u);
  const auto entry = static_cast<uint16_t>(to_the_end);
  std::memcpy(root - back + format::Model::VT_GARMENT, &entry, sizeof(entry));
  dcloth_error error = {};
  error.struct_size = sizeof(error);
  ASSERT_EQ(Open(file.data(), file.size(), &error), DCLOTH_ERROR_FORMAT);
  EXPECT_EQ(std::string(error.text).find("garment: "), 0u) << error.text;
  EXPECT_EQ(error.offset_bytes, static_cast<uint64_t>(root - file.data()));
}

// Sizes that no file has are refused before a byte is read: there are none behind this one line.
TEST(Ladder, ImpossibleSizesAreRefused) {
  const AlignedBytes line(64);
  for (const size_t size :
       {size_t{0}, size_t{1}, size_t{63}, size_t{0x7FFFFFFF}, size_t{0x80000000}, SIZE_MAX - 63, SIZE_MAX}) {
    dcloth_error error = {};
    error.struct_size = sizeof(error);
    ASSERT_EQ(Open(line.data(), size, &error), DCLOTH_ERROR_FORMAT) << size;
    ASSERT_EQ(std::string(error.text)
                  .find("found " + std::to_string(size) + " bytes; allowed: a multiple of 64, from 64 to 2147483646"),
              0u)
        << error.text;
  }
  dcloth_error error = {};
  error.struct_size = sizeof(error);
  EXPECT_EQ(Open(line.data(), 64, &error), DCLOTH_ERROR_FORMAT);  // a size that files may have
  EXPECT_EQ(std::string(error.text).find("found a different file identifier"), 0u) << error.text;
  EXPECT_EQ(Open(nullptr, 4096, &error), DCLOTH_ERROR_ARGUMENT);
  EXPECT_EQ(std::string(error.text).find("found a null pointer; allowed: a pointer to the bytes of a model"), 0u);
}

}  // namespace
}  // namespace dcloth::testing

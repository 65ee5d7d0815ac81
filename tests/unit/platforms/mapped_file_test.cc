// A model file used where the system has mapped it: the same garment as from memory, and what cannot be mapped.
#include "platforms/mapped_file/mapped_file.h"

#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>
#include <fstream>

#include "tests/unit/engine/cloth_fixture.h"

namespace dcloth::platforms {
namespace {

namespace fs = std::filesystem;
using dcloth::testing::BuildModel;
using dcloth::testing::OwnedCloth;
using dcloth::testing::PoseAt;

class MappedFileTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* const info = ::testing::UnitTest::GetInstance()->current_test_info();
    folder_ = fs::path(::testing::TempDir()) / ("dcloth_mapped_file_" + std::string(info->name()));
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  fs::path Put(const char* name, const void* bytes, size_t size) const {
    const fs::path path = folder_ / name;
    std::ofstream(path, std::ios::binary).write(static_cast<const char*>(bytes), static_cast<std::streamsize>(size));
    return path;
  }
  fs::path Put(const char* name, const std::string& text) const { return Put(name, text.data(), text.size()); }
  static std::string Text(const MappedFile& file) { return {static_cast<const char*>(file.data()), file.size()}; }

  fs::path folder_;
};

TEST_F(MappedFileTest, ModelOpensInPlaceAndMovesAsFromMemory) {
  const dcloth::testing::TestModel model = BuildModel({});
  const AlignedBytes bytes = model.Bytes();
  const fs::path path = Put("tube.dcloth", bytes.data(), bytes.size());
  MappedFile file;
  const std::error_code failed = file.Map(path);
  ASSERT_FALSE(failed) << failed.message();
  ASSERT_EQ(file.size(), bytes.size());
  EXPECT_EQ(std::memcmp(file.data(), bytes.data(), bytes.size()), 0);
  EXPECT_EQ(reinterpret_cast<uintptr_t>(file.data()) % DCLOTH_ALIGNMENT, 0u);

  AlignedBytes view(dcloth_model_storage_size());
  dcloth_model* mapped = nullptr;
  dcloth_error error = dcloth::testing::EmptyError();
  ASSERT_EQ(dcloth_model_open(file.data(), file.size(), view.data(), view.size(), &mapped, &error), DCLOTH_OK)
      << error.text;
  AlignedBytes memory(dcloth_cloth_storage_size(mapped));
  dcloth_cloth* cloth = nullptr;
  ASSERT_EQ(dcloth_cloth_create(mapped, memory.data(), memory.size(), &cloth, &error), DCLOTH_OK) << error.text;
  const dcloth::testing::OpenedModel opened(model);
  OwnedCloth expected(opened);
  std::vector<float> positions(expected.positions().size()), normals(positions.size());
  for (int tick = 0; tick < 10; ++tick) {
    const std::vector<float> matrices = PoseAt(model.numbers, tick / 30.0);
    const dcloth_pose pose = OwnedCloth::Pose(matrices);
    const dcloth_output output =
        MakeOutput(positions.data(), normals.data(), static_cast<uint32_t>(positions.size() / 3));
    ASSERT_EQ(dcloth_cloth_tick(cloth, &pose, DCLOTH_STAGES_MESH, nullptr), DCLOTH_OK);
    ASSERT_EQ(dcloth_cloth_skin(cloth, &pose, 1, &output, nullptr), DCLOTH_OK);
    ASSERT_EQ(expected.Tick(matrices, DCLOTH_STAGES_MESH), DCLOTH_OK);
    ASSERT_EQ(expected.Skin(matrices, 1), DCLOTH_OK);
    ASSERT_EQ(positions, expected.positions()) << tick;
    ASSERT_EQ(normals, expected.normals()) << tick;
  }
}

TEST_F(MappedFileTest, KeepsWhatItHoldsWhenAnotherFails) {
  const fs::path path = Put("a", "held");
  MappedFile file;
  ASSERT_FALSE(file.Map(path));
  EXPECT_EQ(file.Map(folder_ / "nothing"), std::errc::no_such_file_or_directory);
  EXPECT_EQ(file.Map(folder_), std::errc::is_a_directory);
  EXPECT_EQ(Text(file), "held");
  ASSERT_FALSE(file.Map(Put("b", "other")));
  EXPECT_EQ(Text(file), "other");
}

TEST_F(MappedFileTest, EmptyFileHasNoBytes) {
  MappedFile file;
  ASSERT_FALSE(file.Map(Put("held", "x")));
  ASSERT_FALSE(file.Map(Put("empty", "")));
  EXPECT_EQ(file.data(), nullptr);
  EXPECT_EQ(file.size(), 0u);
}

TEST_F(MappedFileTest, MovesWithItsBytes) {
  MappedFile first;
  ASSERT_FALSE(first.Map(Put("a", "moved")));
  MappedFile second = std::move(first);
  EXPECT_EQ(Text(second), "moved");
  EXPECT_EQ(first.data(), nullptr);
  ASSERT_FALSE(first.Map(Put("b", "again")));
  second = std::move(first);
  EXPECT_EQ(Text(second), "again");
}

#if !defined(_WIN32)
// Windows refuses to replace or remove a file while it is mapped.
TEST_F(MappedFileTest, OutlivesAReplacedName) {
  const fs::path path = Put("a", "old");
  MappedFile file;
  ASSERT_FALSE(file.Map(path));
  fs::rename(Put("b", "new"), path);
  EXPECT_EQ(Text(file), "old");
}

TEST_F(MappedFileTest, RefusesDevices) {
  MappedFile file;
  EXPECT_EQ(file.Map("/dev/zero"), std::errc::invalid_argument);
}
#endif

}  // namespace
}  // namespace dcloth::platforms

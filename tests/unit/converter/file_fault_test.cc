// A system that interrupts, writes in pieces or fails: this program's own write, fsync and close stand before it.
#include <gtest/gtest.h>

#if defined(__linux__)
#include <fcntl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "converter/file.h"
#include "tests/unit/converter/converter_testing.h"

namespace {

struct Faults {
  int interrupts = 0;            // so many writes are interrupted first
  size_t most_bytes = SIZE_MAX;  // of one write
  bool flush_fails = false, close_fails = false;
  std::vector<int> flushed, closed;
};
Faults faults;

}  // namespace

extern "C" ssize_t write(int file, const void* bytes, size_t size) {
  if (faults.interrupts > 0) {
    --faults.interrupts;
    errno = EINTR;
    return -1;
  }
  return syscall(SYS_write, file, bytes, std::min(size, faults.most_bytes));
}
extern "C" int fsync(int file) {
  faults.flushed.push_back(file);
  if (!faults.flush_fails) return static_cast<int>(syscall(SYS_fsync, file));
  errno = EIO;
  return -1;
}
extern "C" int close(int file) {
  faults.closed.push_back(file);
  const int result = static_cast<int>(syscall(SYS_close, file));
  if (!faults.close_fails) return result;
  errno = EIO;
  return -1;
}

namespace dcloth::converter {
namespace {

namespace fs = std::filesystem;

class FileFaultTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* const info = ::testing::UnitTest::GetInstance()->current_test_info();
    folder_ = fs::path(::testing::TempDir()) / ("dcloth_file_fault_test_" + std::string(info->name()));
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    std::ofstream(path(), std::ios::binary) << "old";
    faults = {};
  }
  void TearDown() override {
    faults = {};
    fs::remove_all(folder_);
  }

  fs::path path() const { return folder_ / "x"; }
  std::string Written() const {
    const AlignedBytes bytes = ReadFile(path());
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
  }
  std::string Write(const std::string& text) const {
    return ErrorText([&] { WriteFileAtomically(path(), std::as_bytes(std::span(text))); });
  }
  size_t Entries() const {
    return static_cast<size_t>(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()));
  }
  void ExpectUntouched() {
    EXPECT_EQ(Written(), "old");
    EXPECT_EQ(Entries(), 1u);
  }

  fs::path folder_;
};

TEST_F(FileFaultTest, InterruptedAndShortWritesGoOn) {
  faults.interrupts = 2;
  faults.most_bytes = 3;
  EXPECT_EQ(Write("ten bytes."), "");
  EXPECT_EQ(Written(), "ten bytes.");
  EXPECT_EQ(Entries(), 1u);
}

// After an interruption too, whose errno stays.
TEST_F(FileFaultTest, AWriteOfNothingIsAFailure) {
  faults.interrupts = 1;
  faults.most_bytes = 0;
  EXPECT_TRUE(Mentions(Write("new"), "a failed write"));
  ExpectUntouched();
}

TEST_F(FileFaultTest, AFailedFlushOrCloseLeavesTheOldFile) {
  faults.flush_fails = true;
  EXPECT_TRUE(Mentions(Write("new"), "a failed flush: Input/output error"));
  EXPECT_EQ(faults.flushed.size(), 1u);
  EXPECT_EQ(faults.closed, faults.flushed);
  ExpectUntouched();
  faults = {};
  faults.close_fails = true;
  EXPECT_TRUE(Mentions(Write("new"), "a failed close: Input/output error"));
  EXPECT_EQ(faults.closed.size(), 1u) << "closed again it may be another's";
  ExpectUntouched();
}

// The file, then the directory that has its new name.
TEST_F(FileFaultTest, FileAndDirectoryAreFlushedAndClosed) {
  EXPECT_EQ(Write("new"), "");
  EXPECT_EQ(faults.flushed.size(), 2u);
  EXPECT_EQ(faults.closed, faults.flushed);
}

// Where standard input is closed, files get its number, at the second name as at the first.
TEST_F(FileFaultTest, NumberZeroIsAFile) {
  const std::string pid = std::to_string(getpid());
  std::ofstream(folder_ / ("x." + pid + ".0.tmp")) << "theirs";
  faults = {};
  const int input = dup(0);
  syscall(SYS_close, 0);
  EXPECT_EQ(Write("new"), "");
  EXPECT_EQ(faults.flushed, (std::vector{0, 0}));
  EXPECT_EQ(faults.closed, (std::vector{0, 0}));
  EXPECT_EQ(Written(), "new");
  faults = {};
  faults.flush_fails = true;
  EXPECT_TRUE(Mentions(Write("newer"), "a failed flush"));
  EXPECT_EQ(faults.closed, std::vector{0});
  EXPECT_EQ(Written(), "new");
  EXPECT_EQ(Entries(), 2u);
  if (input >= 0) {
    dup2(input, 0);
    syscall(SYS_close, input);
  }
}

TEST_F(FileFaultTest, AFailedReplacementLeavesNoTemporary) {
  const std::string text = "new";
  PreparedFile file(folder_ / "y", std::as_bytes(std::span(text)));
  EXPECT_EQ(Entries(), 2u);
  fs::create_directory(folder_ / "y");
  EXPECT_TRUE(Mentions(ErrorText([&] { file.Replace(); }), "y: found a file that cannot be replaced: Is a directory"));
  { const PreparedFile gone = std::move(file); }
  EXPECT_TRUE(fs::is_directory(folder_ / "y"));
  EXPECT_EQ(Entries(), 2u);
}

}  // namespace
}  // namespace dcloth::converter
#endif

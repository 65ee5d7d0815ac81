#include "converter/file.h"

#include <gtest/gtest.h>

#if defined(_WIN32)
#include <process.h>
#else
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>
#endif

#include <csignal>
#include <fstream>
#include <string>

#include "tests/unit/converter/converter_testing.h"

namespace dcloth::converter {
namespace {

#if defined(_WIN32)
int ProcessId() { return _getpid(); }
#else
int ProcessId() { return ::getpid(); }
#endif

namespace fs = std::filesystem;

class FileTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* const info = ::testing::UnitTest::GetInstance()->current_test_info();
    folder_ = fs::path(::testing::TempDir()) / ("dcloth_file_test_" + std::string(info->name()));
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  static void Put(const fs::path& path, const std::string& text) { std::ofstream(path, std::ios::binary) << text; }
  static std::string Get(const fs::path& path) {
    const AlignedBytes bytes = ReadFile(path);
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
  }
  static void Write(const fs::path& path, const std::string& text) {
    WriteFileAtomically(path, std::as_bytes(std::span(text)));
  }
  size_t Entries() const {
    return static_cast<size_t>(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()));
  }

  fs::path folder_;
};

TEST_F(FileTest, WritesPiecesAndReadsThemBackAligned) {
  const std::string a = "first ", b, c = "third";
  const std::span<const std::byte> pieces[] = {std::as_bytes(std::span(a)), std::as_bytes(std::span(b)),
                                               std::as_bytes(std::span(c))};
  WriteFileAtomically(folder_ / "x", pieces);
  EXPECT_EQ(Get(folder_ / "x"), "first third");
  EXPECT_EQ(reinterpret_cast<uintptr_t>(ReadFile(folder_ / "x").data()) % 64, 0u);
  EXPECT_EQ(Entries(), 1u);
}

TEST_F(FileTest, ReplacesAndKeepsTheMode) {
  Put(folder_ / "x", "old and longer");
  fs::permissions(folder_ / "x", fs::perms::owner_read | fs::perms::owner_write);
  const fs::perms mode = fs::status(folder_ / "x").permissions();
#if !defined(_WIN32)  // which tells readers and writers not apart
  EXPECT_EQ(mode, fs::perms::owner_read | fs::perms::owner_write);
#endif
  Write(folder_ / "x", "new");
  EXPECT_EQ(Get(folder_ / "x"), "new");
  EXPECT_EQ(fs::status(folder_ / "x").permissions(), mode);
  EXPECT_EQ(Entries(), 1u);
}

TEST_F(FileTest, ReadOnlyTargetStaysAsItIs) {
  Put(folder_ / "x", "precious");
  fs::permissions(folder_ / "x", fs::perms::owner_read);
  EXPECT_TRUE(Mentions(ErrorText([&] { Write(folder_ / "x", "new"); }), "without write permission"));
  EXPECT_EQ(Get(folder_ / "x"), "precious");
  EXPECT_EQ(Entries(), 1u);
  fs::permissions(folder_ / "x", fs::perms::owner_all);  // Windows removes no file that cannot be written
}

TEST_F(FileTest, MissingFolderIsNamed) {
  const std::string text = ErrorText([&] { Write(folder_ / "no" / "x", "new"); });
  EXPECT_TRUE(Mentions(text, (folder_ / "no" / "x").string()));
  EXPECT_TRUE(Mentions(text, "No such file"));
  EXPECT_EQ(Entries(), 0u);
}

TEST_F(FileTest, FoldersAndDevicesAreRefused) {
  EXPECT_TRUE(Mentions(ErrorText([&] { Write(folder_, "new"); }), "a directory"));
  EXPECT_TRUE(Mentions(ErrorText([&] { ReadFile(folder_); }), "a directory"));
#if !defined(_WIN32)
  EXPECT_TRUE(Mentions(ErrorText([&] { ReadFile("/dev/zero"); }), "a device"));
  // A pipe of the test's own: what a fault replaces is gone, and an administrator may replace /dev/null.
  ASSERT_EQ(mkfifo((folder_ / "pipe").c_str(), 0600), 0);
  EXPECT_TRUE(Mentions(ErrorText([&] { Write(folder_ / "pipe", "new"); }), "a device, pipe or socket"));
  EXPECT_TRUE(fs::is_fifo(folder_ / "pipe"));
#endif
}

#if !defined(_WIN32)
TEST_F(FileTest, FollowsALinkAndRefusesADanglingOne) {
  Put(folder_ / "x", "old");
  fs::create_symlink("x", folder_ / "link");
  Write(folder_ / "link", "new");
  EXPECT_TRUE(fs::is_symlink(folder_ / "link"));
  EXPECT_EQ(Get(folder_ / "x"), "new");
  fs::create_symlink("nothing", folder_ / "dangling");
  EXPECT_TRUE(
      Mentions(ErrorText([&] { Write(folder_ / "dangling", "new"); }), "symbolic link to a file that does not exist"));
}

TEST_F(FileTest, FailedWriteLeavesNothingBehind) {
  Put(folder_ / "x", "old");
  // A file size limit fails the write half way, as a full disk does.
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  const rlimit small = {1000, before.rlim_max};
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &small), 0);
  const std::string text = ErrorText([&] { Write(folder_ / "x", std::string(5000, 'n')); });
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &before), 0);
  std::signal(SIGXFSZ, handler);
  EXPECT_TRUE(Mentions(text, "a failed write: File too large"));
  EXPECT_EQ(Get(folder_ / "x"), "old");
  EXPECT_EQ(Entries(), 1u);
}

TEST_F(FileTest, NamesThatLeaveNoRoom) {
  const std::string longest(255, 'n');
  Write(folder_ / longest, "1");
  Write(folder_ / longest, "2");
  EXPECT_EQ(Get(folder_ / longest), "2");
  EXPECT_EQ(Entries(), 1u);
  EXPECT_TRUE(Mentions(ErrorText([&] { Write(folder_ / (longest + "n"), "new"); }), "too long"));
  EXPECT_EQ(Entries(), 1u);
}

TEST_F(FileTest, NamesNeedNotBeUtf8) {
  const fs::path path = folder_ / "r\xE9sum\xE9";
  Write(path, "latin-1");
  EXPECT_EQ(Get(path), "latin-1");
  EXPECT_TRUE(Mentions(ErrorText([&] { ReadFile(folder_ / "\xE9"); }), "/?: found no such file"));
}
#endif

TEST_F(FileTest, TemporariesOfOthersSurvive) {
  // A crashed run of this very process id leaves such a file.
  Write(folder_ / "x", "1");
  for (int attempt = 0; attempt < 3; ++attempt) {
    Put(folder_ / ("x." + std::to_string(ProcessId()) + "." + std::to_string(attempt) + ".tmp"), "theirs");
  }
  Write(folder_ / "x", "2");
  EXPECT_EQ(Get(folder_ / "x"), "2");
  EXPECT_EQ(Entries(), 4u);
}

// A hundred names are tried, from 0 on.
TEST_F(FileTest, TemporariesHaveAHundredNames) {
  const auto put = [&](int attempt) {
    Put(folder_ / ("x." + std::to_string(ProcessId()) + "." + std::to_string(attempt) + ".tmp"), "theirs");
  };
  for (int attempt = 1; attempt < 100; ++attempt) put(attempt);
  Write(folder_ / "x", "1");
  put(0);
  EXPECT_TRUE(Mentions(ErrorText([&] { Write(folder_ / "x", "2"); }), "where no file can be created", "exists"));
  EXPECT_EQ(Get(folder_ / "x"), "1");
  EXPECT_EQ(Entries(), 101u);
}

// It is named after its file where the name is at most 100 bytes.
TEST_F(FileTest, TemporariesAreNamedAfterTheirFile) {
  for (const size_t length : {100u, 101u}) {
    const std::string name(length, 'n'), text = "new";
    const PreparedFile file(folder_ / name, std::as_bytes(std::span(text)));
    const std::string suffix = "." + std::to_string(ProcessId()) + ".0.tmp";
    EXPECT_EQ(fs::directory_iterator(folder_)->path().filename(), (length == 100 ? name : "dcloth") + suffix);
  }
  EXPECT_EQ(Entries(), 0u);
}

TEST_F(FileTest, LimitAndAbsence) {
  Put(folder_ / "x", "12345");
  EXPECT_EQ(ReadFile(folder_ / "x", 5).size(), 5u);
  EXPECT_TRUE(Mentions(ErrorText([&] { ReadFile(folder_ / "x", 4); }), "found 5 bytes, expected at most 4"));
  EXPECT_TRUE(Mentions(ErrorText([&] { ReadFile(folder_ / "y"); }), "no such file"));
  Put(folder_ / "empty", "");
  EXPECT_TRUE(ReadFile(folder_ / "empty").empty());
}

}  // namespace
}  // namespace dcloth::converter

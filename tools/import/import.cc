#include "tools/import/import.h"

#include <cstdio>
#include <string>

#include "converter/error.h"

#if defined(__unix__) || defined(__APPLE__)
#include <sys/resource.h>
#include <sys/types.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <system_error>
#endif

namespace dcloth::tools {

void AddSpaceOptions(CLI::App* command, SpaceOptions* options) {
  command->add_option(
      "--unit", options->unit,
      "the file's unit: m, cm, mm, in, ft, or metres per unit. Default: what the file says; metres if it says\n"
      "nothing (BVH)");
  command
      ->add_option(
          "--up", options->up,
          "the file's up axis. Default: what the file says; y if it says nothing (BVH). z means Blender's axes: the\n"
          "character faces -Y")
      ->transform(CLI::IsMember({"y", "z"}, CLI::ignore_case));
}

#if defined(__unix__) || defined(__APPLE__)
namespace {

constexpr rlim_t kMaxBytes = rlim_t{16} << 30;
constexpr rlim_t kMaxSeconds = 300;  // of processor time

// Never above what the user allows.
void Limit(int what, rlim_t value) {
  rlimit limit;
  if (getrlimit(what, &limit) != 0) return;
  if (limit.rlim_cur != RLIM_INFINITY && value > limit.rlim_cur) return;
  limit.rlim_cur = value;
  setrlimit(what, &limit);
}

}  // namespace

std::optional<int> InChild(const std::filesystem::path& input) {
  std::fflush(nullptr);
  const pid_t child = fork();
  if (child < 0) {
    throw converter::Error({.path = input,
                            .tensor = {},
                            .found = "no second process: " + std::generic_category().message(errno),
                            .expected = "a process of its own to read the file in, so that a damaged file does no harm",
                            .mend = "free memory or processes, or raise their limits (ulimit -u, -v)"});
  }
  if (child == 0) {
    Limit(RLIMIT_CORE, 0);
    Limit(RLIMIT_AS, kMaxBytes);
    Limit(RLIMIT_CPU, kMaxSeconds);
    return std::nullopt;
  }
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  if (WIFEXITED(status)) return WEXITSTATUS(status);
  const int signal = WIFSIGNALED(status) ? WTERMSIG(status) : 0;
  throw converter::Error(
      {.path = input,
       .tensor = {},
       .found = signal == SIGXCPU ? "a file that could not be read within " + std::to_string(kMaxSeconds) + " s"
                                  : "a file on which the reader crashed (signal " + std::to_string(signal) + ")",
       .expected = "an intact glTF, FBX or BVH file",
       .mend = "the file is damaged or too large; export it again with nothing but the skeleton and its animation"});
}

#else

std::optional<int> InChild(const std::filesystem::path&) { return std::nullopt; }

#endif

}  // namespace dcloth::tools

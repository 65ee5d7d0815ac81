#include "tools/progress.h"

#include <cstdio>
#include <utility>

#if defined(_WIN32)
#include <io.h>
#else
#include <unistd.h>
#endif

namespace dcloth::tools {
namespace {

bool OnTerminal() {
#if defined(_WIN32)
  static const bool terminal = _isatty(_fileno(stderr)) != 0;
#else
  static const bool terminal = isatty(fileno(stderr)) != 0;
#endif
  return terminal;
}

}  // namespace

Progress::Progress(std::string what) : what_(std::move(what)) {}

Progress::~Progress() {
  if (shown_) std::fprintf(stderr, "\r\033[K");
}

void Progress::Step(size_t done, size_t total) {
  if (!OnTerminal() || total == 0) return;
  const size_t percent = done * 100 / total;
  if (percent == last_percent_) return;
  last_percent_ = percent;
  shown_ = true;
  std::fprintf(stderr, "\r\033[K%s  %zu %%", what_.c_str(), percent);
  std::fflush(stderr);
}

}  // namespace dcloth::tools

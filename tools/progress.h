// One line that says how far long work is: on a terminal only, gone when done.
#ifndef DCLOTH_TOOLS_PROGRESS_H_
#define DCLOTH_TOOLS_PROGRESS_H_

#include <cstddef>
#include <string>

namespace dcloth::tools {

class Progress {
 public:
  explicit Progress(std::string what);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  void Step(size_t done, size_t total);  // prints at most once per percent

 private:
  std::string what_;
  bool shown_ = false;
  size_t last_percent_ = static_cast<size_t>(-1);
};

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_PROGRESS_H_

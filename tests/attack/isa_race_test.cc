// A host chooses the instruction set while another of its threads asks for the first time which one there is: the
// choice stays. Each attempt in a process of its own, since a process asks its CPU once.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <cstring>
#include <thread>

#include "dcloth/dcloth.h"

namespace dcloth::testing {
namespace {

constexpr int kAttempts = 1000;  // six of them lost the choice where the first asking stored without looking

int ChooseWhileAsked() {
  std::atomic<int> ready{0};
  const auto together = [&ready] {
    ++ready;
    while (ready < 2) std::this_thread::yield();
  };
  std::thread asking([&] {
    together();
    dcloth_isa_name();
  });
  together();
  const dcloth_status status = dcloth_isa_select("scalar");
  asking.join();
  return status == DCLOTH_OK && std::strcmp(dcloth_isa_name(), "scalar") == 0 ? 0 : 1;
}

TEST(IsaRaceTest, AChoiceIsNotLostToTheFirstQuestion) {
  int lost = 0;
  for (int i = 0; i < kAttempts; ++i) {
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) _exit(ChooseWhileAsked());
    int status = 0;
    ASSERT_EQ(waitpid(child, &status, 0), child);
    ASSERT_TRUE(WIFEXITED(status));
    lost += WEXITSTATUS(status);
  }
  EXPECT_EQ(lost, 0) << "of " << kAttempts;
}

}  // namespace
}  // namespace dcloth::testing

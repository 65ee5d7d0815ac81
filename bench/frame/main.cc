#include <cstdio>
#include <exception>

#include "bench/frame/run.h"

int main(int argc, char** argv) {
  try {
    return dcloth::tools::Run(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  }
}

// What each bench of this folder defines; main.cc calls it and prints what it throws.
#ifndef DCLOTH_BENCH_FRAME_RUN_H_
#define DCLOTH_BENCH_FRAME_RUN_H_

namespace dcloth::tools {

int Run(int argc, char** argv);  // the exit status

}  // namespace dcloth::tools

#endif  // DCLOTH_BENCH_FRAME_RUN_H_

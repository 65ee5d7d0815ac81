// One function per command: adds it to the parser; when chosen, it runs and sets the exit code.
// 0 good, 1 a threshold missed, 2 bad usage or input. Errors are thrown; main prints them.
#ifndef DCLOTH_TOOLS_COMMANDS_H_
#define DCLOTH_TOOLS_COMMANDS_H_

#include "tools/cli.h"

namespace dcloth::tools {

constexpr int kExitGood = 0;
constexpr int kExitThresholdMissed = 1;
constexpr int kExitBadInput = 2;

void AddConvert(CLI::App& app, int& exit_code);
void AddInspect(CLI::App& app, int& exit_code);
void AddRun(CLI::App& app, int& exit_code);
void AddProfile(CLI::App& app, int& exit_code);
void AddEvaluate(CLI::App& app, int& exit_code);
void AddDress(CLI::App& app, int& exit_code);
void AddPoses(CLI::App& app, int& exit_code);
void AddBody(CLI::App& app, int& exit_code);
void AddHero(CLI::App& app, int& exit_code);

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_COMMANDS_H_

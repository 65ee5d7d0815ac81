// dcloth: convert, inspect, run, profile and evaluate learned cloth; import what it is learned from and played on.
#include <cstdio>
#include <exception>
#include <iostream>
#include <new>
#include <string>
#include <vector>

#include "converter/error.h"
#include "dcloth/dcloth.h"
#include "tools/arguments.h"
#include "tools/commands.h"

namespace {

using namespace dcloth::tools;

int Fail(const char* text, int code) {
  std::fprintf(stderr, "dcloth: error: %s\n", text);
  return code;
}

int Run(int argc, char** argv) {
  int exit_code = kExitGood;
  try {
    CLI::App app{
        "dcloth: learned cloth inside a game's frame budget.\n"
        "Exit codes: 0 good, 1 a threshold missed, 2 bad usage or input. --json prints one JSON object on stdout."};
    app.name("dcloth");
    app.allow_windows_style_options(false);  // "/clips/walk" is a file on every system
    app.set_version_flag("--version", dcloth_version());
    app.require_subcommand(1);
    AddConvert(app, exit_code);
    AddInspect(app, exit_code);
    AddRun(app, exit_code);
    AddProfile(app, exit_code);
    AddEvaluate(app, exit_code);
    AddDress(app, exit_code);
    AddPoses(app, exit_code);
    AddBody(app, exit_code);
    AddHero(app, exit_code);
    const std::vector<std::string> arguments = Utf8Arguments(argc, argv);
    try {
      app.parse(std::vector<std::string>(arguments.rbegin(), arguments.rend()));  // wants the last one first
    } catch (const CLI::RequiredError& error) {
      // The parser asks for a command before it looks at a misspelt one.
      if (!arguments.empty() && app.get_subcommands().empty()) {
        const std::string text = "no command '" + arguments.front() +
                                 "'; there are convert, inspect, run, profile, evaluate, dress, poses, body, hero";
        return Fail(text.c_str(), kExitBadInput);
      }
      app.exit(error);
      return kExitBadInput;
    } catch (const CLI::ParseError& error) {
      return app.exit(error) == 0 ? kExitGood : kExitBadInput;
    }
  } catch (const dcloth::converter::ThresholdError& error) {
    return Fail(error.what(), kExitThresholdMissed);
  } catch (const std::bad_alloc&) {
    return Fail("not enough memory; use shorter sequences or fewer precisions at a time", kExitBadInput);
  } catch (const std::exception& error) {
    return Fail(error.what(), kExitBadInput);
  }
  return exit_code;
}

}  // namespace

int main(int argc, char** argv) {
  const int exit_code = Run(argc, argv);
  std::cout.flush();  // where the parser writes its help
  if (exit_code != kExitBadInput && (std::fflush(stdout) != 0 || std::ferror(stdout) != 0 || !std::cout)) {
    return Fail("stdout cannot be written; check that the reader is alive and the disk not full", kExitBadInput);
  }
  return exit_code;
}

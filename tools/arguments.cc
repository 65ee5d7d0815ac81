#include "tools/arguments.h"

#if defined(_WIN32)
#ifndef NOMINMAX
#define NOMINMAX
#endif
#include <windows.h>
// Needs windows.h.
#include <shellapi.h>

#include <memory>
#include <stdexcept>
#include <utility>
#endif

namespace dcloth::tools {

#if defined(_WIN32)

std::vector<std::string> Utf8Arguments(int, char**) {
  int count = 0;
  const std::unique_ptr<wchar_t*, decltype(&LocalFree)> wide(CommandLineToArgvW(GetCommandLineW(), &count), &LocalFree);
  if (!wide) throw std::runtime_error("Windows did not return the command line (CommandLineToArgvW failed)");
  std::vector<std::string> arguments;
  for (int i = 1; i < count; ++i) {
    const wchar_t* const text = wide.get()[i];
    const int size = WideCharToMultiByte(CP_UTF8, 0, text, -1, nullptr, 0, nullptr, nullptr);  // with the terminator
    std::string argument(static_cast<size_t>(size), '\0');
    WideCharToMultiByte(CP_UTF8, 0, text, -1, argument.data(), size, nullptr, nullptr);
    argument.pop_back();
    arguments.push_back(std::move(argument));
  }
  return arguments;
}

#else

std::vector<std::string> Utf8Arguments(int argc, char** argv) {
  std::vector<std::string> arguments;
  for (int i = 1; i < argc; ++i) arguments.emplace_back(argv[i]);
  return arguments;
}

#endif

}  // namespace dcloth::tools

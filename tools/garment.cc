#include "tools/garment.h"

#include <cstdio>
#include <filesystem>
#include <system_error>
#include <utility>
#include <vector>

#include "converter/bundle.h"
#include "converter/convert.h"
#include "converter/error.h"
#include "converter/file.h"
#include "converter/safetensors.h"

#if defined(_WIN32)
#include <windows.h>

#include <array>
#endif

namespace dcloth::tools {
namespace {

// Empty where the system does not say.
std::filesystem::path ProgramFolder() {
#if defined(_WIN32)
  std::array<wchar_t, 4096> name;
  const DWORD length = GetModuleFileNameW(nullptr, name.data(), static_cast<DWORD>(name.size()));
  return std::filesystem::path(name.data(), name.data() + (length < name.size() ? length : 0)).parent_path();
#else
  std::error_code failed;
  const std::filesystem::path program = std::filesystem::read_symlink("/proc/self/exe", failed);
  return failed ? std::filesystem::path() : program.parent_path();
#endif
}

converter::OpenModel Open(const std::filesystem::path& path) {
  converter::AlignedBytes bytes = converter::ReadFile(path);
  if (!converter::LooksLikeSafetensors(bytes)) return converter::OpenModel(std::move(bytes), path);
  std::fprintf(stderr, "converting %s to int8\n", converter::PathText(path).c_str());
  converter::ConvertOptions options;
  options.precision = converter::Precision::kInt8;
  return converter::OpenModel(converter::Convert(converter::ReadBundle(path), options).bytes, path);
}

}  // namespace

converter::OpenModel OpenGarment(const std::string& garment) {
  std::vector<std::filesystem::path> places = {garment};
  if (std::filesystem::path(garment).filename() == garment && !std::filesystem::path(garment).has_extension()) {
    const std::filesystem::path program = ProgramFolder(), file = garment + ".dcloth";
    if (!program.empty()) {
      places.push_back(program / file);
      places.push_back(program.parent_path() / "share" / "dcloth" / file);  // an archive
      places.push_back(program.parent_path() / "garments" / file);          // the Python package
    }
    const std::filesystem::path models = DCLOTH_SOURCE_MODELS;
    if (!models.empty()) places.push_back(models / garment / (garment + ".safetensors"));
  }
  std::string looked;
  std::error_code failed;
  for (const std::filesystem::path& place : places) {
    if (std::filesystem::is_regular_file(place, failed)) return Open(place);
    looked += (looked.empty() ? "" : ", ") + converter::PathText(place);
  }
  throw converter::Error({.path = garment,
                          .tensor = {},
                          .found = "no garment with this name; searched " + looked,
                          .expected = "a .dcloth model, a bundle, or the name of a garment that comes with dcloth",
                          .mend = "pass its file: --garment path/to/skirt.dcloth"});
}

}  // namespace dcloth::tools

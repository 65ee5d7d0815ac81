// `dcloth convert`: a training bundle becomes a model file.
#include "converter/convert.h"

#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "converter/error.h"
#include "converter/file.h"
#include "converter/stages.h"
#include "tools/commands.h"
#include "tools/convert_output.h"
#include "tools/progress.h"

namespace dcloth::tools {
namespace {

struct Options {
  std::filesystem::path bundle, model, report;
  std::string precision = "fp32";
  double max_error_mm = 0;
  bool bounded = false;
  std::vector<std::filesystem::path> motion, calibration;
  std::string rank, stages;
  bool json = false, verbose = false;
};

int RunConvert(const Options& options) {
  const auto usage = [](std::string found, const char* mend) {
    throw converter::Error({.path = {}, .tensor = {}, .found = std::move(found), .expected = {}, .mend = mend});
  };
  const bool calibrated = !options.calibration.empty(), measured = calibrated || !options.motion.empty();
  if (options.precision == "auto" && (!options.bounded || !measured)) {
    usage("--precision auto without an error bound or without motion to test it on",
          "add --max-error-mm E and --motion SEQ");
  }
  if (options.bounded && !measured) {
    usage("--max-error-mm without motion to measure it on", "add --motion SEQ, once or more");
  }
  for (const std::filesystem::path& motion : options.motion) {
    for (const std::filesystem::path& seen : options.calibration) {
      if (!IsSameFile(motion, seen)) continue;
      usage(converter::PathText(motion) + " both to calibrate on (--calibrate) and to measure on (--motion)",
            "measure on other motion, or the model is judged by what it was fitted to; --calibrate measures too");
    }
  }
  CommandFiles files;
  files.Reads("the bundle", options.bundle);
  files.Reads("a sequence of --motion", options.motion);
  files.Reads("a sequence of --calibrate", options.calibration);
  files.Writes("-o", options.model);
  files.Writes("--report", options.report);
  files.Check();
  const converter::Bundle bundle = converter::ReadBundle(options.bundle);
  std::vector<converter::Sequence> motion;
  for (const std::filesystem::path& path : options.motion) motion.push_back(converter::ReadSequence(path));
  std::vector<converter::Sequence> calibration;
  for (const std::filesystem::path& path : options.calibration) calibration.push_back(converter::ReadSequence(path));
  converter::ConvertOptions convert;
  convert.rank = ParseRank(options.rank, options.bounded, calibrated);
  if (!options.stages.empty()) convert.stages = converter::ParseStages(options.stages);
  convert.calibration = calibration;
  convert.precision = converter::ParsePrecision(options.precision);
  if (options.bounded) convert.max_error_mm = options.max_error_mm;
  convert.motion = motion;
  std::optional<Progress> choosing, progress(std::in_place, "measuring each tensor");
  convert.progress = [&](size_t done, size_t total) {
    choosing.reset();
    progress->Step(done, total);
  };
  convert.choosing = [&](size_t done, size_t total) {
    if (!choosing) choosing.emplace("choosing formats");
    choosing->Step(done, total);
  };
  const converter::ConvertResult result = converter::Convert(bundle, convert);
  choosing.reset();
  progress.reset();
  const Json report = ConvertJson(result.report, options.bundle, options.model);
  const std::string text = DumpJson(report) + "\n";
  std::vector<converter::PreparedFile> outputs;
  outputs.emplace_back(options.model, result.bytes);
  if (!options.report.empty()) outputs.emplace_back(options.report, std::as_bytes(std::span(text)));
  for (converter::PreparedFile& output : outputs) output.Replace();
  for (const std::string& warning : result.report.warnings) std::fprintf(stderr, "warning: %s\n", warning.c_str());
  if (options.json) {
    PrintJson(report);
  } else {
    PrintConvertTables(result.report, options.model, options.verbose);
  }
  return kExitGood;
}

}  // namespace

void AddConvert(CLI::App& app, int& exit_code) {
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand("convert", "Make a model file from a training bundle");
  command->add_option("BUNDLE", options->bundle, "a training bundle (.safetensors)")->required();
  command->add_option("-o,--output", options->model, "the model file to write (.dcloth)")->required();
  command
      ->add_option(
          "--precision", options->precision,
          "fp32, fp16, int8 or auto. auto chooses for each tensor the smallest format that keeps --max-error-mm on\n"
          "--calibrate (or --motion), then the fewest bones per vertex")
      ->check(CLI::IsMember({"fp32", "fp16", "int8", "auto"}))
      ->capture_default_str();
  CLI::Option* bound = command
                           ->add_option("--max-error-mm", options->max_error_mm,
                                        "largest allowed distance of any vertex from the fp32 model with all stages "
                                        "and the full basis, measured on\n"
                                        "--motion and --calibrate; exit 1 if it is exceeded")
                           ->check(NumberAboveZero());
  command
      ->add_option("--motion", options->motion,
                   "a sequence on which the model, and each tensor alone, is measured; may be repeated")
      ->allow_extra_args(false);
  command
      ->add_option("--calibrate", options->calibration,
                   "a sequence that a smaller basis is fitted to; it is measured too; may be repeated")
      ->allow_extra_args(false);
  command->add_option(
      "--rank", options->rank,
      "rows of the displacement basis: exact, full, a number, or auto (as few as keep --max-error-mm on\n"
      "--calibrate). Default: auto if both are given, else exact");
  command->add_option(
      "--stages", options->stages,
      "the last stage to store: static, skeleton or mesh. Default: all of the bundle. Errors are measured against\n"
      "all stages in any case");
  command->add_option("--report", options->report, "also write the figures as JSON to this file");
  command->add_flag("--json", options->json, "one JSON object on stdout");
  command->add_flag("--verbose", options->verbose,
                    "every tensor: range, bytes, what storing it lost and what it costs");
  command->callback([options, bound, &exit_code] {
    options->bounded = bound->count() > 0;
    exit_code = RunConvert(*options);
  });
}

}  // namespace dcloth::tools

// `dcloth convert`: a training bundle becomes a model file.
#include "converter/convert.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <system_error>
#include <vector>

#include "converter/error.h"
#include "converter/file.h"
#include "tools/commands.h"
#include "tools/json_output.h"
#include "tools/rank_output.h"

namespace dcloth::tools {
namespace {

struct Options {
  std::filesystem::path bundle, model;
  std::string precision = "fp32";
  double max_error_mm = 0;
  bool bounded = false;
  std::vector<std::filesystem::path> motion, calibration;
  std::string rank;
  bool json = false;
};

Json ReportJson(const converter::ConvertReport& report, const Options& options) {
  Json json = {{"bundle", converter::PathText(options.bundle)},
               {"model", converter::PathText(options.model)},
               {"precision", converter::PrecisionName(report.precision)},
               {"model_bytes", report.model_bytes},
               {"instance_bytes", report.instance_bytes},
               {"joint_count", report.joint_count},
               {"dropped_joints", report.dropped_joints},
               {"tensors", Json::array()},
               {"pruning", Json::object()},
               {"basis", RankJson(report.rank)},
               {"trials", Json::array()}};
  for (const converter::TensorReport& t : report.tensors) {
    json["tensors"].push_back({{"name", t.name},
                               {"dtype", t.dtype},
                               {"shape", t.shape},
                               {"size_bytes", t.size_bytes},
                               {"relative_rms", t.relative_rms},
                               {"relative_max", t.relative_max}});
  }
  const auto pruning = [](const converter::PruneReport& p) {
    Json out = {{"influences", p.influences},
                {"removed_mean", p.removed_mean},
                {"removed_worst", p.removed_worst},
                {"bound_worst_mm", p.bound_worst_mm}};
    out["mean_mm"] = p.measured ? Json(p.mean_mm) : Json(nullptr);
    out["worst_mm"] = p.measured ? Json(p.worst_mm) : Json(nullptr);
    return out;
  };
  json["pruning"]["cloth"] = pruning(report.influences);
  json["pruning"]["body_points"] = pruning(report.body_influences);
  for (const converter::Trial& t : report.trials) {
    json["trials"].push_back({{"precision", converter::PrecisionName(t.precision)},
                              {"model_bytes", t.model_bytes},
                              {"rank", t.rank},
                              {"error", ToJson(t.error)},
                              {"calibration", ToJson(t.calibration)}});
  }
  return json;
}

void PrintTable(const converter::ConvertReport& report, const Options& options) {
  size_t width = 6;
  for (const converter::TensorReport& t : report.tensors) width = std::max(width, t.name.size());
  std::printf("%-*s  %-5s  %-16s  %12s  %12s  %12s\n", static_cast<int>(width), "tensor", "dtype", "shape", "bytes",
              "error rms", "error max");
  for (const converter::TensorReport& t : report.tensors) {
    std::string shape;
    for (uint32_t s : t.shape) shape += (shape.empty() ? "" : " x ") + std::to_string(s);
    std::printf("%-*s  %-5s  %-16s  %12llu", static_cast<int>(width), t.name.c_str(), t.dtype.c_str(), shape.c_str(),
                static_cast<unsigned long long>(t.size_bytes));
    if (t.relative_max > 0) {
      std::printf("  %12.2e  %12.2e\n", t.relative_rms, t.relative_max);
    } else {
      std::printf("  %12s  %12s\n", "exact", "exact");
    }
  }
  std::printf("\n%s: %s, %.3f MB; %.1f KiB per instance; %u joints from the host, %u of the bundle not needed\n",
              converter::PathText(options.model).c_str(), converter::PrecisionName(report.precision),
              static_cast<double>(report.model_bytes) / 1e6, static_cast<double>(report.instance_bytes) / 1024,
              report.joint_count, report.dropped_joints);
  std::printf("influences cut to %u: %.2e of a vertex's weight on average, %.2e at worst\n",
              report.influences.influences, report.influences.removed_mean, report.influences.removed_worst);
  PrintRank(report.rank);
  for (const converter::Trial& t : report.trials) {
    std::printf("%s, %u rows, on the given motion, against fp32: mean %.4f, p99 %.4f, max %.4f mm\n",
                converter::PrecisionName(t.precision), t.rank, t.error.position_mm.mean, t.error.position_mm.p99,
                t.error.position_mm.max);
  }
}

int RunConvert(const Options& options) {
  const auto usage = [&](const char* found, const char* mend) {
    throw converter::Error({.path = {}, .tensor = {}, .found = found, .expected = {}, .mend = mend});
  };
  const bool calibrated = !options.calibration.empty(), measured = calibrated || !options.motion.empty();
  if (options.precision == "auto" && (!options.bounded || !measured)) {
    usage("--precision auto without a bound to keep and motion to test it on", "add --max-error-mm E and --motion SEQ");
  }
  if (options.bounded && !measured) {
    usage("--max-error-mm without motion to measure it on", "add --motion SEQ, once or more");
  }
  std::error_code ignored;
  if (std::filesystem::equivalent(options.bundle, options.model, ignored)) {
    usage("the output is the bundle itself", "give -o another name, MODEL.dcloth for instance");
  }
  const converter::Bundle bundle = converter::ReadBundle(options.bundle);
  std::vector<converter::Sequence> motion;
  for (const std::filesystem::path& path : options.motion) motion.push_back(converter::ReadSequence(path));
  std::vector<converter::Sequence> calibration;
  for (const std::filesystem::path& path : options.calibration) calibration.push_back(converter::ReadSequence(path));
  converter::ConvertOptions convert;
  convert.rank = ParseRank(options.rank, options.bounded, calibrated);
  convert.calibration = calibration;
  convert.precision = converter::ParsePrecision(options.precision);
  if (options.bounded) convert.max_error_mm = options.max_error_mm;
  convert.motion = motion;
  const converter::ConvertResult result = converter::Convert(bundle, convert);
  converter::WriteFileAtomically(options.model, result.bytes);
  if (options.json) {
    PrintJson(ReportJson(result.report, options));
  } else {
    PrintTable(result.report, options);
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
      ->add_option("--precision", options->precision, "fp32, fp16, int8, or auto: the smallest within --max-error-mm")
      ->check(CLI::IsMember({"fp32", "fp16", "int8", "auto"}))
      ->capture_default_str();
  CLI::Option* bound =
      command
          ->add_option("--max-error-mm", options->max_error_mm,
                       "largest allowed distance of any vertex to the fp32 model on --motion and --calibrate; exit 1 when missed")
          ->check(CLI::PositiveNumber);
  command->add_option("--motion", options->motion, "a sequence to measure on, and nothing else; may be repeated")
      ->allow_extra_args(false);
  command->add_option("--calibrate", options->calibration, "a sequence to fit a reduced basis to; may be repeated")
      ->allow_extra_args(false);
  command->add_option("--rank", options->rank,
                      "rows of the displacement basis: exact, full, auto (the fewest within --max-error-mm on "
                      "--calibrate) or a number; auto where both are given, else exact");
  command->add_flag("--json", options->json, "one JSON object on stdout");
  command->callback([options, bound, &exit_code] {
    options->bounded = bound->count() > 0;
    exit_code = RunConvert(*options);
  });
}

}  // namespace dcloth::tools

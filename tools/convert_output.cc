#include "tools/convert_output.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <string>

#include "converter/error.h"
#include "converter/stages.h"

namespace dcloth::tools {
namespace {

using converter::TensorReport;

Json TensorJson(const TensorReport& t) {
  Json json = {{"name", t.name},
               {"dtype", t.dtype},
               {"shape", t.shape},
               {"size_bytes", t.size_bytes},
               {"range", {t.loss.lowest, t.loss.highest}},
               {"clipped", t.loss.clipped},
               {"rounded_to_zero", t.loss.zeroed},
               {"relative_rms", t.loss.relative_rms},
               {"relative_max", t.loss.relative_max},
               {"snr_db", nullptr},
               {"worst_row", nullptr},
               {"cost_mm", nullptr}};
  if (std::isfinite(t.loss.snr_db)) json["snr_db"] = t.loss.snr_db;
  if (const auto& worst = t.loss.worst_row) {
    json["worst_row"] = {{"row", worst->row}, {"snr_db", worst->snr_db}, {"low_count", worst->low_count}};
  }
  if (t.cost) json["cost_mm"] = {{"mean", t.cost->mean_mm}, {"p99", t.cost->p99_mm}, {"max", t.cost->max_mm}};
  return json;
}

int NameWidth(const converter::ConvertReport& report) {
  size_t width = 6;
  for (const TensorReport& t : report.tensors) width = std::max(width, t.name.size());
  return static_cast<int>(width);
}

void PrintTensors(const converter::ConvertReport& report) {
  const int width = NameWidth(report);
  std::printf("%-*s  %-5s  %-13s  %10s  %22s  %8s  %8s  %7s  %9s\n", width, "tensor", "dtype", "shape", "bytes",
              "range", "clipped", "to zero", "SNR dB", "worst row");
  for (const TensorReport& t : report.tensors) {
    std::string shape;
    for (uint32_t s : t.shape) shape += (shape.empty() ? "" : " x ") + std::to_string(s);
    char range[48];
    std::snprintf(range, sizeof(range), "%.4g to %.4g", t.loss.lowest, t.loss.highest);
    std::printf("%-*s  %-5s  %-13s  %10llu  %22s", width, t.name.c_str(), t.dtype.c_str(), shape.c_str(),
                static_cast<unsigned long long>(t.size_bytes), range);
    if (std::isfinite(t.loss.snr_db)) {
      std::printf("  %8llu  %8llu  %7.1f", static_cast<unsigned long long>(t.loss.clipped),
                  static_cast<unsigned long long>(t.loss.zeroed), t.loss.snr_db);
      t.loss.worst_row ? std::printf("  %9.1f\n", t.loss.worst_row->snr_db) : std::printf("\n");
    } else {
      std::printf("  %8s  %8s  %7s\n", "", "", "exact");
    }
  }
}

void PrintRanking(const converter::ConvertReport& report) {
  const bool lossy = std::any_of(report.tensors.begin(), report.tensors.end(),
                                 [](const TensorReport& t) { return t.dtype == "f16" || t.dtype == "i8"; });
  if (!lossy) return;
  if (report.trials.empty()) {
    std::printf("what each tensor costs in millimetres was not measured: add --motion SEQ, once or more\n");
    return;
  }
  const int width = NameWidth(report);
  std::printf("\n%-*s  %-5s  %10s  %10s  %10s\n", width, "costliest tensors, each alone", "dtype", "mean mm", "p99 mm",
              "max mm");
  for (const TensorReport* t : converter::RankByCost(report.tensors)) {
    std::printf("%-*s  %-5s  %10.5f  %10.5f  %10.5f\n", width, t->name.c_str(), t->dtype.c_str(), t->cost->mean_mm,
                t->cost->p99_mm, t->cost->max_mm);
  }
}

const char* FormatName(converter::Precision format) { return converter::PrecisionName(format); }

// Of the motion that the choice did not see; null without calibration or without such motion.
Json CheckedMm(const converter::ConvertReport& report) {
  return report.automatic->checked ? Json(report.trials.back().error.position_mm.max) : Json(nullptr);
}

Json AutoJson(const converter::ConvertReport& report) {
  if (!report.automatic) return nullptr;
  const converter::AutoReport& chosen = *report.automatic;
  Json json = {{"bound_mm", chosen.bound_mm},
               {"chosen_on", chosen.calibrated ? "calibration" : "motion"},
               {"rank", chosen.rank},
               {"error_mm", chosen.error_mm},
               {"checked_mm", CheckedMm(report)},
               {"influences", chosen.influences},
               {"fewer_influences_mm", chosen.fewer_influences_mm ? Json(*chosen.fewer_influences_mm) : Json(nullptr)},
               {"measured_models", chosen.measured_models},
               {"tensors", Json::array()}};
  for (const converter::FormatDecision& d : chosen.decisions) {
    json["tensors"].push_back({{"name", d.tensor},
                               {"format", FormatName(d.format)},
                               {"cheaper", d.cheaper ? Json(FormatName(*d.cheaper)) : Json(nullptr)},
                               {"cheaper_mm", d.cheaper ? Json(d.cheaper_mm) : Json(nullptr)}});
  }
  return json;
}

void PrintAuto(const converter::ConvertReport& report) {
  if (!report.automatic) return;
  const converter::AutoReport& chosen = *report.automatic;
  std::printf("\nformats within %g mm, chosen on the %s (%zu models measured): %.4f mm at %u rows\n", chosen.bound_mm,
              chosen.calibrated ? "calibration motion" : "given motion", chosen.measured_models, chosen.error_mm,
              chosen.rank);
  const int width = NameWidth(report);
  for (const converter::FormatDecision& d : chosen.decisions) {
    std::printf("  %-*s  %s", width, d.tensor.c_str(), FormatName(d.format));
    if (d.cheaper) {
      std::printf(", as %s would make it %.4f mm\n", FormatName(*d.cheaper), d.cheaper_mm);
    } else {
      std::printf(", the cheapest there is\n");
    }
  }
  std::printf("  %-*s  %u bones", width, "influences of a vertex", chosen.influences);
  if (chosen.fewer_influences_mm) {
    std::printf(", one fewer would make it %.4f mm\n", *chosen.fewer_influences_mm);
  } else {
    std::printf(", the fewest there are\n");
  }
  const Json checked = CheckedMm(report);
  if (!checked.is_null()) {
    std::printf("checked on motion that the choice did not see: %.4f mm\n", checked.get<double>());
  } else {
    std::printf("not checked on other motion: give %s\n",
                chosen.calibrated ? "--motion SEQ too" : "--calibrate SEQ to choose on, and --motion SEQ to check on");
  }
}

}  // namespace

Json ConvertJson(const converter::ConvertReport& report, const std::filesystem::path& bundle,
                 const std::filesystem::path& model) {
  Json json = {{"bundle", converter::PathText(bundle)},
               {"model", converter::PathText(model)},
               {"precision", report.precision},
               {"stages", converter::StagesName(report.stages)},
               {"model_bytes", report.model_bytes},
               {"instance_bytes", report.instance_bytes},
               {"joint_count", report.joint_count},
               {"dropped_joints", report.dropped_joints},
               {"tensors", Json::array()},
               {"pruning", Json::object()},
               {"basis", RankJson(report.rank)},
               {"warnings", report.warnings},
               {"auto", AutoJson(report)},
               {"trials", Json::array()}};
  for (const converter::TensorReport& t : report.tensors) json["tensors"].push_back(TensorJson(t));
  // Costliest first; null where there was no motion to measure on.
  json["ranking"] = report.trials.empty() ? Json(nullptr) : Json::array();
  for (const converter::TensorReport* t : converter::RankByCost(report.tensors)) json["ranking"].push_back(t->name);
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
    json["trials"].push_back({{"precision", t.precision},
                              {"model_bytes", t.model_bytes},
                              {"rank", t.rank},
                              {"influences", t.influences},
                              {"error", ToJson(t.error)},
                              {"calibration", ToJson(t.calibration)}});
  }
  return json;
}

void PrintConvertTables(const converter::ConvertReport& report, const std::filesystem::path& model, bool verbose) {
  if (verbose) PrintTensors(report);
  std::printf(
      "%s%s: %s, stages up to %s, %.3f MB; %.1f KiB per instance; %u joints from the host, %u of the bundle not "
      "needed\n",
      verbose ? "\n" : "", converter::PathText(model).c_str(), report.precision.c_str(),
      converter::StagesName(report.stages), static_cast<double>(report.model_bytes) / 1e6,
      static_cast<double>(report.instance_bytes) / 1024, report.joint_count, report.dropped_joints);
  std::printf("influences cut to %u: %.2e of a vertex's weight on average, %.2e at worst\n",
              report.influences.influences, report.influences.removed_mean, report.influences.removed_worst);
  PrintRank(report.rank);
  for (const converter::Trial& t : report.trials) {
    if (report.automatic && &t != &report.trials.back()) continue;  // dozens; --json has them all
    std::printf("%s, %u rows, on the given motion, against fp32: mean %.4f, p99 %.4f, max %.4f mm\n",
                t.precision.c_str(), t.rank, t.error.position_mm.mean, t.error.position_mm.p99,
                t.error.position_mm.max);
  }
  if (verbose) {
    PrintAuto(report);
    PrintRanking(report);
  } else if (report.automatic) {
    std::printf("formats within %g mm: %.4f mm; --verbose shows the format of each tensor and why\n",
                report.automatic->bound_mm, report.automatic->error_mm);
  }
}

converter::RankRequest ParseRank(const std::string& text, bool bounded, bool calibrated) {
  using converter::RankMode;
  if (text == "auto") return {RankMode::kSearch};
  if (text == "exact") return {RankMode::kExact};
  if (text == "full") return {RankMode::kFull};
  if (text.empty()) return {bounded && calibrated ? RankMode::kSearch : RankMode::kExact};
  converter::RankRequest request{RankMode::kFixed};
  const char* const end = text.data() + text.size();
  const auto [stop, fault] = std::from_chars(text.data(), end, request.rank);
  if (fault != std::errc() || stop != end || request.rank < 1) {
    throw converter::Error({.path = {},
                            .tensor = {},
                            .found = "--rank " + text,
                            .expected = "exact, full, auto or a number of rows from 1",
                            .mend = ""});
  }
  return request;
}

Json RankJson(const converter::RankReport& rank) {
  if (rank.full == 0) return nullptr;
  return {{"full", rank.full}, {"exact", rank.exact}, {"rank", rank.rank}, {"reduced", rank.reduced}};
}

void PrintRank(const converter::RankReport& rank) {
  if (rank.full == 0) return;
  if (rank.reduced) {
    std::printf("displacement basis: %u of %u rows%s\n", rank.rank, rank.full,
                rank.rank >= rank.exact ? ", exact but for rounding" : ", fitted to the calibration motion");
  } else {
    std::printf("displacement basis: all %u rows\n", rank.full);
  }
}

}  // namespace dcloth::tools

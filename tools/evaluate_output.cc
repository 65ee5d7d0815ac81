#include "tools/evaluate_output.h"

#include <algorithm>
#include <cstdio>

#include "converter/error.h"
#include "tools/pareto.h"

namespace dcloth::tools {
namespace {

std::string Text(const char* format, double value) {
  char text[32];
  std::snprintf(text, sizeof(text), format, value);
  return text;
}

std::string Spread(double mean, double std) { return Text("%.3f", mean) + " +- " + Text("%.3f", std); }

std::vector<std::string> Row(const Variant& v) {
  const std::string none = "-";
  const auto times = [&](double Percentiles::*field, bool cold) {
    if (!v.times) return none;
    return Text("%.3f", (cold ? v.times->cold_ms : v.times->warm_ms).*field);
  };
  const bool truth = v.error.truth.frame_count > 0;
  const converter::PositionError& d = v.error.truth.position_mm;
  const converter::PositionError& f = v.error.fp32.position_mm;
  const std::string place = v.place == ParetoPlace::kNone ? none : v.dominated_by.empty() ? "front" : v.dominated_by;
  return {v.name,
          v.stages,
          v.rank ? std::to_string(v.rank) : none,
          v.model_bytes ? Text("%.3f", static_cast<double>(v.model_bytes) / 1e6) : none,
          v.instance_bytes ? Text("%.1f", static_cast<double>(v.instance_bytes) / 1024) : none,
          times(&Percentiles::p50, true),
          times(&Percentiles::p95, true),
          times(&Percentiles::p99, true),
          times(&Percentiles::max, true),
          times(&Percentiles::p50, false),
          truth ? Spread(d.mean, d.std) : none,
          truth ? Text("%.2f", d.p99) : none,
          truth ? Text("%.2f", d.max) : none,
          truth ? Spread(v.error.truth.normal_deg.mean, v.error.truth.normal_deg.std) : none,
          Text("%.4f", f.mean),
          Text("%.4f", f.p99),
          Text("%.4f", f.max),
          place};
}

}  // namespace

Json VariantsJson(std::span<const Variant> variants) {
  Json rows = Json::array();
  for (const Variant& v : variants) {
    Json row = {{"name", v.name}, {"stages", v.stages}};
    row["precision"] = v.precision.empty() ? Json(nullptr) : Json(v.precision);
    row["rank"] = v.rank ? Json(v.rank) : Json(nullptr);
    row["model_bytes"] = v.model_bytes ? Json(v.model_bytes) : Json(nullptr);
    row["instance_bytes"] = v.instance_bytes ? Json(v.instance_bytes) : Json(nullptr);
    row["tick_ms"] = v.times ? ToJson(v.times->cold_ms) : Json(nullptr);
    row["tick_warm_ms"] = v.times ? ToJson(v.times->warm_ms) : Json(nullptr);
    row["stages_ms"] = nullptr;
    if (v.times) {
      row["stages_ms"] = Json::object();
      for (size_t s = 0; s < kStepNames.size(); ++s) row["stages_ms"][kStepNames[s]] = ToJson(v.times->stages_ms[s]);
      row["tick_count"] = {{"cold", v.times->cold_count}, {"warm", v.times->warm_count}};
    }
    row["truth"] = ToJson(v.error.truth);
    row["fp32"] = ToJson(v.error.fp32);
    row["dominated"] = v.place == ParetoPlace::kNone ? Json(nullptr) : Json(v.place == ParetoPlace::kDominated);
    row["dominated_by"] = v.dominated_by.empty() ? Json(nullptr) : Json(v.dominated_by);
    rows.push_back(std::move(row));
  }
  return rows;
}

Json ParetoJson(std::span<const Variant> variants) {
  std::vector<const Variant*> front;
  bool truth = false;
  for (const Variant& v : variants) {
    truth = truth || v.error.truth.frame_count > 0;
    if (v.place == ParetoPlace::kFront) front.push_back(&v);
  }
  std::sort(front.begin(), front.end(),
            [](const Variant* a, const Variant* b) { return a->times->cold_ms.p50 < b->times->cold_ms.p50; });
  Json names = Json::array();
  for (const Variant* v : front) names.push_back(v->name);
  return {{"ms", "tick_ms.p50"},
          {"mm", truth ? "truth.position_mm.mean" : "fp32.position_mm.mean"},
          {"step_mm", kParetoStepMm},
          {"front", names}};
}

Json SequencesJson(std::span<const Variant> variants, std::span<const converter::Sequence> sequences,
                   const converter::Bundle& bundle) {
  Json rows = Json::array();
  for (size_t s = 0; s < sequences.size(); ++s) {
    Json row = {{"name", converter::PathText(sequences[s].path.stem())},
                {"path", converter::PathText(sequences[s].path)},
                {"ticks", TickCount(bundle, sequences[s])},
                {"variants", Json::array()}};
    for (const Variant& v : variants) {
      row["variants"].push_back(
          {{"name", v.name}, {"truth", ToJson(v.sequences[s].truth)}, {"fp32", ToJson(v.sequences[s].fp32)}});
    }
    rows.push_back(std::move(row));
  }
  return rows;
}

void PrintVariants(std::span<const Variant> variants, std::FILE* out) {
  std::vector<std::vector<std::string>> rows = {
      {"", "", "", "model", "instance", "tick ms", "cold", "", "", "warm", "E_d mm", "", "", "E_n deg", "to fp32", "mm",
       "", "dominated"},
      {"variant", "stages", "rank", "MB", "KiB", "p50", "p95", "p99", "max", "p50", "mean +- std", "p99", "max",
       "mean +- std", "mean", "p99", "max", "by"}};
  for (const Variant& v : variants) rows.push_back(Row(v));
  std::vector<size_t> widths(rows[0].size(), 0);
  for (const auto& row : rows) {
    for (size_t c = 0; c < row.size(); ++c) widths[c] = std::max(widths[c], row[c].size());
  }
  for (const auto& row : rows) {
    std::string line;
    for (size_t c = 0; c < row.size(); ++c) {
      const std::string pad(widths[c] - row[c].size(), ' ');
      if (c > 0) line += "  ";
      line += c < 2 ? row[c] + pad : pad + row[c];
    }
    std::fprintf(out, "%s\n", line.c_str());
  }
}

}  // namespace dcloth::tools

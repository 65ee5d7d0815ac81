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

std::string Percent(double value) { return Text("%.1f %%", 100 * value); }

// Over the sequences that `error` is of.
std::vector<std::string> Row(const Variant& v, const ErrorPair& error) {
  const std::string none = "-";
  const auto times = [&](double Percentiles::*field, bool cold) {
    if (!v.times) return none;
    return Text("%.3f", (cold ? v.times->cold_ms : v.times->warm_ms).*field);
  };
  const bool truth = error.truth.frame_count > 0, moves = truth && error.motion.alive_mm > 0;
  const converter::PositionError& d = error.truth.position_mm;
  const converter::PositionError& f = v.error.fp32.position_mm;
  const converter::ClipError& m = error.motion;
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
          moves ? Percent(d.mean / m.alive_mm) : none,
          moves ? Percent(m.motion_error_mm / m.alive_mm) : none,
          truth ? Spread(error.truth.normal_deg.mean, error.truth.normal_deg.std) : none,
          Text("%.4f", f.mean),
          Text("%.4f", f.p99),
          Text("%.4f", f.max),
          place};
}

Json Quotient(double over, double under) { return under > 0 ? Json(over / under) : Json(nullptr); }

// What the truth says of a variant; null without truth.
Json TruthJson(const ErrorPair& error) {
  Json out = ToJson(error.truth);
  if (out.is_null()) return out;
  const converter::ClipError& m = error.motion;
  const double alive = m.alive_mm;
  out["clips"] = m.clip_count;
  out["alive_mm"] = alive;
  out["predicted_alive_mm"] = m.predicted_alive_mm;
  out["relative_error"] = Quotient(error.truth.position_mm.mean, alive);
  out["offset_mm"] = m.offset_mm;
  out["motion_error_mm"] = m.motion_error_mm;
  out["relative_motion_error"] = Quotient(m.motion_error_mm, alive);
  const char* const names[] = {"coarse", "middle", "fine"};
  for (size_t b = 0; b < m.bands.size(); ++b) {
    out["bands"][names[b]] = {{"error_mm", m.bands[b].error_mm},
                              {"energy_ratio", Quotient(m.bands[b].rms_mm, m.bands[b].truth_rms_mm)}};
  }
  out["fine_motion_mm"] = m.fine_motion_mm;
  out["strain_p99"] = m.strain_p99;
  out["jitter"] = {{"ratio", Quotient(m.jitter_rms_mm, m.jitter_truth_rms_mm)},
                   {"held_mm", m.held_mm ? Json(*m.held_mm) : Json(nullptr)}};
  out["calm_mm"] = m.calm_mm ? Json(*m.calm_mm) : Json(nullptr);
  return out;
}

void PrintRows(const std::vector<std::vector<std::string>>& rows, std::FILE* out) {
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
    row["truth"] = TruthJson(v.error);
    row["recorded"] = TruthJson(v.recorded);
    row["scripted"] = TruthJson(v.scripted);
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
                {"clip", sequences[s].clip},
                {"source", sequences[s].scripted() ? "scripted" : "recorded"},
                {"ticks", TickCount(bundle, sequences[s])},
                {"variants", Json::array()}};
    for (const Variant& v : variants) {
      row["variants"].push_back(
          {{"name", v.name}, {"truth", TruthJson(v.sequences[s])}, {"fp32", ToJson(v.sequences[s].fp32)}});
    }
    rows.push_back(std::move(row));
  }
  return rows;
}

void PrintVariants(std::span<const Variant> variants, std::FILE* out) {
  struct Table {
    const char* source;
    ErrorPair Variant::*error;
  };
  bool printed = false;
  for (const Table& table : {Table{"recorded", &Variant::recorded}, Table{"scripted", &Variant::scripted},
                             Table{nullptr, &Variant::error}}) {
    const converter::ClipError& motion = (variants[0].*table.error).motion;
    if (table.source != nullptr ? motion.clip_count == 0 : printed) continue;
    if (table.source != nullptr) {
      std::fprintf(out, "%s%zu %s clip%s; the truth moves by %.1f mm, its fine motion is %.1f mm\n",
                   printed ? "\n" : "", motion.clip_count, table.source, motion.clip_count == 1 ? "" : "s",
                   motion.alive_mm, motion.fine_motion_mm);
    }
    std::vector<std::vector<std::string>> rows = {
        {"",       "", "", "model",     "instance", "tick ms", "cold",    "",   "", "warm",
         "E_d mm", "", "", "of motion", "motion E", "E_n deg", "to fp32", "mm", "", "dominated"},
        {"variant",     "stages", "rank", "MB", "KiB",       "p50",         "p95",  "p99", "max", "p50",
         "mean +- std", "p99",    "max",  "",   "of motion", "mean +- std", "mean", "p99", "max", "by"}};
    for (const Variant& v : variants) rows.push_back(Row(v, v.*table.error));
    PrintRows(rows, out);
    printed = true;
  }
}

}  // namespace dcloth::tools

// The tests' own main: every figure in one table on stdout and one JSON file.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <vector>

#include "converter/error.h"
#include "converter/file.h"
#include "dcloth/dcloth.h"
#include "tests/stability/stability_case.h"
#include "tests/stability/statistics.h"

namespace dcloth::stability {
namespace {

using Json = nlohmann::ordered_json;

std::vector<Json>& Rows() {
  static std::vector<Json> rows;
  return rows;
}

// JSON has no infinity: a figure that is none becomes null.
Json Number(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

std::string Text(const Json& number) {
  if (number.is_null()) return "not finite";
  char text[32];
  std::snprintf(text, sizeof(text), "%.4g", number.get<double>());
  return text;
}

// Prints the table and writes the JSON to the file that the environment variable DCLOTH_STABILITY_JSON names, where it
// is set. False where the file cannot be written.
bool WriteRecords() {
  std::printf("\n%-8s %-5s %-34s %-42s %12s %-8s %-17s %s\n", "garment", "", "case", "figure", "", "unit", "bound",
              "tick p50 / p99 ms");
  Json garments = Json::object();
  for (const Json& row : Rows()) {
    const std::string bound =
        row["bound"].is_null() ? "" : row["allowed"].get<std::string>() + " " + Text(row["bound"]);
    std::printf("%-8s %-5s %-34s %-42s %12s %-8s %-17s %s / %s%s\n", row["garment"].get<std::string>().c_str(),
                row["precision"].get<std::string>().c_str(), row["case"].get<std::string>().c_str(),
                row["figure"].get<std::string>().c_str(), Text(row["value"]).c_str(),
                row["unit"].get<std::string>().c_str(), bound.c_str(), Text(row["tick_ms"]["p50"]).c_str(),
                Text(row["tick_ms"]["p99"]).c_str(), row["met"].get<bool>() ? "" : "  MISSED");
    const std::string name = row["garment"];
    const Garment& garment = LoadGarment(name);
    garments[name] = {{"vertices", garment.vertex_count()}, {"size_m", garment.size_m}, {"clips", Json::array()}};
    for (const Clip& clip : garment.clips) {
      garments[name]["clips"].push_back({{"name", clip.name}, {"frames", clip.motion.size()}});
    }
  }
  const char* const path = std::getenv("DCLOTH_STABILITY_JSON");
  if (path == nullptr) return true;
  const Json report = {
      {"version", dcloth_version()}, {"isa", dcloth_isa_name()}, {"garments", garments}, {"rows", Rows()}};
  try {
    const std::string text = report.dump(1) + "\n";
    converter::WriteFileAtomically(path, std::as_bytes(std::span(text)));
  } catch (const converter::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return false;
  }
  return true;
}

}  // namespace

void Record(const Garment& garment, Precision precision, const std::string& test, std::span<const double> tick_ms,
            const Figure& figure) {
  const bool met = figure.allowed == Allowed::kAnything ||
                   (figure.allowed == Allowed::kAtMost ? figure.value <= figure.bound : figure.value >= figure.bound);
  Json row = {{"garment", garment.name},
              {"case", test},
              {"precision", converter::PrecisionName(precision)},
              {"figure", figure.name},
              {"value", Number(figure.value)},
              {"unit", figure.unit},
              {"allowed", nullptr},
              {"bound", nullptr},
              {"met", met},
              {"ticks", tick_ms.size()},
              {"tick_ms", {{"p50", nullptr}, {"p99", nullptr}}}};
  if (figure.allowed != Allowed::kAnything) {
    row["allowed"] = figure.allowed == Allowed::kAtMost ? "at most" : "at least";
    row["bound"] = figure.bound;
  }
  const std::vector<double> times(tick_ms.begin(), tick_ms.end());
  if (!times.empty()) row["tick_ms"] = {{"p50", Quantile(times, 0.5)}, {"p99", Quantile(times, 0.99)}};
  Rows().push_back(row);
  EXPECT_TRUE(met) << garment.name << " " << converter::PrecisionName(precision) << ", " << test << ": " << figure.name
                   << " " << figure.value << " " << figure.unit << ", allowed "
                   << (figure.allowed == Allowed::kAtMost ? "at most " : "at least ") << figure.bound;
}

}  // namespace dcloth::stability

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  const int failed = RUN_ALL_TESTS();
  return dcloth::stability::WriteRecords() ? failed : 1;
}

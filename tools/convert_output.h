// What `dcloth convert` says: one JSON object, or tables for people.
#ifndef DCLOTH_TOOLS_CONVERT_OUTPUT_H_
#define DCLOTH_TOOLS_CONVERT_OUTPUT_H_

#include <filesystem>
#include <string>

#include "converter/convert.h"
#include "tools/json_output.h"

namespace dcloth::tools {

// Figures that do not exist are null: snr_db of a tensor that is stored exactly, cost_mm where nothing was
// measured.
Json ConvertJson(const converter::ConvertReport& report, const std::filesystem::path& bundle,
                 const std::filesystem::path& model);

// Every tensor with what storing it lost, the model's figures, and the tensors ranked by millimetres.
void PrintConvertTables(const converter::ConvertReport& report, const std::filesystem::path& model, bool verbose);

// "exact", "full", "auto" or a number from 1. Empty is auto with a bound and calibration motion, exact without. Throws
// converter::Error for anything else.
converter::RankRequest ParseRank(const std::string& text, bool bounded, bool calibrated);

// {full, exact, rank, reduced}; null without a skeleton stage.
Json RankJson(const converter::RankReport& rank);

// One line; nothing without a skeleton stage.
void PrintRank(const converter::RankReport& rank);

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_CONVERT_OUTPUT_H_

// What `dcloth convert` says: one JSON object, or tables for people.
#ifndef DCLOTH_TOOLS_CONVERT_OUTPUT_H_
#define DCLOTH_TOOLS_CONVERT_OUTPUT_H_

#include <filesystem>

#include "converter/convert.h"
#include "tools/json_output.h"

namespace dcloth::tools {

// Figures that do not exist are null: snr_db of a tensor that is stored exactly, cost_mm where nothing was
// measured.
Json ConvertJson(const converter::ConvertReport& report, const std::filesystem::path& bundle,
                 const std::filesystem::path& model);

// Every tensor with what storing it lost, the model's figures, and the tensors ranked by millimetres.
void PrintConvertTables(const converter::ConvertReport& report, const std::filesystem::path& model, bool verbose);

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_CONVERT_OUTPUT_H_

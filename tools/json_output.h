// The pieces that the commands' JSON objects share. Field names are the stable contract.
#ifndef DCLOTH_TOOLS_JSON_OUTPUT_H_
#define DCLOTH_TOOLS_JSON_OUTPUT_H_

#include <nlohmann/json.hpp>
#include <string>

#include "converter/metrics.h"
#include "tools/timing.h"

namespace dcloth::tools {

using Json = nlohmann::ordered_json;

Json ToJson(const Percentiles& percentiles);             // ms
Json ToJson(const converter::MeshError& error);          // position_mm, normal_deg; null without frames
std::string DumpJson(const Json& json, int indent = 2);  // text that is not UTF-8 gets replacement characters
void PrintJson(const Json& json);                        // stdout

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_JSON_OUTPUT_H_

#include "tools/json_output.h"

#include <cstdio>

namespace dcloth::tools {

Json ToJson(const Percentiles& percentiles) {
  return {{"p50", percentiles.p50}, {"p95", percentiles.p95}, {"p99", percentiles.p99}, {"max", percentiles.max}};
}

Json ToJson(const converter::MeshError& error) {
  if (error.frame_count == 0) return nullptr;
  const converter::PositionError& p = error.position_mm;
  const converter::NormalError& n = error.normal_deg;
  return {{"frames", error.frame_count},
          {"position_mm",
           {{"mean", p.mean}, {"std", p.std}, {"p50", p.p50}, {"p95", p.p95}, {"p99", p.p99}, {"max", p.max}}},
          {"normal_deg", {{"mean", n.mean}, {"std", n.std}}}};
}

std::string DumpJson(const Json& json, int indent) {
  return json.dump(indent, ' ', false, Json::error_handler_t::replace);
}

void PrintJson(const Json& json) {
  const std::string text = DumpJson(json) + "\n";
  std::fwrite(text.data(), 1, text.size(), stdout);  // main tells whether it arrived
}

}  // namespace dcloth::tools

// The rank of the displacement basis on the command line: how it is asked for, and what is said of it.
#ifndef DCLOTH_TOOLS_RANK_OUTPUT_H_
#define DCLOTH_TOOLS_RANK_OUTPUT_H_

#include <string>

#include "converter/convert.h"
#include "tools/json_output.h"

namespace dcloth::tools {

// "exact", "full", "auto" or a number from 1. Empty is auto with a bound and calibration motion, exact without. Throws
// converter::Error for anything else.
converter::RankRequest ParseRank(const std::string& text, bool bounded, bool calibrated);

// {full, exact, rank, reduced}; null without a skeleton stage.
Json RankJson(const converter::RankReport& rank);

// One line; nothing without a skeleton stage.
void PrintRank(const converter::RankReport& rank);

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_RANK_OUTPUT_H_

#include "tools/rank_output.h"

#include <charconv>
#include <cstdio>

#include "converter/error.h"

namespace dcloth::tools {

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

// evaluate's two faces: the JSON of the contract and a table for people.
#ifndef DCLOTH_TOOLS_EVALUATE_OUTPUT_H_
#define DCLOTH_TOOLS_EVALUATE_OUTPUT_H_

#include <cstdio>
#include <span>
#include <string>
#include <vector>

#include "tools/evaluation.h"
#include "tools/json_output.h"

namespace dcloth::tools {

Json VariantsJson(std::span<const Variant> variants);
// {ms, mm, step_mm, front}: what was compared, and the names of those that nothing dominates, fastest first.
Json ParetoJson(std::span<const Variant> variants);
Json SequencesJson(std::span<const Variant> variants, std::span<const converter::Sequence> sequences,
                   const converter::Bundle& bundle);
void PrintVariants(std::span<const Variant> variants, std::FILE* out);

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_EVALUATE_OUTPUT_H_

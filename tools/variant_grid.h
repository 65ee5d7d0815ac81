// Which variants of a bundle `dcloth evaluate` measures, and their models.
#ifndef DCLOTH_TOOLS_VARIANT_GRID_H_
#define DCLOTH_TOOLS_VARIANT_GRID_H_

#include <cstdint>
#include <deque>
#include <span>
#include <string>
#include <vector>

#include "converter/bundle.h"
#include "converter/model_maker.h"
#include "converter/rollout.h"
#include "tools/evaluation.h"

namespace dcloth::tools {

struct Job {
  std::string name;  // "int8", "int8/skeleton", "int8@64", "int8@64/skeleton", "int8/outside"
  converter::Precision precision;
  uint32_t rank;  // rows of the displacement basis that these stages read; 0 for the static stage alone
  uint32_t stages;
  const converter::OpenModel* model;
  bool shown;  // in the report's 3D view; the grid's further variants are figures only
  uint32_t output_flags = 0;
};

class VariantGrid {
 public:
  // Always: the last precision stopped after each earlier stage, each precision with all stages, the last one kept
  // outside the body where the model holds one. With options.pareto also what is missing of precision x rank x stages;
  // the static stage has no rank.
  VariantGrid(const converter::Bundle& bundle, converter::ModelMaker* maker, const EvaluationOptions& options);

  std::span<const Job> jobs() const { return jobs_; }

 private:
  struct Made {
    converter::Precision precision;
    uint32_t asked, rows;  // rank as RankMaker takes it; rows when all stages run
    converter::OpenModel model;
  };

  const Made& Make(converter::Precision precision, uint32_t rank);
  void Add(const Made& made, uint32_t stages, bool shown);
  void AddGrid(const EvaluationOptions& options);

  const converter::Bundle& bundle_;
  converter::ModelMaker* maker_;
  std::deque<Made> models_;  // a job points to its own
  std::vector<Job> jobs_;
};

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_VARIANT_GRID_H_

// Measures a bundle on sequences: every precision and stage through the engine, against truth and the float32 engine.
#ifndef DCLOTH_TOOLS_EVALUATION_H_
#define DCLOTH_TOOLS_EVALUATION_H_

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "converter/bundle.h"
#include "converter/metrics.h"
#include "converter/precision.h"
#include "converter/sequence.h"
#include "tools/timing.h"

namespace dcloth::tools {

struct ErrorPair {
  converter::MeshError truth;  // no frames where the sequences have no truth
  converter::MeshError fp32;   // difference to the float32 engine with all stages
};

struct TickTimes {
  size_t cold_count = 0, warm_count = 0;
  Percentiles cold_ms, warm_ms;                          // tick and skin with normals, all on one thread
  std::array<Percentiles, DCLOTH_STEP_COUNT> stages_ms;  // cold
};

struct Variant {
  std::string name;                              // "int8", "int8/skeleton", "int8/outside", "skinning"
  std::string stages;                            // "static", "skeleton", "mesh"; "none" for plain skinning
  uint64_t model_bytes = 0, instance_bytes = 0;  // 0 for plain skinning
  std::optional<TickTimes> times;                // none for plain skinning: it is here for its error
  ErrorPair error;
  std::vector<ErrorPair> sequences;  // in the order given
};

struct EvaluationOptions {
  std::vector<converter::Precision> precisions;
  size_t cold_ticks = 200;  // per variant, over all sequences; at least 10 a sequence
};

// One sequence at the tick rate, as played.
struct Played {
  const std::string& variant;
  size_t sequence;
  std::span<const float> positions;  // [ticks, n, 3]
};
using PlayedVisitor = std::function<void(const Played&)>;

// Every (fps / tick rate)-th frame is a tick. Throws converter::Error where the ratio is no whole number, or the truth
// has another vertex count than the bundle.
size_t FramesPerTick(const converter::Bundle& bundle, const converter::Sequence& sequence);
size_t TickCount(const converter::Bundle& bundle, const converter::Sequence& sequence);

// Variants: plain skinning; the last precision stopped after each earlier stage; each precision with all stages; the
// last one kept outside the body, where the model holds one.
std::vector<Variant> Evaluate(const converter::Bundle& bundle, std::span<const converter::Sequence> sequences,
                              const EvaluationOptions& options, const PlayedVisitor& visit);

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_EVALUATION_H_

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
#include "converter/clip_metrics.h"
#include "converter/metrics.h"
#include "converter/precision.h"
#include "converter/sequence.h"
#include "tools/timing.h"

namespace dcloth::tools {

struct ErrorPair {
  // No frames where the sequences have no truth. The first kWarmUpFrames of a clip do not count; of several clips,
  // means weigh every clip the same.
  converter::MeshError truth;
  converter::ClipError motion;  // against the truth too
  converter::MeshError fp32;    // difference to the float32 engine with all stages

  // What variants are compared by: the truth where there is one.
  const converter::MeshError& compared() const { return truth.frame_count > 0 ? truth : fp32; }
};

struct TickTimes {
  size_t cold_count = 0, warm_count = 0;
  Percentiles cold_ms, warm_ms;                          // tick and skin with normals, all on one thread
  std::array<Percentiles, DCLOTH_STEP_COUNT> stages_ms;  // cold
};

enum class ParetoPlace : uint8_t { kNone, kFront, kDominated };

struct Variant {
  std::string name;       // "int8", "int8@64", "int8/skeleton", "int8/outside", "rigid", "skinning"; 64 is a rank
  std::string precision;  // empty for the baselines, rigid hips and plain skinning
  uint32_t rank = 0;      // rows of the displacement basis that the stages read
  std::string stages;     // "static", "skeleton", "mesh"; "none" for the baselines
  uint64_t model_bytes = 0, instance_bytes = 0;  // 0 for the baselines
  std::optional<TickTimes> times;                // none for the baselines: they are here for their error
  ErrorPair error;
  ErrorPair recorded, scripted;            // of those sequences alone; fp32 is not measured apart
  std::vector<ErrorPair> sequences;        // in the order given
  ParetoPlace place = ParetoPlace::kNone;  // cold p50 against error.compared(): see pareto.h
  std::string dominated_by;                // a variant's name
};

struct EvaluationOptions {
  std::vector<converter::Precision> precisions;
  size_t cold_ticks = 200;      // per variant, over all sequences; at least 10 a sequence
  bool pareto = false;          // every precision x rank x stages
  std::vector<uint32_t> ranks;  // of the grid, beside the exact one; empty: halves of it where there is calibration
  std::span<const converter::Sequence> calibration;  // for ranks below the exact one; not what is evaluated
};

// One sequence at the tick rate, as played.
struct Played {
  const std::string& variant;  // one that the report shows in 3D
  size_t sequence;
  std::span<const float> positions;  // [ticks, n, 3]
};
using PlayedVisitor = std::function<void(const Played&)>;

// Every (fps / tick rate)-th frame is a tick. Throws converter::Error where the ratio is no whole number, or the truth
// has another vertex count than the bundle.
size_t FramesPerTick(const converter::Bundle& bundle, const converter::Sequence& sequence);
size_t TickCount(const converter::Bundle& bundle, const converter::Sequence& sequence);

// Rigid hips, plain skinning, then the variants of variants.h.
std::vector<Variant> Evaluate(const converter::Bundle& bundle, std::span<const converter::Sequence> sequences,
                              const EvaluationOptions& options, const PlayedVisitor& visit);

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_EVALUATION_H_

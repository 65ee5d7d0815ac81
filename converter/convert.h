// Bundle -> model bytes: fold, prune, quantise, write, open. The whole offline library in one call.
#ifndef DCLOTH_CONVERTER_CONVERT_H_
#define DCLOTH_CONVERTER_CONVERT_H_

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "converter/bundle.h"
#include "converter/choose_formats.h"
#include "converter/file.h"
#include "converter/metrics.h"
#include "converter/pack.h"
#include "converter/precision.h"
#include "converter/prune.h"
#include "converter/rank.h"
#include "converter/sequence.h"
#include "converter/tensor_cost.h"

namespace dcloth::converter {

struct ConvertOptions {
  // Empty is `auto`: per tensor the cheapest format (choose_formats.h) that keeps the model within max_error_mm of the
  // fp32 one. Chosen on the calibration, so that `motion` stays unseen; on `motion` where there is no calibration.
  std::optional<Precision> precision = Precision::kFp32;
  std::optional<double> max_error_mm = {};  // bound on position_mm.max; needs motion or calibration
  std::span<const Sequence> motion = {};    // only measured on
  // Rows of the displacement basis, and the motion that a reduction may be fitted to. The bound holds on both kinds of
  // motion; a search looks at calibration alone, so that `motion` stays unseen.
  RankRequest rank = {};
  std::span<const Sequence> calibration = {};
  // Bones per cloth vertex and joints per body point, 1 to 8. Fewer are written where no vertex has as many; more are
  // cut to the strongest, and the report says what that costs.
  uint32_t influences = 8;
  uint32_t body_influences = 8;
  std::optional<uint32_t> stages = {};  // DCLOTH_STAGES_* that the model holds; without it all of the bundle's
  ProgressCallback progress = {};       // of measuring each tensor's cost on the motion
  ProgressCallback choosing = {};       // of `auto`, in models; how many it takes is an estimate
};

// One precision and rank that were tried. Errors are against the fp32 model with all stages and the whole basis.
struct Trial {
  std::string precision;  // "fp32", "fp16", "int8" or "mixed"
  uint64_t model_bytes = 0;
  MeshError error;          // on the motion; on the calibration where there is no motion; no frames where not measured
  uint32_t rank = 0;        // rows of the basis, without padding where it is not reduced
  MeshError calibration;    // on the calibration; no frames without any
  uint32_t influences = 0;  // bones of a cloth vertex
};

// What became of the displacement basis.
struct RankReport {
  uint32_t full = 0;     // k_S + k_M; 0 without a skeleton stage
  uint32_t exact = 0;    // numerical rank, even
  uint32_t rank = 0;     // rows of the model's basis, as Trial::rank
  bool reduced = false;  // whether it is another basis than [S; M]
};

// What `auto` chose.
struct AutoReport {
  double bound_mm = 0;
  bool calibrated = false;  // chosen on the calibration
  bool checked = false;     // on `motion`, which the choice did not see
  std::vector<FormatDecision> decisions;
  uint32_t rank = 0;        // rows of the basis when the formats were chosen; fewer may be stored, see RankReport
  double error_mm = 0;      // then, largest distance to the fp32 model
  uint32_t influences = 0;  // bones of a cloth vertex, cut to what the bound still allows after all else
  std::optional<double> fewer_influences_mm;  // what one fewer would make it; none where there is one alone
  size_t measured_models = 0;                 // all in all
};

struct ConvertReport {
  std::string precision;  // as Trial::precision
  uint32_t stages = 0;    // DCLOTH_STAGES_* of the model
  uint64_t model_bytes = 0;
  uint64_t instance_bytes = 0;        // lent memory per garment
  uint32_t joint_count = 0;           // joints that a host supplies
  uint32_t dropped_joints = 0;        // of the bundle's, not needed
  std::vector<TensorReport> tensors;  // with what each costs on the motion
  PruneReport influences;             // of the static stage
  PruneReport body_influences;        // of the body points; all zero without a mesh stage
  RankReport rank;
  std::vector<Trial> trials;  // empty without motion and calibration
  std::optional<AutoReport> automatic;
  std::vector<std::string> warnings;  // a sentence for each tensor of which rows were lost, or with huge weights
};

struct ConvertResult {
  AlignedBytes bytes;  // opened once with dcloth_model_open
  ConvertReport report;
};

// The same bundle and options give the same bytes. Throws Error, and ThresholdError where the bound is missed.
ConvertResult Convert(const Bundle& bundle, const ConvertOptions& options);

}  // namespace dcloth::converter

#endif  // DCLOTH_CONVERTER_CONVERT_H_

// Millimetres, tensor by tensor: where the error of a small model comes from.
#ifndef DCLOTH_CONVERTER_TENSOR_COST_H_
#define DCLOTH_CONVERTER_TENSOR_COST_H_

#include <functional>
#include <span>
#include <vector>

#include "converter/assemble.h"
#include "converter/pack.h"
#include "converter/precision.h"
#include "converter/sequence.h"

namespace dcloth::converter {

// Called with what is done and what there is to do, in frames.
using ProgressCallback = std::function<void(size_t done, size_t total)>;

// Fills `cost` of every tensor that `plan` stores as f16 or i8: the model with that tensor quantised and
// all others f32, against the model with all in f32, both run by the engine over the motion with all stages.
// Costs of single tensors do not add up to that of the whole model: their errors meet in the same vertices
// and states. Cost: one run of the motion per such tensor and one of the f32 model, whose positions are kept
// for one sequence. Throws Error.
void MeasureTensorCosts(const Bundle& bundle, const FoldedBundle& folded, const PrecisionPlan& plan,
                        std::span<const Sequence> motion, std::vector<TensorReport>* tensors,
                        const ProgressCallback& progress = {});

// The measured ones, costliest first by mean; ties by name.
std::vector<const TensorReport*> RankByCost(std::span<const TensorReport> tensors);

}  // namespace dcloth::converter

#endif  // DCLOTH_CONVERTER_TENSOR_COST_H_

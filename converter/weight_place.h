// Where a model's matrix comes from: people know their bundle's tensors, not the model's fields.
#ifndef DCLOTH_CONVERTER_WEIGHT_PLACE_H_
#define DCLOTH_CONVERTER_WEIGHT_PLACE_H_

#include <string>

#include "converter/bundle.h"
#include "converter/error.h"

namespace dcloth::converter {

struct WeightPlace {
  std::string tensor;   // of the bundle, "skeleton.gru.weight_hh"; empty where `field` is no matrix of weights
  std::string element;  // "[7, 9]"
  double value = 0;
};

// The largest weight of those that make the model's `field`, "skeleton_stage.hidden.weights".
WeightPlace LargestWeight(const Bundle& bundle, const std::string& field);

// Throws `error` as one of the bundle: its path, its name for the tensor, and where the largest weight is.
[[noreturn]] void RethrowForBundle(const Error& error, const Bundle& bundle);

}  // namespace dcloth::converter

#endif  // DCLOTH_CONVERTER_WEIGHT_PLACE_H_

// The garments under models/, each converted to every precision, with the motion that lies beside it.
#ifndef DCLOTH_TESTS_STABILITY_GARMENT_H_
#define DCLOTH_TESTS_STABILITY_GARMENT_H_

#include <array>
#include <memory>
#include <string>
#include <vector>

#include "converter/bundle.h"
#include "converter/precision.h"
#include "converter/rollout.h"
#include "tests/stability/motion.h"

namespace dcloth::stability {

using converter::Precision;

constexpr std::array<Precision, 3> kPrecisions = {Precision::kFp32, Precision::kFp16, Precision::kInt8};

// A bundled sequence with the simulated truth.
struct Clip {
  std::string name;
  Motion motion;             // joints in the models' order
  std::vector<float> truth;  // [frames, n, 3] world, metres
};

struct Garment {
  std::string name;
  converter::Bundle bundle;
  std::array<std::unique_ptr<converter::OpenModel>, 3> models;  // in the order of kPrecisions
  Rig rig;
  std::vector<Clip> clips;
  double size_m = 0;  // farthest template vertex from the hips' bind position

  const converter::OpenModel& model(Precision precision) const {
    return *models[static_cast<size_t>(precision)];
  }
  size_t vertex_count() const { return models[0]->info().vertex_count; }
};

// Folders of models/ that hold a bundle of their own name, sorted.
std::vector<std::string> GarmentNames();

// Reads and converts once per process. Throws converter::Error, also where a garment has no sequences with
// truth.
const Garment& LoadGarment(const std::string& name);

}  // namespace dcloth::stability

#endif  // DCLOTH_TESTS_STABILITY_GARMENT_H_

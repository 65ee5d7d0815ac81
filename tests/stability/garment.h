// The garments under models/ in every precision, with the motion that lies beside them.
//
// Models are converted when they are first asked for, or read from the folder that DCLOTH_GARMENT_MODELS names: as
// GARMENT.PRECISION.dcloth, what `dcloth convert --precision PRECISION` makes of the bundle. Under an emulator, that
// saves most of the time of a short test.
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

using converter::kPrecisions;

// A bundled sequence with the simulated truth.
struct Clip {
  std::string name;
  Motion motion;             // joints in the models' order
  std::vector<float> truth;  // [frames, n, 3] world, metres
};

struct Garment {
  std::string name;
  converter::Bundle bundle;
  Rig rig;
  std::vector<Clip> clips;
  double size_m = 0;  // farthest template vertex from the hips' bind position

  // Throws converter::Error.
  const converter::OpenModel& model(Precision precision) const;
  // The same in every precision.
  const std::vector<std::string>& joint_names() const { return model(Precision::kInt8).joint_names(); }
  size_t vertex_count() const { return bundle.vertex_count(); }

 private:
  mutable std::array<std::unique_ptr<converter::OpenModel>, 3> models_;  // in the order of kPrecisions
};

// Folders of models/ that hold a bundle of their own name, sorted.
std::vector<std::string> GarmentNames();

// Reads once per process. Throws converter::Error, also where a garment has no sequences with
// truth.
const Garment& LoadGarment(const std::string& name);

}  // namespace dcloth::stability

#endif  // DCLOTH_TESTS_STABILITY_GARMENT_H_

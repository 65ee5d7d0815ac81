// One small model of each kind that a file can be, so that attacks on all of their bytes take seconds.
#ifndef DCLOTH_TESTS_ATTACK_VARIANTS_H_
#define DCLOTH_TESTS_ATTACK_VARIANTS_H_

#include <ostream>
#include <string>
#include <vector>

#include "tests/unit/engine/model_builder.h"

namespace dcloth::testing {

struct Variant {
  std::string name;  // "F16_skeleton"
  ModelSpec spec;
};

inline void PrintTo(const Variant& variant, std::ostream* out) { *out << variant.name; }

// Every precision with every set of stages, and two that differ in features, influences and layers, one with integer
// layers, one with a reduced basis, one with a body, one with parts of it, one that reads the air, and patches in every
// precision: 19 models of 3 to 20 KB.
inline std::vector<Variant> Variants() {
  ModelSpec small;
  small.rings = 3;
  small.segments = 4;
  small.joints = 5;
  small.bones = 3;
  small.influences = 2;
  small.body_influences = 2;
  small.static_width = 5;
  small.units = 3;
  small.feature_width = 8;
  small.layers = 2;
  small.mesh_width = 5;
  small.mesh_basis = 3;
  std::vector<Variant> variants;
  for (const format::DType precision : {format::DType_F32, format::DType_F16, format::DType_I8}) {
    ModelSpec spec = small;
    spec.precision = precision;
    const std::string name = format::EnumNameDType(precision);
    variants.push_back({name + "_mesh", spec});
    spec.mesh = false;
    variants.push_back({name + "_skeleton", spec});
    spec.skeleton = false;
    variants.push_back({name + "_static", spec});
  }
  ModelSpec other = small;
  other.precision = format::DType_I8;
  other.root_motion = format::RootMotion_None;
  other.influences = 8;
  other.body_influences = 1;
  other.layers = 3;
  variants.push_back({"I8_no_root_motion_three_layers", other});
  other.layers = 1;
  other.feature_width = 16;
  other.influences = 1;
  other.body_influences = 8;
  variants.push_back({"I8_one_wide_layer", other});
  other.integer_layers = true;
  other.layers = 2;
  variants.push_back({"I8_integer_layers", other});
  small.precision = format::DType_I8;
  small.rank = 4;
  variants.push_back({"I8_reduced", small});
  small.rank = 0;
  small.body = true;
  variants.push_back({"I8_body", small});
  small.touch = true;
  small.coarse = small.texture = small.parents = true;
  variants.push_back({"I8_touch", small});
  small.body = small.touch = small.parents = false;
  small.root_motion = format::RootMotion_Air;
  variants.push_back({"I8_air", small});
  small.root_motion = format::RootMotion_Hips;
  small.coarse = small.texture = small.skeleton = small.mesh = false;
  small.patches = 2;
  small.patch_points = 2;
  small.patch_width = 8;
  small.patch_neighbours = 1;
  small.capsules = 3;
  small.embedding = 1;
  small.sources = 2;
  for (const format::DType precision : {format::DType_F32, format::DType_F16, format::DType_I8}) {
    small.precision = precision;
    variants.push_back({std::string(format::EnumNameDType(precision)) + "_patches", small});
  }
  return variants;
}

}  // namespace dcloth::testing

#endif  // DCLOTH_TESTS_ATTACK_VARIANTS_H_

// A figure whose joints have the names and places that a fit needs.
#ifndef DCLOTH_TESTS_UNIT_ENGINE_FIGURE_H_
#define DCLOTH_TESTS_UNIT_ENGINE_FIGURE_H_

#include <array>
#include <string>
#include <utility>
#include <vector>

namespace dcloth::testing {

using NamedJoint = std::pair<std::string, std::array<double, 3>>;

// A figure in T-pose, metres, facing +Z, left along +X.
inline std::vector<NamedJoint> Figure() {
  std::vector<NamedJoint> joints = {{"Hips", {0, 0.93, 0}},       {"Spine", {0, 1.05, 0}},
                                    {"Spine1", {0, 1.16, -0.01}}, {"Spine2", {0, 1.28, -0.01}},
                                    {"Neck", {0, 1.43, -0.02}},   {"Head", {0, 1.5, 0}}};
  for (const double side : {1.0, -1.0}) {
    const std::string name = side > 0 ? "Left" : "Right";
    joints.insert(joints.end(), {{name + "Shoulder", {side * 0.06, 1.4, -0.01}},
                                 {name + "Arm", {side * 0.17, 1.36, 0}},
                                 {name + "ForeArm", {side * 0.42, 1.36, 0}},
                                 {name + "Hand", {side * 0.64, 1.36, 0}},
                                 {name + "UpLeg", {side * 0.096, 0.88, 0}},
                                 {name + "Leg", {side * 0.096, 0.48, 0}},
                                 {name + "Foot", {side * 0.096, 0.07, 0}},
                                 {name + "ToeBase", {side * 0.095, 0.025, 0.12}}});
  }
  return joints;
}

}  // namespace dcloth::testing

#endif  // DCLOTH_TESTS_UNIT_ENGINE_FIGURE_H_

#include "converter/weight_place.h"

#include <cmath>
#include <utility>
#include <vector>

namespace dcloth::converter {
namespace {

struct Source {
  std::string tensor;
  const Matrix* weights;
};

std::vector<Source> SourcesOf(const Bundle& bundle, const std::string& field) {
  const auto is = [&](const char* matrix) { return field.starts_with(matrix); };
  if (is("static_stage.hidden")) return {{"static.mlp.0.weight", &bundle.static_hidden.weight}};
  if (is("static_stage.increments")) return {{"static.mlp.2.weight", &bundle.static_increments.weight}};
  std::vector<Source> sources;
  if (bundle.skeleton) {
    const SkeletonWeights& skeleton = *bundle.skeleton;
    if (is("skeleton_stage.input")) return {{"skeleton.gru.weight_ih", &skeleton.input.weight}};
    if (is("skeleton_stage.hidden")) return {{"skeleton.gru.weight_hh", &skeleton.hidden.weight}};
    if (is("displacement.")) {
      const Matrix& components = skeleton.components;
      sources.push_back(components.size() != 0 ? Source{"skeleton.components", &components}
                                               : Source{"skeleton.basis", &skeleton.basis});
    }
  }
  if (bundle.patches) {
    const PatchWeights& patches = *bundle.patches;
    if (is("patch_stage.enter")) return {{"patch.enter.weight", &patches.enter.weight}};
    if (is("patch_stage.input_gates")) return {{"patch.gates.weight_ih", &patches.input_gates.weight}};
    if (is("patch_stage.hidden_gates")) return {{"patch.gates.weight_hh", &patches.hidden_gates.weight}};
    if (is("patch_stage.out")) return {{"patch.out.weight", &patches.out.weight}};
    if (is("patch_stage.map")) return {{"patch.map.weights", &patches.map}};
    for (size_t l = 0; l < patches.mix.size(); ++l) {
      const std::string index = std::to_string(l) + ".";
      if (is(("patch_stage.mix." + index).c_str()))
        return {{("patch.mix." + index).append("weight"), &patches.mix[l].weight}};
    }
  }
  if (!bundle.mesh) return sources;
  const MeshWeights& mesh = *bundle.mesh;
  if (is("mesh_stage.hidden")) return {{"mesh.mlp.0.weight", &mesh.hidden.weight}};
  if (is("mesh_stage.coefficients")) return {{"mesh.mlp.2.weight", &mesh.coefficients.weight}};
  if (is("displacement.")) sources.push_back({"mesh.basis", &mesh.basis});
  for (size_t l = 0; l < mesh.layers.size(); ++l) {
    const std::string index = std::to_string(l) + ".";
    if (!is(("mesh_stage.layers." + index).c_str())) continue;
    const MeshLayerWeights& layer = mesh.layers[l];
    for (const auto& [name, weights] : {std::pair("w_p", &layer.w_p),
                                        {"w_z", &layer.w_z},
                                        {"w_r", &layer.w_r},
                                        {"w", &layer.w},
                                        {"u_z", &layer.u_z},
                                        {"u_r", &layer.u_r},
                                        {"u", &layer.u},
                                        {"w_o", &layer.w_o}}) {
      sources.push_back({("mesh.layers." + index).append(name), weights});
    }
  }
  return sources;
}

}  // namespace

WeightPlace LargestWeight(const Bundle& bundle, const std::string& field) {
  WeightPlace place;
  for (const Source& source : SourcesOf(bundle, field)) {
    Eigen::Index row = 0, column = 0;
    const float size = source.weights->cwiseAbs().maxCoeff(&row, &column);
    if (!place.tensor.empty() && static_cast<double>(size) <= std::abs(place.value)) continue;
    place.tensor = source.tensor;
    place.value = static_cast<double>((*source.weights)(row, column));
    const auto i = static_cast<uint64_t>(row), c = static_cast<uint64_t>(column);
    place.element = ShapeText(field.starts_with("displacement.")     ? Shape{i, c / 3, c % 3}
                              : field.starts_with("patch_stage.map") ? Shape{i, c / 9, c % 9 / 3, c % 3}
                                                                     : Shape{i, c});
  }
  return place;
}

void RethrowForBundle(const Error& error, const Bundle& bundle) {
  if (!error.parts().path.empty()) throw Error(error.parts());
  ErrorParts parts = error.parts();
  parts.path = bundle.path;
  const WeightPlace place = LargestWeight(bundle, parts.tensor);
  if (!place.tensor.empty()) {
    parts.tensor = place.tensor;
    parts.mend = "element " + place.element + " is the largest, " + NumberText(place.value) + "; " + parts.mend;
  }
  throw Error(std::move(parts));
}

}  // namespace dcloth::converter

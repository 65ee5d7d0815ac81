// What a model file holds beyond the C ABI: the cut in the bind pose and the skin that cloth is kept out of.
#ifndef DCLOTH_CONVERTER_MODEL_GEOMETRY_H_
#define DCLOTH_CONVERTER_MODEL_GEOMETRY_H_

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace dcloth::converter {

struct ModelGeometry {
  std::vector<float> template_positions;  // [n, 3] metres
  std::vector<float> body;                // [b, 3] bind pose; empty where the model has none, as the next three
  std::vector<uint32_t> body_triangles;   // [f, 3]
  std::vector<uint16_t> body_joints;      // [b, 4] the model's joints, those with the largest weights
  std::vector<float> body_weights;        // [b, 4] rows sum to 1
};

// `model` is a file that dcloth_model_open takes, on DCLOTH_ALIGNMENT. Throws Error where it does not.
ModelGeometry GeometryOf(std::span<const std::byte> model);

}  // namespace dcloth::converter

#endif  // DCLOTH_CONVERTER_MODEL_GEOMETRY_H_

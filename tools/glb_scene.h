// A dressed character as binary glTF: its skin on its skeleton, animated, and the garment as one morph target a frame.
#ifndef DCLOTH_TOOLS_GLB_SCENE_H_
#define DCLOTH_TOOLS_GLB_SCENE_H_

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace dcloth::tools {

// One clip; metres, +Y up.
struct GlbScene {
  std::string name;
  double fps = 0;
  size_t frame_count = 0;
  std::span<const float> garment;               // [frames, n, 3]
  std::span<const uint16_t> garment_triangles;  // indices of the n vertices and of those that repeat a seam's
  std::span<const uint16_t> seam_vertices;      // [s], of the n: what each of those repeats
  std::span<const float> texture_coordinates;   // [n + s, 2], v down; or empty
  std::span<const std::string> joints;
  std::span<const float> bind;           // [joints, 16] rows contiguous, joint to world
  std::span<const float> poses;          // [frames, joints, 16]
  std::span<const float> body;           // [b, 3] bind pose
  std::span<const uint32_t> influences;  // [b, 4]
  std::span<const float> weights;        // [b, 4]
  std::span<const uint32_t> body_triangles;
};

std::string GlbBytes(const GlbScene& scene);

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_GLB_SCENE_H_

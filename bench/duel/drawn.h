// The drawn mesh of a simulation: its vertices follow a proxy's triangles, or joints and spring bones; then its
// normals.
#ifndef DCLOTH_BENCH_DUEL_DRAWN_H_
#define DCLOTH_BENCH_DUEL_DRAWN_H_

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "bench/duel/case.h"
#include "kernels/kernels.h"

namespace dcloth::duel {

using Four = float __attribute__((vector_size(16)));  // x, y, z and one more

// Columns of a 3 x 4 matrix.
using Columns = std::array<Four, 4>;

inline Columns ColumnsOf(const float* rows) {
  Columns out;
  for (int c = 0; c < 4; ++c) out[c] = Four{rows[c], rows[4 + c], rows[8 + c], 0};
  return out;
}
inline Four Apply(const Columns& m, float x, float y, float z) { return x * m[0] + y * m[1] + z * m[2] + m[3]; }

// Of each joint: how a point of the bind pose goes to the world. `bind` holds joints without rotation.
void SkinMatrices(std::span<const float> pose, std::span<const float> bind, std::span<Columns> out);

// Points of the bind pose by dense skin weights [n, joints]; weights of zero are left out once, beforehand.
class Skinned {
 public:
  Skinned() = default;
  Skinned(std::vector<float> points, const std::vector<float>& weights, size_t joints);
  void Run(std::span<const Columns> skin, float* out) const;  // [n, 3]
  size_t bytes() const { return points_.size() * 4 + influences_.size() * sizeof(Influence); }

 private:
  struct Influence {
    int32_t joint;
    float weight;
  };
  std::vector<float> points_;
  std::vector<size_t> first_;
  std::vector<Influence> influences_;
};

class Drawn {
 public:
  explicit Drawn(const Case& data);

  // Each vertex: its place on a triangle of the proxy, and its height above it along the vertices' mixed normals.
  void FollowProxy(std::span<const Four> proxy);
  // Four bones a vertex.
  void FollowBones(std::span<const Columns> bones, const std::vector<int32_t>& bone, const std::vector<float>& weight,
                   const std::vector<float>& rest);
  std::span<const float> positions() const { return positions_; }
  size_t vertices() const { return positions_.size() / 3; }
  size_t bytes() const;

 private:
  void Normals();

  std::vector<uint16_t> triangles_;
  std::vector<int32_t> corners_, proxy_faces_;
  std::vector<float> weights_, offset_, positions_, normals_;
  std::vector<Four> proxy_normals_;
};

}  // namespace dcloth::duel

#endif  // DCLOTH_BENCH_DUEL_DRAWN_H_

// What a game has without dcloth: the garment skinned to the nearest bones. NETWORK.md, static stage with D = 0, the
// bundle's initial weights and no displacement.
#ifndef DCLOTH_TOOLS_BASELINE_H_
#define DCLOTH_TOOLS_BASELINE_H_

#include <span>
#include <vector>

#include "converter/bundle.h"

namespace dcloth::tools {

// Inverse of a joint matrix: rigid or not, last row 0 0 0 1. Three rows of four. Throws converter::Error where
// singular.
std::vector<double> InverseBind(const converter::Bundle& bundle);  // [J, 12]

// G_j B_j^-1 for every joint: [J, 12]. `pose` [J, 16] is in the bundle's joint order.
void SkinningMatrices(std::span<const double> inverse_bind, std::span<const float> pose, std::span<float> matrices);

class PlainSkinning {
 public:
  explicit PlainSkinning(const converter::Bundle& bundle);

  // `matrices` [J, 12] from SkinningMatrices; positions [n, 3] world.
  void Skin(std::span<const float> matrices, std::span<float> positions) const;

 private:
  struct Influence {
    uint32_t joint;
    float weight;
  };
  std::span<const float> template_;    // [n, 3], the bundle's
  std::vector<uint32_t> row_starts_;   // [n + 1]
  std::vector<Influence> influences_;  // weights of a row sum to 1
};

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_BASELINE_H_

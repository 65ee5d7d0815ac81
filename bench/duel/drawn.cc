#include "bench/duel/drawn.h"

#include <cmath>
#include <utility>

namespace dcloth::duel {
namespace {

Four Cross(Four a, Four b) {
  const Four a1 = {a[1], a[2], a[0], 0}, b1 = {b[1], b[2], b[0], 0};
  const Four c = a * b1 - a1 * b;
  return Four{c[1], c[2], c[0], 0};
}

void Store(Four value, float* to) { to[0] = value[0], to[1] = value[1], to[2] = value[2]; }

}  // namespace

void SkinMatrices(std::span<const float> pose, std::span<const float> bind, std::span<Columns> out) {
  for (size_t j = 0; j < out.size(); ++j) {
    out[j] = ColumnsOf(&pose[16 * j]);
    const float* b = &bind[16 * j];
    out[j][3] -= b[3] * out[j][0] + b[7] * out[j][1] + b[11] * out[j][2];
  }
}

Skinned::Skinned(std::vector<float> points, const std::vector<float>& weights, size_t joints)
    : points_(std::move(points)), first_{0} {
  for (size_t i = 0; i < points_.size() / 3; ++i) {
    for (size_t j = 0; j < joints; ++j)
      if (weights[i * joints + j] > 1e-4F) influences_.push_back({static_cast<int32_t>(j), weights[i * joints + j]});
    first_.push_back(influences_.size());
  }
}

void Skinned::Run(std::span<const Columns> skin, float* out) const {
  for (size_t i = 0; i + 1 < first_.size(); ++i) {
    Four sum{};
    for (size_t k = first_[i]; k < first_[i + 1]; ++k)
      sum += influences_[k].weight *
             Apply(skin[influences_[k].joint], points_[3 * i], points_[3 * i + 1], points_[3 * i + 2]);
    Store(sum, out + 3 * i);
  }
}

Drawn::Drawn(const Case& data)
    : corners_(data.Get<int32_t>("draw.corners")),
      proxy_faces_(data.Get<int32_t>("proxy.faces")),
      weights_(data.Get<float>("draw.weights")),
      offset_(data.Get<float>("draw.offset")),
      positions_(corners_.size()),
      normals_(corners_.size()),
      proxy_normals_(data.Rows("proxy.positions")) {
  for (int32_t corner : data.Get<int32_t>("draw.faces")) triangles_.push_back(static_cast<uint16_t>(corner));
}

void Drawn::FollowProxy(std::span<const Four> proxy) {
  for (Four& normal : proxy_normals_) normal = Four{};
  for (size_t f = 0; f + 2 < proxy_faces_.size(); f += 3) {
    const int32_t a = proxy_faces_[f], b = proxy_faces_[f + 1], c = proxy_faces_[f + 2];
    const Four across = Cross(proxy[b] - proxy[a], proxy[c] - proxy[a]);
    proxy_normals_[a] += across, proxy_normals_[b] += across, proxy_normals_[c] += across;
  }
  for (Four& n : proxy_normals_) n *= 1 / std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2] + 1e-20F);
  for (size_t i = 0; i < offset_.size(); ++i) {
    const int32_t *corner = &corners_[3 * i], a = corner[0], b = corner[1], c = corner[2];
    const float *weight = &weights_[3 * i], up = offset_[i];
    Store(weight[0] * (proxy[a] + up * proxy_normals_[a]) + weight[1] * (proxy[b] + up * proxy_normals_[b]) +
              weight[2] * (proxy[c] + up * proxy_normals_[c]),
          &positions_[3 * i]);
  }
  Normals();
}

void Drawn::FollowBones(std::span<const Columns> bones, const std::vector<int32_t>& bone,
                        const std::vector<float>& weight, const std::vector<float>& rest) {
  for (size_t i = 0; i < offset_.size(); ++i) {
    Columns mixed{};
    for (size_t k = 4 * i; k < 4 * i + 4; ++k)
      for (int c = 0; c < 4; ++c) mixed[c] += weight[k] * bones[bone[k]][c];
    Store(Apply(mixed, rest[3 * i], rest[3 * i + 1], rest[3 * i + 2]), &positions_[3 * i]);
  }
  Normals();
}

void Drawn::Normals() {
  constexpr size_t kStride = 3 * sizeof(float);
  kernels::BestKernels()->normals(
      {positions_.data(), kStride, triangles_.data(), normals_.data(), kStride, vertices(), triangles_.size() / 3});
}

// What binds the mesh to its proxy: all characters read it.
size_t Drawn::bytes() const { return 4 * (corners_.size() + weights_.size() + offset_.size() + proxy_faces_.size()); }

}  // namespace dcloth::duel

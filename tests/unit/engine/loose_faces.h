// A posed body of faces that share no vertex, so that a walk from one never comes to another.
#ifndef DCLOTH_TESTS_UNIT_ENGINE_LOOSE_FACES_H_
#define DCLOTH_TESTS_UNIT_ENGINE_LOOSE_FACES_H_

#include <cstdint>
#include <vector>

#include "engine/src/body/body_search.h"
#include "engine/src/body/body_sites.h"

namespace dcloth::testing {

class LooseFaces {
 public:
  static constexpr float kClearance = 0.002f;

  // Three corners of three coordinates a face.
  explicit LooseFaces(const std::vector<float>& positions)
      : positions_(positions), rows_(positions.size() / 3 + 1), normals_(positions.size(), 0.577f) {
    const size_t b = positions.size() / 3;
    for (size_t v = 0; v < b; ++v) {
      corners_.push_back(static_cast<uint16_t>(v));
      columns_.push_back(static_cast<uint16_t>(v / 3));
      rows_[v + 1] = static_cast<uint32_t>(v + 1);
    }
    body_.vertex_count = static_cast<uint32_t>(b);
    body_.face_count = static_cast<uint32_t>(b / 3);
    body_.faces = corners_.data();
    body_.row_starts = rows_.data();
    body_.columns = columns_.data();
    const size_t groups = engine::SiteGroupCount(body_);
    offsets_.resize(b);
    slacks_.resize(b);
    sites_.resize(groups * kernels::kNearestSiteFloats * kernels::kNearestGroup);
    bounds_.resize(kernels::kNearestBounds * kernels::NearestBoundStride(groups));
    body_sites_ = {offsets_.data(), slacks_.data(), sites_.data(), bounds_.data(), nullptr, groups};
    engine::FillBodySites(body_, lists_, positions_.data(), normals_.data(), kClearance, body_sites_);
    engine::TouchClass all = {};
    all.group_count = groups;
    engine::UseSites(all, body_sites_, &job_);
  }
  LooseFaces(const LooseFaces&) = delete;
  LooseFaces& operator=(const LooseFaces&) = delete;

  uint32_t vertex_count() const { return body_.vertex_count; }
  engine::PosedBody posed() const { return {&body_, positions_.data(), 1, 0}; }
  const kernels::NearestJob& job() const { return job_; }
  const engine::TouchLists& lists() const { return lists_; }
  const engine::BodySites& sites() const { return body_sites_; }

 private:
  std::vector<float> positions_;
  std::vector<uint16_t> corners_, columns_;
  std::vector<uint32_t> rows_;
  std::vector<float> normals_, offsets_, slacks_, sites_, bounds_;
  engine::BodySites body_sites_ = {};
  engine::TouchLists lists_ = {};
  format::BodyView body_ = {};
  kernels::NearestJob job_ = {};
};

}  // namespace dcloth::testing

#endif  // DCLOTH_TESTS_UNIT_ENGINE_LOOSE_FACES_H_

// The search for the closest face against all faces, on bodies whose faces know nothing of each other.
#include "engine/src/body_search.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "engine/src/body_sites.h"

namespace dcloth::engine {
namespace {

// Triangles at random places, each with vertices of its own.
class LooseFaces {
 public:
  LooseFaces(size_t faces, std::mt19937* random) : rows_(3 * faces + 1), normals_(9 * faces, 0.577f) {
    std::uniform_real_distribution<float> place(-1, 1), corner(-0.4f, 0.4f);
    for (size_t f = 0; f < faces; ++f) {
      const float middle[3] = {place(*random), place(*random), place(*random)};
      for (size_t c = 0; c < 3; ++c) {
        for (const float m : middle) positions_.push_back(m + corner(*random));
        corners_.push_back(static_cast<uint16_t>(3 * f + c));
        columns_.push_back(static_cast<uint16_t>(f));
        rows_[3 * f + c + 1] = static_cast<uint32_t>(3 * f + c + 1);
      }
    }
    body_.vertex_count = static_cast<uint32_t>(3 * faces);
    body_.face_count = static_cast<uint32_t>(faces);
    body_.faces = corners_.data();
    body_.row_starts = rows_.data();
    body_.columns = columns_.data();
    const size_t groups = SiteGroupCount(body_), b = body_.vertex_count;
    offsets_.resize(b);
    slacks_.resize(b);
    sites_.resize(groups * kernels::kNearestSiteFloats * kernels::kNearestGroup);
    bounds_.resize(kernels::kNearestBounds * kernels::NearestBoundStride(groups));
    const BodySites sites = {offsets_.data(), slacks_.data(), sites_.data(), bounds_.data(), nullptr, groups};
    FillBodySites(body_, lists_, positions_.data(), normals_.data(), 0.002f, sites);
    TouchClass all = {};
    all.group_count = groups;
    UseSites(all, sites, &job_);
  }

  uint32_t vertex_count() const { return body_.vertex_count; }
  ClosestPoint Walk(uint32_t start, const double point[3]) const { return SearchBody(posed(), start, start, point); }
  ClosestPoint Whole(uint32_t start, const double point[3]) const {
    return SearchWholeBody(posed(), job_, lists_, start, point);
  }

 private:
  PosedBody posed() const { return {&body_, positions_.data(), 1, 0}; }

  std::vector<float> positions_;
  std::vector<uint16_t> corners_, columns_;
  std::vector<uint32_t> rows_;
  std::vector<float> normals_, offsets_, slacks_, sites_, bounds_;
  TouchLists lists_ = {};
  format::BodyView body_ = {};
  kernels::NearestJob job_ = {};
};

TEST(BodySearchTest, TheWholeBodyIsSearchedWhereAWalkEnds) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> place(-1.5, 1.5);
  size_t further = 0;
  for (const size_t faces : {1u, 7u, 60u, 400u}) {
    const LooseFaces body(faces, &random);
    for (int i = 0; i < 50; ++i) {
      const double point[3] = {place(random), place(random), place(random)};
      const uint32_t start = static_cast<uint32_t>(random() % body.vertex_count());
      double least = HUGE_VAL;
      for (uint32_t v = 0; v < body.vertex_count(); v += 3) least = std::min(least, std::fabs(body.Walk(v, point).distance));
      const ClosestPoint found = body.Whole(start, point);
      ASSERT_TRUE(found.found);
      ASSERT_NEAR(std::fabs(found.distance), least, 1e-9) << faces << " faces, point " << i;
      further += std::fabs(body.Walk(start, point).distance) > least + 1e-6;
    }
  }
  EXPECT_GT(further, 100u) << "walks alone would do";
}

}  // namespace
}  // namespace dcloth::engine

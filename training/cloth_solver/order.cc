#include "order.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace cloth_solver {
namespace {

constexpr float kCell = 0.01f;  // m, about an edge

// Place on a Morton curve of 2^21 cells a side: consecutive places lie beside each other.
uint64_t Place(const float* at) {
  uint64_t place = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const float cell = at[axis] / kCell + (1 << 20);
    const uint64_t number = cell > 0 && cell < 2e6f ? static_cast<uint64_t>(cell) : 0;
    for (int bit = 0; bit < 21; ++bit) place |= (number >> bit & 1) << (3 * bit + axis);
  }
  return place;
}

template <typename T>
const T* Permuted(const T* from, const std::vector<int32_t>& given, int width, std::vector<T>* out) {
  if (from == nullptr) return nullptr;
  for (int32_t i : given) {
    const T* own = from + width * static_cast<size_t>(i);
    out->insert(out->end(), own, own + width);
  }
  return out->data();
}

}  // namespace

Ordered::Ordered(const cloth_solver_problem& p) : problem_(p), given_(p.vertices) {
  std::vector<uint64_t> place(p.vertices);
  for (int32_t i = 0; i < p.vertices; ++i) place[i] = Place(p.start + 3 * static_cast<size_t>(i));
  std::iota(given_.begin(), given_.end(), 0);
  std::stable_sort(given_.begin(), given_.end(), [&](int32_t a, int32_t b) { return place[a] < place[b]; });
  std::vector<int32_t> number(p.vertices);
  for (int32_t i = 0; i < p.vertices; ++i) number[given_[i]] = i;
  for (int32_t k = 0; k < 3 * p.faces; ++k) face_.push_back(number[p.face[k]]);
  for (int32_t k = 0; k < p.pinned; ++k) pin_.push_back(number[p.pin[k]]);
  problem_.face = face_.data(), problem_.pin = pin_.data();
  problem_.start = Permuted(p.start, given_, 3, &start_);
  problem_.mass_scale = Permuted(p.mass_scale, given_, 1, &mass_scale_);
  problem_.bend_scale = Permuted(p.bend_scale, given_, 1, &bend_scale_);
  problem_.crease = Permuted(p.crease, given_, 1, &crease_);
  problem_.cloth_part = Permuted(p.cloth_part, given_, 1, &cloth_part_);
}

}  // namespace cloth_solver

// A problem whose cloth vertices are numbered so that neighbours in space are neighbours in memory.
#pragma once
#include <vector>

#include "cloth_solver.h"

namespace cloth_solver {

class Ordered {
 public:
  explicit Ordered(const cloth_solver_problem& problem);
  Ordered(const Ordered&) = delete;
  Ordered& operator=(const Ordered&) = delete;

  const cloth_solver_problem& problem() const { return problem_; }
  // For each of its vertices the number that the caller knows it by.
  const std::vector<int32_t>& given() const { return given_; }

 private:
  cloth_solver_problem problem_;
  std::vector<int32_t> given_, face_, pin_;
  std::vector<float> start_, mass_scale_, bend_scale_, crease_;
  std::vector<uint32_t> cloth_part_;
};

}  // namespace cloth_solver

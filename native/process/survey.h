// What lines through a process may look like: for what is decided about it before the first ray.
#pragma once

#include <cstddef>
#include <vector>

#include "process/covariance.h"
#include "process/path.h"

namespace gpis {

// Points of one line that are surveyed at most: where lengths grow a thousandfold it has no end.
constexpr std::size_t kMostSurveyed = 500;

struct SurveyLine {
  LineGeometry geometry;
  double end;  // from t = 0
};

// Lines of so many length scales (most lines end before) around the middle of the bounds, along
// axes and diagonals, and across the places where lengths are shortest and change most.
std::vector<SurveyLine> survey_lines(const Covariance& covariance, const Box3& bounds,
                                     double lengths = 12);

}  // namespace gpis

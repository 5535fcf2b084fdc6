// What lines through a process may look like: for what is decided about it before the first ray.
#pragma once

#include <vector>

#include "process/covariance.h"
#include "process/path.h"

namespace gpis {

struct SurveyLine {
  LineGeometry geometry;
  double end;  // from t = 0
};

// Lines of a few length scales around the middle of the bounds, along axes and diagonals.
std::vector<SurveyLine> survey_lines(const Covariance& covariance, const Box3& bounds);

// A step that suits all of a line: half of the shortest length scale found on it.
double survey_step(const Covariance& covariance, const LineGeometry& line, double t_begin,
                   double t_end);

}  // namespace gpis

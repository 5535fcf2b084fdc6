// What a light path keeps of a process under the memory `global-n` (definitions B11): g as it was
// met on the last n segments.
#pragma once

#include <cstddef>
#include <vector>

#include "process/covariance.h"

namespace gpis {

struct SegmentMemory {
  struct Row {  // a functional of g, object space
    Vec3 at;
    Functional what;
    double value, noise;  // and the variance of the value
  };
  std::vector<std::vector<Row>> segments;  // the oldest first

  void keep(std::vector<Row> rows, int count) {
    segments.push_back(std::move(rows));
    if (segments.size() > static_cast<std::size_t>(count)) segments.erase(segments.begin());
  }
};

}  // namespace gpis

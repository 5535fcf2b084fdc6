// What is known of f: values and gradients at points, part of the model (math.md §3).
#pragma once

#include <optional>
#include <vector>

#include "core/vec.h"

namespace gpis {

struct Conditions {
  struct Point {
    Vec3 at;
    std::optional<double> value;   // of f
    std::optional<Vec3> gradient;  // ∇f
    double noise = 0;              // standard deviation of the value
  };
  std::vector<Point> points;
};

}  // namespace gpis

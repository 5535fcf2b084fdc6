// What is known of f: values and gradients at points, part of the model (math.md §3).
#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "core/vec.h"

namespace gpis {

struct GaussianProcess;
class Posterior;

struct Conditions {
  struct Point {
    Vec3 at;
    std::optional<double> value;   // of f
    std::optional<Vec3> gradient;  // ∇f
    double noise = 0;              // standard deviation of the value
  };
  Conditions() = default;
  explicit Conditions(std::vector<Point> p) : points(std::move(p)) {}

  std::vector<Point> points;

  // Solved once for all that ask for one process (posterior_of).
  struct Solved {
    std::shared_ptr<const GaussianProcess> process;
    std::shared_ptr<const Posterior> posterior;
  };
  mutable std::mutex mutex;
  mutable std::vector<Solved> solved;
};

}  // namespace gpis

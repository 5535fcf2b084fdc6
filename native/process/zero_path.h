// σ = 0: the surface is the mean itself and nothing is drawn. Marches like the others.
#pragma once

#include "process/gaussian_process.h"
#include "process/path.h"

namespace gpis {

class ZeroPath {
 public:
  static constexpr int kStride = 1;
  struct Plan {
    Plan(const GaussianProcess& process, const Box3&)
        : length(process.kernel->min_length_scale()) {}
    double correlation_error = 0;
    double length;
  };

  void reset(const Plan& plan, const LineGeometry& line, double, double, Counters&) {
    step_ = 0.5 * plan.length / length(line.direction);
  }
  double step() const { return step_; }
  double last_step() const { return 0; }
  double value_mean() const { return 0; }
  double value_deviation() const { return 0; }
  void slope_law(double, double& mean, double& deviation) const { mean = deviation = 0; }
  void start_free(Rng&, Counters&, double& g, double& dg) { g = dg = 0; }
  double start(const PathStart&, Rng&, Counters&) { return 0; }
  double pull(double) const { return 0; }
  void prepare(long, Rng&, Counters&) {}
  void at_right(long, double& g, double& dg) const { g = dg = 0; }
  void at(long, double, Rng&, double& g, double& dg) const { g = dg = 0; }
  double deviation(double) const { return 0; }
  PathGradient gradient(double, double, double, Rng&) const { return {{}, {}, {}, 0}; }

 private:
  double step_ = 1;
};
static_assert(LinePath<ZeroPath>);

}  // namespace gpis

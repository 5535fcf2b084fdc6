// Sampler 5, dense: values and slopes of g at all points of a line drawn JOINTLY from their
// covariance, the reference for the other samplers. The points stand at a fixed spacing in units of
// the length scale, so the covariance of a stationary kernel is factorised once per process, not
// per ray. Between two points the path is the cubic through both values and slopes (standard
// deviation of what that leaves out: 1.0e-4).
#pragma once

#include <Eigen/Core>

#include "process/gaussian_process.h"
#include "process/radial_line.h"

namespace gpis {

class DensePath {
 public:
  static constexpr int kStride = 1;
  static constexpr double kLastStep = 1e-5;
  struct Plan {
    Plan(const GaussianProcess& process, const Box3& bounds);
    double correlation_error = 2e-4;
    RadialLine::Plan line;
  };

  void reset(const Plan& plan, const LineGeometry& line, double anchor, double t_end,
             Counters& counters);

  double step() const { return step_; }
  double value_deviation() const { return 1; }
  void slope_law(double, double& mean, double& deviation) const {
    mean = 0;
    deviation = line_.slope_deviation();
  }
  void start_free(Rng& rng, Counters& counters, double& g, double& dg) {
    prepare(0, rng, counters);
    at_left(0, g, dg);
  }
  double start(const PathStart& known, Rng& rng, Counters& counters);
  double pull(double t) const { return conditioned_ && line_.q(t) < 6 ? pull_ : 0; }
  void prepare(long cell, Rng& rng, Counters& counters);
  void at_left(long cell, double& g, double& dg) const { point(cell, g, dg); }
  void at_right(long cell, double& g, double& dg) const { point(cell + 1, g, dg); }
  void at(long cell, double t, Rng&, double& g, double& dg) const;
  double deviation(double) const { return 0; }
  PathGradient gradient(double t, double, double dg, Rng&) const { return line_.gradient(t, dg); }

 private:
  static constexpr double kStep = 0.25;
  static constexpr double kMaxReach = 64;  // length scales that one joint sample can cover
  static constexpr double kReaches[] = {8, 24, kMaxReach};

  // K = F Fᵀ for the interleaved vector (g_0, g'_0, g_1, g'_1, …), columns the significant
  // eigenvectors: eigenvalues below 1e-14 of the largest are rounding noise of the matrix itself.
  using Factor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  static const Factor& factor(double reach, Counters& counters);

  void point(long k, double& g, double& dg) const;

  RadialLine line_;
  double step_ = 1, pull_ = 0;
  double delta_value_ = 0, delta_slope_ = 0;
  bool conditioned_ = false;
  const Factor* factor_ = nullptr;
  Eigen::VectorXd modes_;
  bool drawn_ = false;
};
static_assert(LinePath<DensePath>);

}  // namespace gpis

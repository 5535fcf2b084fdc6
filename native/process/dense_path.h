// Sampler 5, dense: values and slopes of g at all points of a line drawn JOINTLY from their
// covariance, the reference for the other samplers. The points stand at a fixed spacing in units of
// the length scale, so the covariance of a stationary kernel is factorised once per process, not
// per ray. Between two points the path is the cubic through both values and slopes (standard
// deviation of what that leaves out: 1.0e-4).
#pragma once

#include <Eigen/Core>

#include "core/counters.h"
#include "core/rng.h"

namespace gpis {

class DensePath {
 public:
  static constexpr double kStep = 0.25;
  static constexpr double kMaxReach = 64;  // length scales that one joint sample can cover

  // A line of at most `reach` length scales, drawn at once.
  void reset(double reach, Counters& counters);
  void prepare(long cell, Rng& rng, Counters& counters);
  void at_left(long cell, double& g, double& dg) const { point(cell, g, dg); }
  void at_right(long cell, double& g, double& dg) const { point(cell + 1, g, dg); }
  void at(long cell, double q, double& g, double& dg) const;

 private:
  // K = F Fᵀ for the interleaved vector (g_0, g'_0, g_1, g'_1, …), columns the significant
  // eigenvectors: eigenvalues below 1e-14 of the largest are rounding noise of the matrix itself.
  using Factor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  static const Factor& factor(double reach, Counters& counters);

  void point(long k, double& g, double& dg) const {
    g = factor_->row(2 * k).dot(modes_);
    dg = factor_->row(2 * k + 1).dot(modes_);
  }

  const Factor* factor_ = nullptr;
  Eigen::VectorXd modes_;
  bool drawn_ = false;
};

}  // namespace gpis

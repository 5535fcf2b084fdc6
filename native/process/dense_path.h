// Sampler 5, dense: values and slopes of g at all points of a line drawn JOINTLY from their
// covariance, the reference for the other samplers; any one radial correlation with a derivative.
// The points stand at a fixed spacing in units of the length scale, so the covariance is factorised
// once per correlation, not per ray. Between two points
//  - a smooth path is the quintic through both values and slopes that comes closest to the mean
//    given them: the spacing is chosen so that this leaves out less than 1e-4 standard deviations;
//  - a rough path (Matérn, Wong) is halved by its exact law given value and slope at both ends,
//    down to 1/256 of a cell. For Matérn 3/2 and Wong that law is the whole truth, and below the
//    path is the bridge of an integrated Brownian motion, drawn where it is asked for; Matérn 5/2
//    also knows g'' (its effect on the correlation is below the variance of the bridge) and is
//    cubic below.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "process/brownian_bridge.h"
#include "process/gaussian_process.h"
#include "process/radial_line.h"

namespace gpis {

// K = L Lᵀ for the vector (g_0, g'_0, g_1, g'_1, …): L is lower triangular, so a line draws only as
// far as it gets, and has no more columns than K has significant eigenvalues.
class DenseFactor;

class DensePath {
 public:
  static constexpr int kStride = 1;
  struct Plan {
    Plan(const GaussianProcess& process, const Box3& bounds);

    // Midpoint of an interval: mean by (g, g' at both ends), rest by two normals.
    struct Halving {
      Eigen::Matrix<double, 2, 4> mean;
      Eigen::Matrix2d factor;
    };
    double correlation_error = 0;
    RadialLine::Plan line;
    double step = 0.25;               // of a cell, in length scales
    double reach = 0;                 // length scales that one joint sample covers
    double deviation = 0, power = 0;  // see deviation()
    // Of a smooth path: what the quintic adds to the cubic, from both ends.
    Eigen::Matrix<double, 2, 4> bend = Eigen::Matrix<double, 2, 4>::Zero();
    std::vector<Halving> halvings;  // of a rough path: of a cell, of half a cell, …
    double intensity = 0;           // below these, of the noise that drives the slope
    std::shared_ptr<DenseFactor> factor;
  };

  void reset(const Plan& plan, const LineGeometry& line, double anchor, double t_end,
             Counters& counters);

  double step() const { return step_; }
  double last_step() const { return plan_->intensity > 0 ? 0 : 1e-5; }
  double value_mean() const { return 0; }
  double value_deviation() const { return 1; }
  void slope_law(double, double& mean, double& deviation) const {
    mean = 0;
    deviation = line_.slope_deviation();
  }
  void start_free(Rng& rng, Counters& counters, double& g, double& dg);
  double start(const PathStart& known, Rng& rng, Counters& counters);
  double pull(double t) const;
  void prepare(long cell, Rng& rng, Counters& counters);
  void at_right(long, double& g, double& dg) const { read(nodes_.back(), g, dg); }
  void at(long cell, double t, Rng& rng, double& g, double& dg);
  double deviation(double h) const {
    const double q = h * line_.inverse_length();
    if (plan_->power == 4) return plan_->deviation * (q * q) * (q * q);
    return plan_->deviation * q * std::sqrt(q) * (plan_->power > 2 ? q : 1);
  }
  PathGradient gradient(double t, double, double dg, Rng&) const { return line_.gradient(t, dg); }

 private:
  using Node = BridgePoint;  // in length scales
  Node point(long k, Rng& rng, Counters& counters);
  void read(const Node& node, double& g, double& dg) const {
    g = node.g;
    dg = node.dg * line_.inverse_length();
  }

  const Plan* plan_ = nullptr;
  RadialLine line_;
  double step_ = 1;
  double start_value_ = 0, start_slope_ = 0;  // as far as they are known, per length scale
  double delta_value_ = 0, delta_slope_ = 0;
  bool conditioned_ = false;
  Counters* counters_ = nullptr;
  const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>* factor_ = nullptr;
  std::vector<double> modes_;
  std::vector<Node> nodes_;  // in increasing order
};
static_assert(LinePath<DensePath>);

}  // namespace gpis

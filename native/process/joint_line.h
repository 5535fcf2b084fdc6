// What the joint samplers share (math.md §5.4, §5.5): a line whose g is drawn from the covariance
// of given points, given what is known at its anchor, with the gradient from the same rows. It
// serves every kernel and tensor field, at the price of a factorisation per line.
#pragma once

#include "process/gaussian_process.h"
#include "process/joint_rows.h"
#include "process/path.h"

namespace gpis {

class JointLine {
 public:
  struct Plan {
    // Refuses a kernel without gradient.
    explicit Plan(const GaussianProcess& process);
    Covariance covariance;
    double correlation_error = 0;
  };

  double value_deviation() const { return std::sqrt(anchor_law_(0, 0)); }
  void slope_law(double g0, double& mean, double& deviation) const;
  void start_free(Rng& rng, Counters& counters, double& g, double& dg);
  double start(const PathStart& known, Rng& rng, Counters& counters);
  double pull(double t) const { return t < pull_end_ ? rows_.known_norm() : 0; }
  PathGradient gradient(double t, double g, double dg, Rng&) const;

 protected:
  // More rows than these are not kept in one factor: new ones are then drawn given the last kKept.
  static constexpr int kMostRows = 240, kKept = 100;

  void begin(const Plan& plan, const LineGeometry& line, double anchor, Counters& counters);
  LocalPoint point(double t) const { return covariance_->at(line_.origin + line_.direction * t); }
  SymMat3 along(const LocalPoint& p) const {  // ∂_d A
    return p.da[0] * line_.direction.x + p.da[1] * line_.direction.y + p.da[2] * line_.direction.z;
  }
  Functional value_row() const { return {}; }
  Functional slope_row() const { return {0, line_.direction}; }
  // Standard deviation of the middle of [a, a + h] from the cubic through values and slopes of both
  // ends, exactly.
  double deviation_from_cubic(double a, double h) const;

  const Covariance* covariance_ = nullptr;
  LineGeometry line_;
  double anchor_ = 0;
  LocalPoint at_anchor_;
  JointRows rows_;
  int lasting_rows_ = 0;  // at the head of rows_: never forgotten

 private:
  Eigen::Vector4d anchor_mean_;
  Eigen::Matrix4d anchor_law_;  // of (g, ∇g)
  double pull_end_ = 0;
};

}  // namespace gpis

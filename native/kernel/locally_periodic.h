// exp(-2 sin²(π s/p)/ℓ_p²) · exp(-q²/2), s = uᵀr: bumps that repeat with period p along the axis u
// and drift apart over the length scale. The periodic factor acts along an axis because a cosine of
// the distance is no covariance in 3-D (math.md §2).
#pragma once

#include "kernel/stationary_kernel.h"

namespace gpis {

class LocallyPeriodic : public Kernel {
 public:
  LocallyPeriodic(const LengthScales& scales, double period, const Vec3& axis,
                  double periodic_scale);

  double covariance(const Vec3& r) const override;
  Vec3 gradient(const Vec3& r) const override;
  Mat3 mixed(const Vec3& r) const override;
  bool differentiable() const override { return true; }
  double min_length_scale() const override;
  std::optional<std::vector<Term>> terms() const override;
  std::string describe() const override;

 private:
  // The periodic factor and its first two derivatives by s.
  struct Factor {
    double value, slope, curvature;
  };
  Factor factor(double s) const;

  SquaredExponential envelope_;
  LengthScales scales_;
  Vec3 axis_;
  double period_, periodic_scale_;
};

}  // namespace gpis

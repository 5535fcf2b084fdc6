// Kernels of one distance, κ(q) with q² = rᵀA⁻¹r: squared exponential, Matérn, rational quadratic,
// Wong (math.md §2).
#pragma once

#include "kernel/kernel.h"
#include "kernel/length_scales.h"

namespace gpis {

class StationaryKernel : public Kernel {
 public:
  double covariance(const Vec3& r) const override { return term_.covariance(r); }
  Vec3 gradient(const Vec3& r) const override;
  double covariance_and_gradient(const Vec3& r, Vec3& slopes) const override;
  Mat3 mixed(const Vec3& r) const override;
  bool differentiable() const override { return term_.radial.differentiable(); }
  double min_length_scale() const override { return scales_.shortest(); }
  std::optional<std::vector<Term>> terms() const override { return std::vector{term_}; }

 protected:
  StationaryKernel(const Radial& radial, const LengthScales& scales)
      : scales_(scales), term_{1, radial, scales.whitening(), {}} {}
  // "Name(first, length_scale, rotation=…)".
  std::string describe_as(const std::string& name, const std::string& first = "") const;

 private:
  LengthScales scales_;
  Term term_;
};

// exp(-q²/2).
class SquaredExponential : public StationaryKernel {
 public:
  explicit SquaredExponential(const LengthScales& scales);
  std::string describe() const override;
};

// nu = 1/2 (Ornstein-Uhlenbeck, no gradient), 3/2 or 5/2.
class Matern : public StationaryKernel {
 public:
  Matern(double nu, const LengthScales& scales);
  std::string describe() const override;

 private:
  double nu_;
};

// (1 + q²/2α)^{-α}: a mixture of squared exponentials of all scales, with a long memory.
class RationalQuadratic : public StationaryKernel {
 public:
  RationalQuadratic(double alpha, const LengthScales& scales);
  std::string describe() const override;

 private:
  double alpha_;
};

// (3/2) e^{-q/√3} - (1/2) e^{-√3 q}: the one whose first passage is known in closed form (Wong
// 1966).
class Wong : public StationaryKernel {
 public:
  explicit Wong(const LengthScales& scales);
  std::string describe() const override;
};

}  // namespace gpis

#include "kernel/locally_periodic.h"

#include "field/check.h"

namespace gpis {
namespace {

// e^{-b} I_k(b), k = 0 … until what is left of the series e^{-b}(I₀ + 2ΣI_k) = 1 is below 1e-12:
// Miller's downward recurrence I_{k-1} = I_{k+1} + (2k/b) I_k, which that sum normalises.
std::vector<double> scaled_bessel(double b) {
  const int start = 60 + static_cast<int>(10 * std::sqrt(b));
  std::vector<double> value(start + 2, 0.0);
  value[start] = 1e-300;
  double sum = 0;
  for (int k = start; k > 0; --k) {
    value[k - 1] = value[k + 1] + 2 * k / b * value[k];
    if (value[k - 1] > 1e200) {
      for (int i = k - 1; i <= start; ++i) value[i] *= 1e-250;
      sum *= 1e-250;
    }
    sum += 2 * value[k];
  }
  sum += value[0];
  double rest = 0;
  std::size_t last = start;
  while (last > 0 && rest + 2 * value[last] / sum < 1e-12) rest += 2 * value[last--] / sum;
  value.resize(last + 1);
  for (double& v : value) v /= sum;
  return value;
}

}  // namespace

LocallyPeriodic::LocallyPeriodic(const LengthScales& scales, double period, const Vec3& axis,
                                 double periodic_scale)
    : envelope_(scales), scales_(scales), period_(period), periodic_scale_(periodic_scale) {
  check_positive("period", period);
  check_direction("axis", axis);
  if (!(periodic_scale >= 1e-3 && periodic_scale <= 1e6))
    refuse("periodic_scale is ", periodic_scale,
           "; it takes 0.001 to 1e6: a bump is about periodic_scale/6 of a period wide.");
  axis_ = normalize(axis);
}

// With b = 1/ℓ_p², w = 2π/p: P = exp(-b(1 - cos ws)) = exp(-2b sin²(ws/2)).
LocallyPeriodic::Factor LocallyPeriodic::factor(double s) const {
  const double w = 2 * kPi / period_, b = 1 / (periodic_scale_ * periodic_scale_);
  const double half = std::sin(0.5 * w * s), log_slope = -b * w * std::sin(w * s);
  const double value = std::exp(-2 * b * half * half);
  return {value, value * log_slope,
          value * (log_slope * log_slope - b * w * w * (1 - 2 * half * half))};
}

double LocallyPeriodic::covariance(const Vec3& r) const {
  return factor(dot(axis_, r)).value * envelope_.covariance(r);
}

Vec3 LocallyPeriodic::gradient(const Vec3& r) const {
  const Factor p = factor(dot(axis_, r));
  return axis_ * (p.slope * envelope_.covariance(r)) + envelope_.gradient(r) * p.value;
}

Mat3 LocallyPeriodic::mixed(const Vec3& r) const {
  const Factor p = factor(dot(axis_, r));
  const Vec3 slope = envelope_.gradient(r);
  return outer(axis_, axis_) * (-p.curvature * envelope_.covariance(r)) +
         (outer(axis_, slope) + outer(slope, axis_)) * -p.slope + envelope_.mixed(r) * p.value;
}

double LocallyPeriodic::min_length_scale() const {
  return std::min(scales_.shortest(), period_ * periodic_scale_ / (2 * kPi));
}

// P(s) = e^{-b}[I₀(b) + 2 Σ I_k(b) cos(2πks/p)] (formulas C9).
std::optional<std::vector<Term>> LocallyPeriodic::terms() const {
  const auto bessel = scaled_bessel(1 / (periodic_scale_ * periodic_scale_));
  if (bessel.size() > kMaxTerms) return std::nullopt;
  std::vector<Term> out;
  for (std::size_t k = 0; k < bessel.size(); ++k)
    out.push_back({(k ? 2 : 1) * bessel[k],
                   {Radial::Family::squared_exponential},
                   scales_.whitening(),
                   axis_ * (2 * kPi * k / period_)});
  return out;
}

std::string LocallyPeriodic::describe() const {
  return "LocallyPeriodic(" + scales_.describe() + ", " + number_text(period_) + ", " +
         vector_text(axis_) + ", " + number_text(periodic_scale_) + scales_.describe_rotation() +
         ")";
}

}  // namespace gpis

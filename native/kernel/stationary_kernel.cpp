#include "kernel/stationary_kernel.h"

#include "field/check.h"

namespace gpis {
namespace {

Radial::Family matern_family(double nu) {
  if (nu == 0.5) return Radial::Family::matern12;
  if (nu == 1.5) return Radial::Family::matern32;
  if (nu == 2.5) return Radial::Family::matern52;
  refuse("nu is ", nu, ": a Matérn kernel takes 0.5, 1.5 or 2.5.");
}

double checked_alpha(double alpha) {
  check_positive("alpha", alpha);
  return alpha;
}

}  // namespace

// With p = Bᵀ(B r)/q of order 1: ∂_i k = κ' p_i and -∂_i∂_j k = -(κ'/q A⁻¹ + (κ'' - κ'/q) p pᵀ),
// neither with a cancellation at small q.
Vec3 StationaryKernel::gradient(const Vec3& r) const {
  const double q = term_.distance(r);
  if (q == 0) return {};
  const Mat3& b = term_.whitening;
  return transpose(b) * (b * r) * (term_.radial.slope(q) / q);
}

double StationaryKernel::covariance_and_gradient(const Vec3& r, Vec3& slopes) const {
  const Mat3& b = term_.whitening;
  const double q = term_.distance(r);
  double slope_over_q = 0;
  const double k = term_.radial.value_and_slope_over_q(q, slope_over_q);
  slopes = q == 0 ? Vec3{} : transpose(b) * (b * r) * slope_over_q;
  return term_.weight * k;
}

Mat3 StationaryKernel::mixed(const Vec3& r) const {
  const Mat3& b = term_.whitening;
  const double q = term_.distance(r);
  const Mat3 inverse_a = transpose(b) * b;
  const double slope_over_q = term_.radial.slope_over_q(q);
  if (q == 0) return inverse_a * -slope_over_q;
  const Vec3 p = transpose(b) * ((b * r) / q);
  return inverse_a * -slope_over_q + outer(p, p) * -term_.radial.excess(q);
}

std::string StationaryKernel::describe_as(const std::string& name, const std::string& first) const {
  return name + "(" + first + scales_.describe() + scales_.describe_rotation() + ")";
}

SquaredExponential::SquaredExponential(const LengthScales& scales)
    : StationaryKernel({Radial::Family::squared_exponential}, scales) {}
std::string SquaredExponential::describe() const {
  return describe_as("SquaredExponential");
}

Matern::Matern(double nu, const LengthScales& scales)
    : StationaryKernel({matern_family(nu)}, scales), nu_(nu) {}
std::string Matern::describe() const {
  return describe_as("Matern", number_text(nu_) + ", ");
}

RationalQuadratic::RationalQuadratic(double alpha, const LengthScales& scales)
    : StationaryKernel({Radial::Family::rational_quadratic, checked_alpha(alpha)}, scales),
      alpha_(alpha) {}
std::string RationalQuadratic::describe() const {
  return describe_as("RationalQuadratic", number_text(alpha_) + ", ");
}

Wong::Wong(const LengthScales& scales) : StationaryKernel({Radial::Family::wong}, scales) {}
std::string Wong::describe() const {
  return describe_as("Wong");
}

}  // namespace gpis

#include "kernel/radial.h"

namespace gpis {
namespace {

using Family = Radial::Family;

const double kSqrt3 = std::sqrt(3.0), kSqrt5 = std::sqrt(5.0);

// Wong 1966: κ = (3/2) e^{-aq} - (1/2) e^{-bq}, a = 1/√3, b = √3.
const double kWongA = 1 / kSqrt3, kWongB = kSqrt3;

// (1 + q²/2α)^{-α-n}.
double rational_power(double q, double alpha, int n) {
  return std::exp(-(alpha + n) * std::log1p(q * q / (2 * alpha)));
}

}  // namespace

double Radial::value(double q) const {
  switch (family) {
    case Family::constant:
      return 1;
    case Family::squared_exponential:
      return std::exp(-0.5 * q * q);
    case Family::matern12:
      return std::exp(-q);
    case Family::matern32:
      return (1 + kSqrt3 * q) * std::exp(-kSqrt3 * q);
    case Family::matern52:
      return (1 + kSqrt5 * q + 5 * q * q / 3) * std::exp(-kSqrt5 * q);
    case Family::rational_quadratic:
      return rational_power(q, alpha, 0);
    case Family::wong:
      return 1.5 * std::exp(-kWongA * q) - 0.5 * std::exp(-kWongB * q);
  }
  return 0;
}

double Radial::slope(double q) const {
  return family == Family::matern12 ? -std::exp(-q) : q * slope_over_q(q);
}

double Radial::slope_over_q(double q) const {
  switch (family) {
    case Family::constant:
      return 0;
    case Family::squared_exponential:
      return -std::exp(-0.5 * q * q);
    case Family::matern12:
      return -std::exp(-q) / q;
    case Family::matern32:
      return -3 * std::exp(-kSqrt3 * q);
    case Family::matern52:
      return -5.0 / 3 * (1 + kSqrt5 * q) * std::exp(-kSqrt5 * q);
    case Family::rational_quadratic:
      return -rational_power(q, alpha, 1);
    case Family::wong: {
      const double x = (kWongB - kWongA) * q;
      return std::exp(-kWongA * q) * (x == 0 ? -1 : std::expm1(-x) / x);
    }
  }
  return 0;
}

double Radial::value_and_slope_over_q(double q, double& slope) const {
  const double k = value(q);
  if (family == Family::squared_exponential)
    slope = -k;
  else if (family == Family::rational_quadratic)
    slope = -k / (1 + q * q / (2 * alpha));
  else
    slope = slope_over_q(q);
  return k;
}

double Radial::curvature(double q) const {
  return family == Family::matern12 ? std::exp(-q) : slope_over_q(q) + excess(q);
}

double Radial::excess(double q) const {
  switch (family) {
    case Family::constant:
      return 0;
    case Family::squared_exponential:
      return q * q * std::exp(-0.5 * q * q);
    case Family::matern12:
      return (1 + 1 / q) * std::exp(-q);
    case Family::matern32:
      return 3 * kSqrt3 * q * std::exp(-kSqrt3 * q);
    case Family::matern52:
      return 25.0 / 3 * q * q * std::exp(-kSqrt5 * q);
    case Family::rational_quadratic:
      return (1 + 1 / alpha) * q * q * rational_power(q, alpha, 2);
    case Family::wong:
      return 0.5 * std::exp(-kWongA * q) - 1.5 * std::exp(-kWongB * q) - slope_over_q(q);
  }
  return 0;
}

double Radial::psi2(double Q) const {
  const double q = std::sqrt(Q);
  switch (family) {
    case Family::constant:
      return 0;
    case Family::squared_exponential:
      return 0.25 * std::exp(-0.5 * Q);
    case Family::matern52:
      return 25.0 / 12 * std::exp(-kSqrt5 * q);
    case Family::rational_quadratic:
      return 0.25 * (1 + 1 / alpha) * rational_power(q, alpha, 2);
    case Family::matern32:
      return 0.75 * kSqrt3 / q * std::exp(-kSqrt3 * q);
    case Family::wong:
    case Family::matern12:
      return excess(q) / (4 * Q);
  }
  return 0;
}

double Radial::lambda2() const {
  switch (family) {
    case Family::constant:
      return 0;
    case Family::matern12:
      return kInfinity;
    case Family::matern32:
      return 3;
    case Family::matern52:
      return 5.0 / 3;
    case Family::squared_exponential:
    case Family::rational_quadratic:
    case Family::wong:
      return 1;
  }
  return 0;
}

double Radial::transverse(double q) const {
  if (family == Family::constant) return 1;
  return -slope_over_q(q) / lambda2();
}

}  // namespace gpis

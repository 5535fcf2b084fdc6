// Correlations κ(q) of one distance q >= 0 and their derivatives, in closed forms without
// cancellation. λ₂ = -κ''(0). A plain value: samplers keep copies.
#pragma once

#include "core/vec.h"

namespace gpis {

struct Radial {
  enum class Family {
    constant,
    squared_exponential,
    matern12,
    matern32,
    matern52,
    rational_quadratic,
    wong
  };
  Family family = Family::squared_exponential;
  double alpha = 1;  // of the rational quadratic alone

  double value(double q) const;
  double slope(double q) const;         // κ'
  double slope_over_q(double q) const;  // κ'/q, -λ₂ at 0
  // κ and κ'/q together, for little more than one of them.
  double value_and_slope_over_q(double q, double& slope_over_q) const;
  double curvature(double q) const;  // κ''
  double excess(double q) const;     // κ'' - κ'/q, 0 at 0 where differentiable

  // ψ(Q) = κ(√Q) (formulas C10): ψ' = κ'/(2q) and ψ'' = (κ'' - κ'/q)/(4q²). ψ'' grows as 1/q at 0
  // for Matérn 3/2 and Wong, whose third derivative jumps there: only its product with something
  // of order q² is meant.
  double psi1(double Q) const { return 0.5 * slope_over_q(std::sqrt(Q)); }
  double psi2(double Q) const;

  double lambda2() const;  // infinite for Matérn 1/2, 0 for a constant
  // Correlation of transverse slopes, c(q) = -κ'(q)/(q λ₂) (math.md §4).
  double transverse(double q) const;

  bool differentiable() const { return family != Family::matern12; }
  // Decaying spectrum: the samplers 1, 3 and 4 may serve it.
  bool smooth() const {
    return family == Family::constant || family == Family::squared_exponential ||
           family == Family::rational_quadratic;
  }
  // A finite state suffices on a line: sampler 2.
  bool markov() const { return !smooth(); }
};

}  // namespace gpis

// Random starts of a line: the truncated normal and the flux-weighted normal (formulas C5, C6).
// Both are exact for every a.
#include <cmath>

#include "process/surface.h"

namespace gpis {

double truncated_normal(double a, Rng& rng) {
  if (a < 0.5) {  // acceptance Φ(-a) > .3
    for (;;) {
      const double z = rng.normal();
      if (z > a) return z;
    }
  }
  for (;;) {  // Marsaglia's tail method: never fails, however far out a is
    const double z = std::sqrt(a * a - 2 * std::log(rng.positive_uniform()));
    if (rng.positive_uniform() * z < a) return std::max(z, std::nextafter(a, kInfinity));
  }
}

double flux_weighted_normal(double a, Rng& rng) {
  if (a <= 0) {
    // Gamma(2)/λ proposal, λ the mode's reciprocal scale; acceptance >= .73. For a -> -inf (-a +
    // √(a²+8))/2 -> -a: no cancellation.
    const double lambda = (-a + std::sqrt(a * a + 8)) / 2;
    for (;;) {
      const double z = -std::log(rng.positive_uniform() * rng.positive_uniform()) / lambda;
      const double r = z - a - lambda;
      if (rng.uniform() < std::exp(-r * r / 2)) return z;
    }
  }
  // z = a + y with density (a + y)₊ φ(y) <= (a + |y|) φ(y): a mixture of a normal and a signed
  // Rayleigh.
  const double p = a / (a + std::sqrt(2 / kPi));
  for (;;) {
    double y;
    if (rng.uniform() < p) {
      y = rng.normal();
    } else {
      y = std::sqrt(-2 * std::log(rng.positive_uniform()));
      if (rng() >> 63) y = -y;
    }
    if (y > -a && rng.uniform() * (a + std::abs(y)) < a + y) return a + y;
  }
}

}  // namespace gpis

// Random starts of a line: truncated normals and the flux-weighted normal (formulas C5, C6), exact
// however far out they lie.
#include <algorithm>
#include <cmath>

#include "process/surface.h"

namespace gpis {
namespace {

constexpr double kFarthest = 1e300;  // in deviations: sums and products of a few stay finite

}  // namespace

double truncated_normal(double a, Rng& rng) {
  if (a < 0.5) {  // acceptance Φ(-a) > .3
    for (;;) {
      const double z = rng.normal();
      if (z > a) return z;
    }
  }
  // From here on, 1/a beyond a is below what a double tells apart; squares end at 1e154.
  if (a > 1e9) return std::nextafter(std::min(a, kFarthest), kInfinity);
  for (;;) {  // Marsaglia's tail method: never fails, however far out a is
    const double z = std::sqrt(a * a - 2 * std::log(rng.positive_uniform()));
    if (rng.positive_uniform() * z < a) return std::max(z, std::nextafter(a, kInfinity));
  }
}

double truncated_normal(double low, double high, Rng& rng) {
  if (high == kInfinity) return truncated_normal(low, rng);
  if (low < 0 && high <= -low) return -truncated_normal(-high, -low, rng);
  // Now the interval lies right of 0, or reaches further to the right: it falls off by e^{-1} or
  // less (uniform proposals), or holds most of the tail above `low` (acceptance > .6).
  const double width = high - low, nearest = std::max(low, 0.0);
  const bool flat = std::max(high, -low) * std::max(high, -low) - nearest * nearest < 2;
  for (;;) {
    const double z = flat ? low + width * rng.uniform() : truncated_normal(low, rng);
    if (!(z > low && z < high)) continue;
    if (!flat || rng.uniform() < std::exp(0.5 * (nearest - z) * (nearest + z))) return z;
  }
}

double log_normal_tail(double a) {
  if (a < 30) return std::log(0.5 * std::erfc(a / std::sqrt(2)));
  const double r = 1 / (a * a);  // asymptotic series, 2e-12 at 30
  return -0.5 * a * a - std::log(a * std::sqrt(2 * kPi)) +
         std::log1p(-r * (1 - 3 * r * (1 - 5 * r * (1 - 7 * r))));
}

double flux_weighted_normal(double a, Rng& rng) {
  a = std::clamp(a, -kFarthest, kFarthest);
  if (a <= 0) {
    // Gamma(2)/λ proposal, λ the mode's reciprocal scale; acceptance >= .73. For a -> -inf (-a +
    // √(a²+8))/2 -> -a: no cancellation.
    const double lambda = (-a + std::hypot(a, std::sqrt(8))) / 2;
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

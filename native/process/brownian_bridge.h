// An integrated Brownian motion (g' = √q W) between two points where its value and slope are known:
// the law of rough paths (Matérn 3/2, Wong) over intervals so short that nothing else shows.
#pragma once

#include <cmath>

#include "core/rng.h"
#include "process/bracket.h"

namespace gpis {

// Value and slope per t at t.
struct BridgePoint {
  double t, g, dg;
};

// On the cubic through both: the mean of the bridge.
inline BridgePoint cubic_between(const BridgePoint& a, const BridgePoint& b, double t) {
  const Cubic cubic(a.t, a.g, a.dg, b.t, b.g, b.dg);
  return {t, cubic.value(t), cubic.slope(t)};
}

// A draw at t. The inverse of the precisions from both sides, Q⁻¹ = 12/(q u³) [1, -u/2; ·, u²/3]:
//   Var g = q h³ s³r³/3,  Cov(g, g') = q h² s²r²(r - s)/2,  Var g' = q h sr(1 - 3sr).
inline BridgePoint draw_between(const BridgePoint& a, const BridgePoint& b, double intensity,
                                double t, Rng& rng) {
  const double h = b.t - a.t, s = (t - a.t) / h, r = (b.t - t) / h;
  BridgePoint p = cubic_between(a, b, t);
  const double slope = std::sqrt(intensity * h * s * r), z = rng.normal();
  p.g += slope * h * s * r / std::sqrt(3.0) * z;
  p.dg += slope * (std::sqrt(0.75) * (r - s) * z + 0.5 * rng.normal());
  return p;
}

}  // namespace gpis

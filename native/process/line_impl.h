// One ray through one process: the sample path, what it was conditioned on, and where it ended.
#pragma once

#include <vector>

#include "process/convolution_path.h"
#include "process/dense_path.h"
#include "process/surface.h"

namespace gpis {

// σ = 0: the surface is the mean itself and nothing is drawn. Marches like the others.
class ZeroPath {
 public:
  static constexpr double kStep = 0.5;
  void reset(double, Counters&) {}
  void prepare(long, Rng&, Counters&) {}
  void at_left(long, double& g, double& dg) const { g = dg = 0; }
  void at_right(long, double& g, double& dg) const { g = dg = 0; }
  void at(long, double, double& g, double& dg) const { g = dg = 0; }
};

struct Line::Impl {
  // Object space. q = (t - anchor) · inverse_length is the distance from the first uncertain point
  // in length scales.
  Vec3 origin, direction;
  double inverse_length = 1, anchor = 0;
  Vec3 e1, e2, ed;  // orthonormal in whitened space, ed along the ray

  // Conditions at the anchor by Matheron's rule (math.md §5.1): g(q) += κ(q)(Δ₀ + qΔ₁).
  double delta_value = 0, delta_slope = 0;
  bool conditioned = false;
  // Remembered transverse slopes γ(0) (math.md §4); without them the prior's, of correlation 0 with
  // anything.
  double gamma1 = 0, gamma2 = 0;
  bool has_gamma = false;

  // Stretches of t on which the path was sampled, in increasing order.
  struct Stretch {
    double begin, end;
    long last_cell;
  };
  std::vector<Stretch> stretches;

  // The hit: fields and g by the piece and cell of the arriving side.
  double hit_t = kInfinity, hit_g = 0, hit_dg = 0;
  FieldSample hit_mean, hit_sigma;

  ConvolutionPath convolution;
  DensePath dense;
  ZeroPath zero;

  double q_of(double t) const { return (t - anchor) * inverse_length; }

  void condition(double q, double& g, double& dg) const {
    if (!conditioned || q > 9) return;  // exp(-q²/2) < 3e-18
    const double k = std::exp(-0.5 * q * q), x = delta_value + q * delta_slope;
    g += k * x;
    dg += k * (delta_slope - q * x);
  }
};

}  // namespace gpis

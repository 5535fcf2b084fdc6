#include "fit/blend_moments.h"

#include <array>
#include <vector>

#include "fit/gauss_legendre.h"

namespace gpis {
namespace {

// A normal variable lies beyond with a probability of 2e-17.
constexpr double kEdge = 8.5;
// Of the rule of 20 nodes: φ(z) times a polynomial of degree six to 1e-13; and short ones, each
// node of which stands for a part of the distribution.
constexpr double kPanel = 6.0, kShortPanel = 1.5;

// With z = (a - b - Δ)/ν, Δ = E[a - b]: a = E[a] + ca z + e and b = E[b] + cb z + e with one normal
// e that is independent of z, for the difference is known with z. So F = m(z) + e.
struct Difference {
  double mean_a, mean_b, ca, cb, nu, residual;  // variance of e
  double blend, center;

  Difference(const Jet& a, const Jet& b, double covariance, double k)
      : mean_a(a.mean), mean_b(b.mean), ca(0), cb(0), nu(0), residual(a.sigma * a.sigma), blend(k) {
    const double both = a.sigma * b.sigma, apart = a.sigma - b.sigma;
    const double r = both > 0 ? std::clamp(covariance / both, -1.0, 1.0) : 0.0;
    const double variance = apart * apart + 2 * both * (1 - r);
    // Else the two are one variable and a constant, and their difference is certain.
    if (std::sqrt(variance) > 1e-9 * std::max(a.sigma, b.sigma)) {
      nu = std::sqrt(variance);
      ca = a.sigma * (apart + b.sigma * (1 - r)) / nu;
      cb = b.sigma * (apart - a.sigma * (1 - r)) / nu;
      residual = both * both * (1 - r) * (1 + r) / variance;
    }
    center = value(0);
  }

  double delta(double z) const { return mean_a - mean_b + nu * z; }
  double share(double z) const { return std::clamp(0.5 + delta(z) / (2 * blend), 0.0, 1.0); }
  double value(double z) const {
    const double overlap = std::max(blend - std::abs(delta(z)), 0.0);
    return std::max(mean_a + ca * z, mean_b + cb * z) + overlap * (overlap / (4 * blend));
  }

  // visit(z, step, probability), in panels that end where F changes from one polynomial of z to
  // another.
  template <class Visit>
  void integrate(double panel, const Visit& visit) const {
    if (!(nu > 0)) return visit(0.0, 0.0, 1.0);
    const auto end = [&](double d) {
      return std::clamp((d - mean_a + mean_b) / nu, -kEdge, kEdge);
    };
    const double cuts[] = {-kEdge, end(-blend), end(blend), kEdge};
    for (int piece = 0; piece < 3; ++piece) {
      const double length = cuts[piece + 1] - cuts[piece];
      const int panels = static_cast<int>(std::ceil(length / panel));
      for (int i = 0; i < panels * gauss::kNodes; ++i) {
        const double at = i / gauss::kNodes + gauss::node(i % gauss::kNodes);
        const double z = cuts[piece] + length / panels * at;
        const double step = length / panels * gauss::weight(i % gauss::kNodes);
        visit(z, step, step * normal_density(z));
      }
    }
  }
};

// Φ by a table, to 1e-5: a distance to two digits takes ten thousand of them.
double quick_cdf(double x) {
  constexpr int kPerUnit = 64, kFrom = -6, kCount = 12 * kPerUnit;
  static const std::array<double, kCount + 2> table = [] {
    std::array<double, kCount + 2> t;
    for (int i = 0; i <= kCount + 1; ++i) t[i] = normal_cdf(kFrom + i / double(kPerUnit));
    return t;
  }();
  const double at = (std::clamp(x, double(kFrom), -double(kFrom)) - kFrom) * kPerUnit;
  const int i = static_cast<int>(at);
  return table[i] + (at - i) * (table[i + 1] - table[i]);
}

double kolmogorov(const Difference& d, double mean, double deviation, bool certain_a,
                  bool certain_b) {
  if (!(deviation > 0)) return 0;
  struct Part {
    double probability, value, per_deviation;
  };
  thread_local std::vector<Part> parts;
  parts.clear();
  d.integrate(kShortPanel, [&](double z, double step, double probability) {
    if (probability < 1e-8) return;
    // The node stands for values that are spread over its part of z.
    const double rise = step * (d.share(z) * d.ca + (1 - d.share(z)) * d.cb);
    const double s = std::sqrt(d.residual + rise * rise / 12);
    parts.push_back({probability, d.value(z), 1 / std::max(s, 1e-12 * deviation)});
  });
  const auto off = [&](double x) {
    double below = 0;
    for (const Part& part : parts)
      below += part.probability * quick_cdf((x - part.value) * part.per_deviation);
    return std::abs(below - normal_cdf((x - mean) / deviation));
  };
  double most = 0;
  for (int i = -32; i <= 32; ++i) most = std::max(most, off(mean + deviation * i / 8.0));
  // A certain operand is an atom of the distribution: the distance just below and on it.
  for (const double side : {-1e-9, 1e-9}) {
    if (certain_a) most = std::max(most, off(d.mean_a + side * deviation));
    if (certain_b) most = std::max(most, off(d.mean_b + side * deviation));
  }
  return most;
}

}  // namespace

Greatest smooth_greatest(const Jet& a, const Jet& b, double covariance, double blend, bool shape) {
  const Difference d(a, b, covariance, blend);
  const Vec3 beta_a = a.sigma > 0 ? a.sigma_gradient / a.sigma : Vec3{},
             beta_b = b.sigma > 0 ? b.sigma_gradient / b.sigma : Vec3{};
  double m1 = 0, m2 = 0, m3 = 0, share = 0, both_a = 0, both_b = 0, mixed = 0;
  Vec3 gradient, with_value;
  SymMat3 second;
  d.integrate(kPanel, [&](double z, double, double p) {
    const double m = d.value(z) - d.center, u = d.share(z), v = 1 - u;
    // E[∇F | z, e] = fixed + per_e e (fit/jet.h).
    const Vec3 fixed = (a.mean_gradient + beta_a * (d.ca * z)) * u +
                       (b.mean_gradient + beta_b * (d.cb * z)) * v,
               per_e = beta_a * u + beta_b * v;
    m1 += p * m;
    m2 += p * (m * m + d.residual);
    m3 += p * m * (m * m + 3 * d.residual);
    share += p * u;
    both_a += p * u * u;
    both_b += p * v * v;
    mixed += p * u * v;
    gradient += fixed * p;
    with_value += (fixed * m + per_e * d.residual) * p;
    second = second + (square(fixed) + square(per_e) * d.residual) * p;
  });
  // What ∇a and ∇b are besides: as much in common as their values have, of one kernel then.
  second = second + a.slopes * (a.sigma * a.sigma * both_a) +
           b.slopes * (b.sigma * b.sigma * both_b) + (a.slopes + b.slopes) * (covariance * mixed);

  Greatest out;
  out.mean = d.center + m1;
  out.variance = std::max(m2 - m1 * m1, 0.0);
  const double deviation = std::sqrt(out.variance);
  out.skewness =
      deviation > 0 ? (m3 - 3 * m1 * m2 + 2 * m1 * m1 * m1) / (out.variance * deviation) : 0;
  out.first_share = share;
  out.kolmogorov = shape ? kolmogorov(d, out.mean, deviation, a.sigma == 0, b.sigma == 0) : 0;
  out.jet = jet_of_moments(out.mean, out.variance, gradient, second - square(gradient),
                           with_value - gradient * m1, share > 0.5 ? a.slopes : b.slopes);
  return out;
}

}  // namespace gpis

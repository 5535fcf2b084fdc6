#include "fit/clark.h"

#include "fit/gauss_legendre.h"

namespace gpis {
namespace {

// P(X <= h, Y <= k) of two standard normals with correlation r: Plackett's integral over the
// correlation, in asin r (Drezner and Wesolowsky 1990).
double bivariate_cdf(double h, double k, double r) {
  if (r >= 1 - 1e-12) return normal_cdf(std::min(h, k));
  if (r <= -1 + 1e-12) return std::max(0.0, normal_cdf(h) - normal_cdf(-k));
  double sum = 0;
  if (r != 0) {
    const double angle = std::asin(r);
    for (int i = 0; i < gauss::kNodes; ++i) {
      const double s = std::sin(angle * gauss::node(i));
      sum += gauss::weight(i) * std::exp(-(h * h + k * k - 2 * h * k * s) / (2 * (1 - s * s)));
    }
    sum *= angle / (2 * kPi);
  }
  return std::clamp(normal_cdf(h) * normal_cdf(k) + sum, 0.0, 1.0);
}

// P(X <= x) of a normal that may be certain.
double standard(double x, const Jet& of) {
  if (of.sigma > 0) return (x - of.mean) / of.sigma;
  return x < of.mean ? -kInfinity : kInfinity;
}

double distance(const Jet& a, const Jet& b, double covariance, double mean, double deviation) {
  if (!(deviation > 0)) return 0;
  const bool certain = !(a.sigma > 0 && b.sigma > 0);
  const double r = certain ? 0 : std::clamp(covariance / (a.sigma * b.sigma), -1.0, 1.0);
  double most = 0, where = mean;
  const auto look_at = [&](double x) {
    const double h = std::clamp(standard(x, a), -40.0, 40.0),
                 k = std::clamp(standard(x, b), -40.0, 40.0);
    const double here = std::abs(bivariate_cdf(h, k, r) - normal_cdf((x - mean) / deviation));
    if (here > most) where = x;
    most = std::max(most, here);
  };
  // Then closer and closer to where it is largest: operands that move together have a kink there.
  const auto look_over = [&](double middle, double width) {
    for (int i = -32; i <= 32; ++i) look_at(middle + i / 8.0 * width);
    for (double step = width / 16; step > width / 200; step /= 2) {
      const double x = where;
      look_at(x - step);
      look_at(x + step);
    }
  };
  look_over(mean, deviation);
  // An operand that is far more certain than the whole falls between those points.
  for (const Jet* narrow : {&a, &b})
    if (narrow->sigma > 0 && narrow->sigma < 0.5 * deviation)
      look_over(narrow->mean, narrow->sigma);
  // A certain operand is an atom of the distribution: the distance just below and on it.
  for (const Jet* atom : {&a, &b})
    if (!(atom->sigma > 0)) {
      const double x = atom->mean, normal = normal_cdf((x - mean) / deviation);
      const Jet& other = atom == &a ? b : a;
      most = std::max({most, normal, std::abs(normal_cdf(standard(x, other)) - normal)});
    }
  return most;
}

// Moments of a variable X = m + c z + e over z > -alpha, z and e independent normals, e of variance
// v; about `center`.
struct Part {
  double probability, x1, x2, x3;  // E[(X - center)^k; wins]
  double d1, d2;                   // E[(X - m)^k; wins]
};

Part winning(double m, double c, double v, double alpha, double center) {
  const double i0 = normal_cdf(alpha), i1 = normal_density(alpha), i2 = i0 - alpha * i1,
               i3 = (alpha * alpha + 2) * i1;
  const double d1 = c * i1, d2 = c * c * i2 + v * i0, d3 = c * c * c * i3 + 3 * c * v * i1;
  const double s = m - center;
  return {i0,
          s * i0 + d1,
          s * s * i0 + 2 * s * d1 + d2,
          s * s * s * i0 + 3 * s * s * d1 + 3 * s * d2 + d3,
          d1,
          d2};
}

}  // namespace

double normal_cdf(double x) {
  return 0.5 * std::erfc(-x * std::sqrt(0.5));
}
double normal_density(double x) {
  return std::exp(-0.5 * x * x) / std::sqrt(2 * kPi);
}

Greatest greatest(const Jet& a, const Jet& b, double covariance, bool shape) {
  const double va = a.sigma * a.sigma, vb = b.sigma * b.sigma;
  // By the deviations, so that ν² keeps its digits where the two are almost one variable.
  const double r = va * vb > 0 ? std::clamp(covariance / (a.sigma * b.sigma), -1.0, 1.0) : 0.0;
  const double difference = a.sigma - b.sigma;
  const double nu = std::sqrt(difference * difference + 2 * a.sigma * b.sigma * (1 - r));
  const double delta = a.mean - b.mean;
  const double scale = std::max(a.sigma, b.sigma);
  // ν → 0: to first order in ν the greater mean wins for certain. Below 1e-9 of the deviations what
  // is left out is of order ν; a mean that is six deviations away changes nothing in ten digits.
  if (!(nu > 1e-9 * scale) || std::abs(delta) > 6 * nu) {
    const bool first = delta >= 0;
    const Jet& jet = first ? a : b;
    return {jet.mean, jet.sigma * jet.sigma, 0, 0, first ? 1.0 : 0.0, jet};
  }
  const double alpha = delta / nu;
  // a - b = delta + ν z; a and b regressed on z.
  const double ca = a.sigma * (difference + b.sigma * (1 - r)) / nu,
               cb = b.sigma * (difference - a.sigma * (1 - r)) / nu;
  const double ra = std::max(va - ca * ca, 0.0), rb = std::max(vb - cb * cb, 0.0);
  const double center = a.mean * normal_cdf(alpha) + b.mean * normal_cdf(-alpha);
  const Part wa = winning(a.mean, ca, ra, alpha, center),
             wb = winning(b.mean, -cb, rb, -alpha, center);

  Greatest out;
  const double m1 = wa.x1 + wb.x1, m2 = wa.x2 + wb.x2, m3 = wa.x3 + wb.x3;
  out.mean = center + m1;
  out.variance = std::max(m2 - m1 * m1, 0.0);
  const double deviation = std::sqrt(out.variance);
  out.skewness =
      deviation > 0 ? (m3 - 3 * m1 * m2 + 2 * m1 * m1 * m1) / (out.variance * deviation) : 0;
  out.first_share = wa.probability;
  out.kolmogorov = shape ? distance(a, b, covariance, out.mean, deviation) : 0;

  // ∇f = γ + β (X - m) + a part of covariance R that is independent of all values.
  Vec3 gradient, with_value;
  SymMat3 second;
  for (const bool first : {true, false}) {
    const Jet& jet = first ? a : b;
    const Part& w = first ? wa : wb;
    const Vec3 gamma = jet.mean_gradient,
               beta = jet.sigma > 0 ? jet.sigma_gradient / jet.sigma : Vec3{};
    gradient += gamma * w.probability + beta * w.d1;
    with_value += gamma * w.x1 + beta * (w.d2 + (jet.mean - center) * w.d1);
    second = second + square(gamma) * w.probability + symmetric_product(gamma, beta) * w.d1 +
             square(beta) * w.d2 + jet.slopes * (jet.sigma * jet.sigma * w.probability);
  }
  out.jet = jet_of_moments(out.mean, out.variance, gradient, second - square(gradient),
                           with_value - gradient * m1, wa.probability > 0.5 ? a.slopes : b.slopes);
  return out;
}

}  // namespace gpis

#include "process/scale_mixture.h"

#include "field/check.h"

namespace gpis {
namespace {

constexpr double kBound = 5e-4;        // of the correlation
constexpr double kSlopeBound = 2e-3;   // of the variance of slopes, relative
constexpr double kEnd = 0.5 * kBound;  // share of the variance of the lengths lumped at an end
constexpr std::size_t kMostParts = 40;

// Of ln x, x ~ Gamma(a, rate a).
double gamma_density(double a, double x) {
  return x > 0 ? std::exp(a * (std::log(a * x) - x) - std::lgamma(a)) : 0;
}

// Of ln s. Wong's e^{-cq} are Matérn 1/2, of s/c²; the difference is not negative.
double density(const Radial& radial, double s) {
  switch (radial.family) {
    case Radial::Family::matern12:
      return gamma_density(0.5, s);
    case Radial::Family::matern32:
      return gamma_density(1.5, s);
    case Radial::Family::matern52:
      return gamma_density(2.5, s);
    case Radial::Family::wong:
      return 1.5 * gamma_density(0.5, s / 3) - 0.5 * gamma_density(0.5, 3 * s);
    case Radial::Family::rational_quadratic:
      return gamma_density(radial.alpha, 1 / s);
    default:
      refuse("No mixture of squared exponentials of many lengths is known of this correlation.");
  }
}

// The trapezoidal rule in ln s; the shortest lengths, of kEnd in all, are one of the same
// variance of slopes (where that is finite), the longest one of the next.
std::vector<ScaleMixture::Part> quadrature(const Radial& radial, double spacing) {
  struct Node {
    double weight, s;
  };
  const double a = radial.family == Radial::Family::rational_quadratic ? radial.alpha : 0.5;
  const double farthest = 40 / std::min(a, 1.0);
  std::vector<Node> nodes;
  double sum = 0;
  for (double u = -std::floor(40 / spacing) * spacing; u < farthest; u += spacing) {
    nodes.push_back({spacing * density(radial, std::exp(u)), std::exp(u)});
    sum += nodes.back().weight;
  }
  for (Node& node : nodes) node.weight /= sum;
  while (nodes.size() > 1 && nodes.back().weight < kEnd) {
    nodes[nodes.size() - 2].weight += nodes.back().weight;
    nodes.pop_back();
  }
  std::size_t first = 0;
  double weight = 0, slopes = 0;
  for (; weight + nodes[first].weight < kEnd; ++first) {
    weight += nodes[first].weight;
    slopes += nodes[first].weight / nodes[first].s;
  }
  std::vector<ScaleMixture::Part> parts;
  if (weight > 0)
    parts.push_back({weight, std::sqrt(radial.differentiable() ? weight / slopes
                                                               : nodes[first].s / std::exp(1.0))});
  for (; first < nodes.size(); ++first)
    parts.push_back({nodes[first].weight, std::sqrt(nodes[first].s)});
  return parts;
}

}  // namespace

ScaleMixture scale_mixture(const Radial& radial) {
  if (radial.family == Radial::Family::squared_exponential) return {{{1, 1}}, 0};
  ScaleMixture mixture;
  for (double spacing = 1.2; spacing > 0.1; spacing *= 0.9) {
    mixture.parts = quadrature(radial, spacing);
    if (mixture.parts.size() > kMostParts) break;
    mixture.error = 0;
    double slopes = 0;
    for (const auto& [weight, length] : mixture.parts) slopes += weight / (length * length);
    const double from = 0.01 * mixture.parts.front().length;
    const double to = 20 * mixture.parts.back().length;
    for (double q = from; q < to; q *= 1.05) {
      double sum = 0;
      for (const auto& [weight, length] : mixture.parts)
        sum += weight * std::exp(-0.5 * q * q / (length * length));
      mixture.error = std::max(mixture.error, std::abs(sum - radial.value(q)));
    }
    if (mixture.error <= kBound &&
        (!radial.differentiable() || std::abs(slopes / radial.lambda2() - 1) <= kSlopeBound))
      return mixture;
  }
  refuse("A realisation under an anisotropy does not reach a rational quadratic kernel of alpha ",
         radial.alpha, ": take a larger alpha.");
}

}  // namespace gpis

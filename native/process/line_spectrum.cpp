#include "process/line_spectrum.h"

#include "field/check.h"

namespace gpis {
namespace {

constexpr std::size_t kMostFrequencies = 4096;
constexpr double kBound = 1e-5, kRationalBound = 3e-5;  // of the correlation
constexpr double kSlopeBound = 1e-4;                    // of the variance of slopes, relative
constexpr double kTail = 2e-7;  // of the variance, left out at high frequencies

// A Gaussian mixture over 1/ℓ² = τ: κ(q) = Σ w e^{-τq²/2}, whose line spectrum is
// Σ w √(2/(πτ)) e^{-ω²/2τ} on ω > 0. One component for the squared exponential.
struct Mixture {
  std::vector<double> tau, weight;

  double density(double omega) const {
    double sum = 0;
    for (std::size_t i = 0; i < tau.size(); ++i)
      sum += weight[i] * std::sqrt(2 / (kPi * tau[i])) * std::exp(-0.5 * omega * omega / tau[i]);
    return sum;
  }
  // Shares of the variance, and of the variance of slopes, above a frequency.
  double tail(double omega, bool of_slopes) const {
    double sum = 0;
    for (std::size_t i = 0; i < tau.size(); ++i) {
      const double x = omega / std::sqrt(2 * tau[i]);
      const double above = std::erfc(x);
      sum += weight[i] *
             (of_slopes ? tau[i] * (above + 2 / std::sqrt(kPi) * x * std::exp(-x * x)) : above);
    }
    return sum;
  }
};

// RQ: τ ~ Gamma(α, rate α), by the trapezoidal rule in log τ, whose integrand is analytic and falls
// off doubly exponentially above. Below it falls as τ^α, a geometric series: what lies below 1e-14
// turns nowhere within any reach and is summed at once; the weights listed do not hold it.
Mixture mixture(const Radial& radial) {
  if (radial.family == Radial::Family::squared_exponential) return {{1}, {1}};
  const double a = radial.alpha, spacing = std::min(0.2, 0.4 / std::sqrt(a));
  const double lowest = -std::sqrt(90 / a) - 46 / a, still = std::log(1e-14);
  const double from = std::max(lowest, still);
  const double to = std::log1p(std::sqrt(90 / a) + 46 / a);
  Mixture m;
  double sum = lowest < still ? std::exp(a * (from + 1)) / std::expm1(a * spacing) : 0;
  for (double s = from; s <= to; s += spacing) {
    // (ατ)^α e^{-ατ}, its maximum scaled to 1 so that a large α does not overflow.
    m.tau.push_back(std::exp(s));
    m.weight.push_back(std::exp(a * (s + 1 - m.tau.back())));
    sum += m.weight.back();
  }
  for (double& w : m.weight) w /= sum;
  return m;
}

double highest_frequency(const Mixture& m, double lambda2) {
  double omega = 4;
  while (m.tail(omega, false) > kTail || m.tail(omega, true) > 0.5 * kSlopeBound * lambda2)
    omega *= 1.03;
  return omega;
}

// Midpoints: the error is that of the images at multiples of 2π/spacing, all but nothing within
// the reach.
void place_evenly(const Mixture& m, double spacing, double highest, LineSpectrum& out) {
  for (double omega = 0.5 * spacing; omega < highest; omega += spacing) {
    out.frequency.push_back(omega);
    out.weight.push_back(spacing * m.density(omega));
  }
}

// ω = Δ ln(1 + e^k) at integers k: even at high frequencies, in geometric steps at low ones, where
// the density of a long memory has a singularity. What turns by less than 1e-3 within the reach is
// one constant.
void place_graded(const Mixture& m, double spacing, double highest, LineSpectrum& out) {
  double constant = 0;
  const int last = static_cast<int>(std::ceil(highest / spacing));
  for (int k = last; k > -100000; --k) {
    const double e = std::exp(-std::abs(static_cast<double>(k)));
    const double omega = spacing * (k > 0 ? k + std::log1p(e) : std::log1p(e));
    if (omega * out.reach < 1e-3) break;
    out.frequency.push_back(omega);
    out.weight.push_back(spacing * m.density(omega) / (1 + (k > 0 ? e : 1 / e)));
    constant += out.weight.back();
  }
  out.frequency.push_back(0);
  out.weight.push_back(1 - constant);
}

// Weights to sum 1, then the error on lags so dense that no wave turns by more than .4 between two.
void certify(const Radial& radial, double highest, LineSpectrum& s) {
  double sum = 0;
  for (double w : s.weight) sum += w;
  s.slope_variance = 0;
  const std::size_t n = s.weight.size();
  for (std::size_t i = 0; i < n; ++i) {
    s.weight[i] /= sum;
    s.slope_variance += s.weight[i] * s.frequency[i] * s.frequency[i];
  }
  const int lags = static_cast<int>(std::ceil(s.reach * highest / 0.4));
  const double step = s.reach / lags;
  std::vector<double> c(s.weight), v(n, 0.0), turn_c(n), turn_s(n);
  for (std::size_t i = 0; i < n; ++i) {
    turn_c[i] = std::cos(s.frequency[i] * step);
    turn_s[i] = std::sin(s.frequency[i] * step);
  }
  s.error = 0;
  for (int lag = 1; lag <= lags; ++lag) {
    double correlation = 0;
    for (std::size_t i = 0; i < n; ++i) {
      const double turned = c[i] * turn_c[i] - v[i] * turn_s[i];
      v[i] = c[i] * turn_s[i] + v[i] * turn_c[i];
      c[i] = turned;
      correlation += turned;
    }
    s.error = std::max(s.error, std::abs(correlation - radial.value(lag * step)));
  }
}

}  // namespace

std::optional<LineSpectrum> line_spectrum(const Radial& radial, double reach) {
  LineSpectrum s;
  s.reach = reach;
  if (radial.family == Radial::Family::constant) {
    s.frequency = {0};
    s.weight = {1};
    return s;
  }
  if (!radial.smooth())
    refuse("The spectral sampler serves kernels with a decaying spectrum: take the Markov one.");
  const bool rational = radial.family == Radial::Family::rational_quadratic;
  const Mixture m = mixture(radial);
  const double highest = highest_frequency(m, radial.lambda2());
  const double bound = rational ? kRationalBound : kBound;
  double spacing = rational ? 4 / reach : 2 * kPi / (reach + 4.5);
  for (;; spacing *= 0.9) {
    s.frequency.clear();
    s.weight.clear();
    if (highest / spacing > kMostFrequencies) return std::nullopt;
    (rational ? place_graded : place_evenly)(m, spacing, highest, s);
    certify(radial, highest, s);
    if (s.error <= bound && std::abs(s.slope_variance - radial.lambda2()) <= kSlopeBound) return s;
  }
}

}  // namespace gpis

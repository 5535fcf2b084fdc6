// Sampler 1, line convolution (math.md §5.1): in units of the length scale along the ray,
//   g(q) = Σ_j φ(q - jh) ξ_j,  φ(u) = (2/π)^¼ √h exp(-u²),  ξ_j iid N(0,1),
// exactly Gaussian, random access, no linear solve. h = ½ and nodes within ±4 give the correlation
// exp(-q²/2) to 9e-8.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <vector>

#include "process/gaussian_process.h"
#include "process/radial_line.h"

namespace gpis {

class ConvolutionPath {
 public:
  static constexpr int kStride = 2;
  struct Plan {
    Plan(const GaussianProcess& process, const Box3& bounds);
    double correlation_error = 9e-8;
    RadialLine::Plan line;
  };

  void reset(const Plan& plan, const LineGeometry& line, double anchor, double, Counters&) {
    line_.reset(plan.line, line, anchor);
    step_ = kStep / line_.inverse_length();
    const double h2 = line_.inverse_length() * line_.inverse_length();
    deviation_ = kDeviation * h2 * h2;
    conditioned_ = false;
    drawn_ = 0;
    runs_.clear();
  }

  double step() const { return step_; }
  double last_step() const { return 1e-5; }
  double value_mean() const { return 0; }
  double value_deviation() const { return 1; }
  void slope_law(double, double& mean, double& deviation) const {
    mean = 0;
    deviation = line_.slope_deviation();
  }

  void start_free(Rng& rng, Counters& counters, double& g, double& dg) {
    prepare(0, rng, counters);
    at_left(0, g, dg);
  }

  // By Matheron's rule (math.md §5.1): g(q) += κ(q)(Δ₀ + qΔ₁).
  double start(const PathStart& known, Rng& rng, Counters& counters) {
    prepare(0, rng, counters);
    double g, dg;
    at(0, line_.anchor(), rng, g, dg);
    conditioned_ = true;
    expanded_ = false;
    value_ = known.value;
    delta_value_ = known.value - g;
    // Conditioned on the value alone, g - ĝ = κ(q)(g₀ - ĝ(0)) has no slope at q = 0.
    const double slope = known.slope_known ? known.slope : dg;
    delta_slope_ = line_.per_length(slope - dg);
    slope_ = line_.per_length(slope);
    if (known.gradient_known) line_.remember(known.gradient);
    // max κ = 1, max qκ = .607.
    pull_ = std::max(0.0, -known.value) + 0.61 * std::max(0.0, -line_.per_length(slope));
    return slope;
  }
  double pull(double t) const { return conditioned_ && line_.q(t) < 6 ? pull_ : 0; }

  // Draw what the cell [kh, (k+1)h) needs. Cells come in increasing order; a gap wider than the
  // kernel starts a new run.
  void prepare(long cell, Rng& rng, Counters& counters) {
    const long first = cell - 7, last = cell + 8;
    if (runs_.empty() || first > end(runs_.back())) runs_.push_back({first, drawn_});
    const long missing = last + 1 - end(runs_.back());
    if (missing <= 0) return;
    counters.line_normals += missing;
    if (drawn_ + missing > nodes_.size()) nodes_.resize(2 * (drawn_ + missing));
    rng.normals(nodes_.data() + drawn_, missing);
    drawn_ += missing;
  }

  // At the ends of a cell, q = kh and (k+1)h: fixed weights. The node at distance 4 is left out on
  // both sides, so that neighbouring cells agree to the last bit.
  void at_left(long cell, double& g, double& dg) const {
    ends(cell, kTable.left, g, dg);
    condition_end(cell, g, dg);
  }
  void at_right(long cell, double& g, double& dg) const {
    ends(cell, kTable.right, g, dg);
    condition_end(cell + 1, g, dg);
  }

  // Anywhere in [kh, (k+1)h], by ONE node set for the whole cell (definitions E5). The weights
  // follow from two exponentials: e^{-(x-s)²} = e^{-x²} e^{2xs} e^{-s²}.
  void at(long cell, double t, Rng&, double& g, double& dg) {
    const double q = line_.q(t), x = q - cell * kStep;
    if (conditioned_ && q < kNear) return at_near(q, g, dg);
    const double up = std::exp(2 * kStep * x), down = 1 / up;
    double power[kNodes];  // by twos, so that products need not wait for each other
    power[7] = std::exp(-x * x);
    power[8] = power[7] * up;
    power[6] = power[7] * down;
    for (int i = 9; i < kNodes; ++i) power[i] = power[i - 2] * (up * up);
    for (int i = 5; i >= 0; --i) power[i] = power[i + 2] * (down * down);
    const Eigen::Array<double, kNodes, 1> w =
        Eigen::Map<const Eigen::Array<double, kNodes, 1>>(power) * kTable.gauss *
        window(cell).array();
    const double sum = w.sum();
    const double moment = (w * kTable.node).sum();
    g = sum;
    dg = -2 * (x * sum - moment);
    condition(q, g, dg);
  }

  double deviation(double h) const { return deviation_ * (h * h) * (h * h); }
  PathGradient gradient(double t, double, double dg, Rng&) const { return line_.gradient(t, dg); }

 private:
  static constexpr double kStep = 0.5;  // h, also the march's natural step
  static constexpr int kNodes = 16;     // nodes in reach of one cell [kh, (k+1)h): k-7 … k+8
  // The cubic is off by u²(h-u)² |g''''| / 24 <= (4/3)(B₁+B₂) (h/2)⁴ |g''''| / 24, and 4.5 standard
  // deviations of g'''' are 4.5 √105.
  static constexpr double kDeviation = 0.16;
  // Where the expansion about a known start serves, to rounding.
  static constexpr double kNear = 0.03;
  static constexpr int kTerms = 7;
  // exp(-q²/2) < 3e-18 beyond.
  static constexpr double kReach = 9;
  static constexpr int kEnds = 19;  // of cells within reach

  struct Run {
    long first;
    std::size_t offset;
  };
  using Window = Eigen::Map<const Eigen::Matrix<double, kNodes, 1>>;

  using Weights = Eigen::Matrix<double, kNodes, 1>;
  struct End {
    Weights value, slope;
  };
  struct Table {
    Eigen::Array<double, kNodes, 1> node, gauss;
    End left, right;
    std::array<double, kEnds> decay;  // exp(-q²/2) at the ends of cells

    Table() {
      for (int i = 0; i < kEnds; ++i) decay[i] = std::exp(-0.5 * (i * kStep) * (i * kStep));
      const double scale = std::pow(2 / kPi, 0.25) * std::sqrt(kStep);
      for (int i = 0; i < kNodes; ++i) {
        node[i] = (i - 7) * kStep;
        gauss[i] = scale * std::exp(-node[i] * node[i]);
        weigh(left, i, node[i], scale);
        weigh(right, i, node[i] - kStep, scale);
      }
    }
    static void weigh(End& end, int i, double s, double scale) {
      end.value[i] = std::abs(s) < 4 ? scale * std::exp(-s * s) : 0;
      end.slope[i] = 2 * s * end.value[i];
    }
  };
  inline static const Table kTable;

  // One past the last node drawn, as the run that is still growing knows it.
  long end(const Run& run) const { return run.first + static_cast<long>(drawn_ - run.offset); }

  void ends(long cell, const End& weights, double& g, double& dg) const {
    const Window xi = window(cell);
    g = xi.dot(weights.value);
    dg = xi.dot(weights.slope);
  }

  // Close to a known start, what the path adds to it is far smaller than its parts (oracle 8):
  //   g = e^{-q²/2} [g₀ + g₀'q + Σ_{n>=2} qⁿ/n! Σ_j φ(s_j) ξ_j He_n(2s_j)],
  // from the generating function e^{2sq - q²/2} = Σ He_n(2s) qⁿ/n! of Hermite's polynomials.
  void at_near(double q, double& g, double& dg) {
    if (!expanded_) expand();
    double sum = 0, slope = 0;  // Horner
    for (int n = kTerms - 1; n >= 0; --n) {
      sum = sum * q + moments_[n];
      slope = slope * q + (n + 2) * moments_[n];
    }
    const double k = std::exp(-0.5 * q * q), bracket = value_ + q * (slope_ + q * sum);
    g = k * bracket;
    dg = k * (slope_ + q * slope - q * bracket) * line_.inverse_length();
  }

  void expand() {
    expanded_ = true;
    const Window xi = window(0);
    moments_.fill(0);
    for (int i = 0; i < kNodes; ++i) {
      const double x = 2 * kTable.node[i], w = kTable.gauss[i] * xi[i];
      double before = 1, now = x, factorial = 1;
      for (int n = 2; n < kTerms + 2; ++n) {
        const double next = x * now - (n - 1) * before;
        before = now;
        now = next;
        factorial *= n;
        moments_[n - 2] += w * now / factorial;
      }
    }
  }

  // From here on derivatives are per t.
  void condition(double q, double& g, double& dg) const {
    if (conditioned_ && q <= kReach) add_start(q, std::exp(-0.5 * q * q), g, dg);
    dg *= line_.inverse_length();
  }
  void condition_end(long end, double& g, double& dg) const {
    if (conditioned_ && end < kEnds) add_start(end * kStep, kTable.decay[end], g, dg);
    dg *= line_.inverse_length();
  }
  void add_start(double q, double k, double& g, double& dg) const {
    const double x = delta_value_ + q * delta_slope_;
    g += k * x;
    dg += k * (delta_slope_ - q * x);
  }

  Window window(long cell) const {
    const long first = cell - 7;
    std::size_t r = runs_.size() - 1;
    while (runs_[r].first > first) --r;  // earlier runs only when an older point is asked for
    return Window(nodes_.data() + runs_[r].offset + (first - runs_[r].first));
  }

  RadialLine line_;
  double step_ = 1, deviation_ = 0, pull_ = 0;
  double delta_value_ = 0, delta_slope_ = 0;
  bool conditioned_ = false;
  double value_ = 0, slope_ = 0;  // of a known start, per length scale
  std::array<double, kTerms> moments_{};
  bool expanded_ = false;
  std::vector<double> nodes_;  // room for more than are drawn
  std::size_t drawn_ = 0;
  std::vector<Run> runs_;
};
static_assert(LinePath<ConvolutionPath>);

}  // namespace gpis

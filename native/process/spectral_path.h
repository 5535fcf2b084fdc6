// Sampler 3, spectral: g is a sum of plane waves of random amplitudes, at the frequencies of a
// quadrature of the spectrum that the kernel has on the line (formulas C8, C9). A term
// w κ(q) cos(k·r) gives two waves for each frequency ω of κ, with the wave vectors
//   V = ω E ± k,  E = Bᵀe_d  (so that d·V = ω/ℓ_d ± d·k),
// an unmodulated one gives one. g = Σ A cos(d·V τ) + B sin(d·V τ), τ the distance from the anchor,
// has exactly the gradient Σ V (B cos - A sin) in the plane of d and k; slopes across the line
// are normals of their own, kept per term (definitions E2). All conditioning (Matheron) is a shift
// of the amplitudes, so it costs nothing at an evaluation.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "process/gaussian_process.h"
#include "process/line_spectrum.h"
#include "process/near_start.h"
#include "process/path.h"

namespace gpis {

class SpectralPath {
 public:
  static constexpr int kStride = 1;
  struct Plan {
    Plan(const GaussianProcess& process, const Box3& bounds);
    Plan(const std::vector<Term>& terms, const Box3& bounds);

    struct Component {
      Term term;
      std::size_t table;  // of its radial part
    };
    // Spectra of one radial part, for longer and longer lines.
    using Table = std::vector<LineSpectrum>;
    std::vector<Component> components;
    std::vector<Table> tables;
    double variance = 0;
    double correlation_error = 0;
    // Length scales after which a line comes to repeat itself; infinite where none is longer.
    double reach = kInfinity;
    double known_share = 1;  // of the way across finite bounds, before that
  };

  void reset(const Plan& plan, const LineGeometry& line, double anchor, double t_end,
             Counters& counters);

  double step() const { return step_; }
  double last_step() const { return 1e-5; }
  // After a reset: shorter cells than its own, where paths that are added up share them.
  void shorten(double step) {
    step_ = step;
    turn_by(step_, step_cos_, step_sin_);
  }
  double value_mean() const { return 0; }
  double value_deviation() const { return std::sqrt(plan_->variance); }
  void slope_law(double, double& mean, double& deviation) const {
    mean = 0;  // value and slope of a stationary process are independent at a point
    deviation = std::sqrt(slope_variance_);
  }

  void start_free(Rng& rng, Counters& counters, double& g, double& dg);
  double start(const PathStart& known, Rng& rng, Counters& counters);
  double pull(double) const { return pull_; }

  void prepare(long cell, Rng& rng, Counters& counters);
  void at_right(long cell, double& g, double& dg);
  void at(long, double t, Rng&, double& g, double& dg) { evaluate(t, g, dg); }

  double deviation(double h) const { return deviation_ * (h * h) * (h * h); }
  PathGradient gradient(double t, double, double, Rng&);

 private:
  using Array = Eigen::ArrayXd;

  // One term on this line. Its waves stand at [first, first + count) for +k and, if modulated,
  // [first + count, first + 2 count) for -k.
  struct TermLine {
    const Term* term;
    const LineSpectrum* spectrum;  // null: constant along the line, one wave
    Eigen::Index first, count;
    bool paired;            // waves for +k and -k
    double inverse_length;  // 1/ℓ_d per t
    double turn;            // d·k
    Vec3 along;             // E
    Vec3 across[3];         // gradient per unit normal; the third where nothing changes along d
    double normal_cos[3], normal_sin[3];  // remembered at the anchor, in phase with cos θ and sin θ
    double pull_value, pull_slope, pull_turned;
  };

  void place(const Plan::Component& component, const Vec3& direction, double reach,
             Counters& counters);
  void fill(const TermLine& line);
  void draw(Rng& rng, Counters& counters);
  void draw_across(Rng& rng, Counters& counters);
  Vec3 start_gradient() const;
  Mat3 gradient_precision() const;
  void shift(double value, const Vec3& gradient);
  void hold(double value, const Vec3& gradient);
  double pull_from(double tau) const;
  void evaluate(double t, double& g, double& dg);
  void sum_waves(double t, double& g, double& dg);
  // cos and sin of what every wave turns by in `tau`.
  void turn_by(double tau, Array& cosine, Array& sine);
  // Gradient of g at the waves' own state `slope` (B cos - A sin), without what is across.
  Vec3 waves_gradient(const Array& slope) const;

  const Plan* plan_ = nullptr;
  double anchor_ = 0, step_ = 1;
  Vec3 direction_;
  double slope_variance_ = 0, deviation_ = 0;
  std::vector<TermLine> terms_;

  // Per wave: d·V, variance, and its state at state_t_: A cos + B sin and B cos - A sin.
  Array rate_, variance_, value_, slope_;
  Array step_cos_, step_sin_, turned_cos_, turned_sin_, angle_;
  double state_t_ = 0;  // the right end of cell_
  long cell_ = -1, next_pull_ = 0;
  double right_g_ = 0, right_dg_ = 0;
  NearStart near_;
  bool drawn_ = false, remembered_ = false, held_ = false;
  double pull_ = 0;
};
static_assert(LinePath<SpectralPath>);

}  // namespace gpis

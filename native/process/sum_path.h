// Sums with rough terms (math.md §2: a sum is sampled as a sum of independent processes; §5.2):
// every Matérn or Wong term is a Markov path of its own, all smooth terms together are one spectral
// path. Parts share their cells, the shortest that any of them asks for.
// What is known of g at the start is known of the sum alone. Value and gradient of each part are
// independent Gaussians at a point, so the parts are drawn freely there and moved on to the sum,
// each by its share of the covariance (Matheron's rule); after that they are independent again.
#pragma once

#include <variant>
#include <vector>

#include "process/markov_path.h"
#include "process/spectral_path.h"

namespace gpis {

class SumPath {
 public:
  static constexpr int kStride = 1;

  // Several terms, of which the rough ones, at least one, have a gradient and no wave.
  static bool serves(const std::vector<Term>& terms);

  struct Plan {
    Plan(const GaussianProcess& process, const Box3& bounds);
    template <class Path>
    struct Of {
      using Kind = Path;
      typename Path::Plan plan;
    };
    using Kinds = std::variant<Of<SpectralPath>, Of<MarkovPath<Matern32>>, Of<MarkovPath<Matern52>>,
                               Of<MarkovPath<Wong>>>;
    struct Part {
      Kinds path;
      double scale;  // of the path's values: Markov paths have variance 1
      double variance;
      std::vector<Vec3> slopes;  // ∇g at a point is Σ slope ξ
      Mat3 covariance;           // of it, Σ slope slopeᵀ
    };
    std::vector<Part> parts;
    double variance = 0;
    Mat3 precision;  // pseudo-inverse of the sum's Cov ∇g
    double correlation_error = 0;
    double reach = kInfinity;

   private:
    static Kinds markov_path(const Term& term);
    void add(Kinds path, const std::vector<Term>& terms, double scale, double share);
  };

  void reset(const Plan& plan, const LineGeometry& line, double anchor, double t_end,
             Counters& counters);

  double step() const { return step_; }
  double last_step() const { return 0; }
  double value_mean() const { return 0; }
  double value_deviation() const { return std::sqrt(plan_->variance); }
  void slope_law(double, double& mean, double& deviation) const {
    mean = 0;
    deviation = std::sqrt(slope_variance_);
  }

  void start_free(Rng& rng, Counters& counters, double& g, double& dg);
  double start(const PathStart& known, Rng& rng, Counters& counters);
  double pull(double t) const;

  void prepare(long cell, Rng& rng, Counters& counters);
  void at_right(long cell, double& g, double& dg);
  void at(long cell, double t, Rng& rng, double& g, double& dg);

  double deviation(double h) const;
  PathGradient gradient(double t, double g, double dg, Rng& rng);

 private:
  struct Part {
    std::variant<SpectralPath, MarkovPath<Matern32>, MarkovPath<Matern52>, MarkovPath<Wong>> path;
    double scale = 1, slope_variance = 0;
    PathStart start;
  };

  // body(part, path) over all parts.
  template <class Body>
  void each(Body body) {
    for (Part& part : parts_) std::visit([&](auto& path) { body(part, path); }, part.path);
  }
  template <class Body>
  void each(Body body) const {
    for (const Part& part : parts_)
      std::visit([&](const auto& path) { body(part, path); }, part.path);
  }
  void split(const PathStart& known, Rng& rng, Counters& counters);

  const Plan* plan_ = nullptr;
  Vec3 direction_;
  double anchor_ = 0, step_ = 1, slope_variance_ = 0;
  long last_cell_ = 0;
  std::vector<Part> parts_;
};
static_assert(LinePath<SumPath>);

}  // namespace gpis

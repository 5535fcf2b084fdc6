// Sampler 6 on a line: the values of one realisation of g in all of space (process/realisation.h),
// a fresh one for every line, or one that a light path keeps (memory `global`). Slow, and the
// ground truth for the samplers that know the line alone.
#pragma once

#include "process/gaussian_process.h"
#include "process/near_start.h"
#include "process/path.h"
#include "process/realisation.h"
#include "process/realisation_memory.h"

namespace gpis {

class RealisationPath {
 public:
  static constexpr int kStride = 1;

  struct Plan {
    Plan(const GaussianProcess& process, const Box3& bounds);
    // Of lattices; spectral features have the exact covariance.
    double correlation_error;
    std::shared_ptr<const GaussianProcess> process;
    std::shared_ptr<const Covariance> covariance;
    PosteriorPtr posterior;  // null: no conditions
    double pull() const { return posterior ? posterior->pull() : 0; }
  };

  // The lines from here on are drawn from this realisation; null: from a fresh one each. `inside`:
  // of a ray inside the body, which sees -f and so -g.
  void keep(RealisationMemory* kept, bool inside) {
    kept_ = kept;
    kept_sign_ = inside && kept ? -1 : 1;
  }

  void reset(const Plan& plan, const LineGeometry& line, double anchor, double t_end,
             Counters& counters);
  double step() const { return step_; }
  double last_step() const { return 1e-5; }
  double value_mean() const { return sign_ * mean_[0]; }
  double value_deviation() const { return std::sqrt(law_(0, 0)); }
  void slope_law(double g0, double& mean, double& deviation) const;
  void start_free(Rng& rng, Counters& counters, double& g, double& dg);
  double start(const PathStart& known, Rng& rng, Counters& counters);
  double pull(double) const { return pull_; }
  bool met_before() const { return met_before_; }
  void prepare(long, Rng&, Counters& counters) { count(counters); }
  void at_right(long cell, double& g, double& dg) { evaluate(anchor_ + (cell + 1) * step_, g, dg); }
  void at(long, double t, Rng&, double& g, double& dg) { evaluate(t, g, dg); }
  double deviation(double h) const { return deviation_ * (h * h) * (h * h); }
  PathGradient gradient(double t, double g, double dg, Rng& rng);

 private:
  struct Pool {
    const Plan* plan;
    std::unique_ptr<Realisation> realisation;
  };

  void draw(Rng& rng, Counters& counters);
  FieldSample sample(const Vec3& x) const;
  void count(Counters& counters);
  RealisationCondition condition(const PathStart& known) const;
  void evaluate(double t, double& g, double& dg);
  void realised(double t, double& g, double& dg);
  Vec3 point(double t) const { return line_.origin + line_.direction * t; }

  const Plan* plan_ = nullptr;
  std::vector<Pool> pool_;  // one for each object that this line was used for
  Realisation* realisation_ = nullptr;
  RealisationMemory* kept_ = nullptr;
  double kept_sign_ = 1, sign_ = 1;  // of the next line, and of this one
  LineGeometry line_;
  double anchor_ = 0, step_ = 1, deviation_ = 0, pull_ = 0, added_norm_ = 0;
  NearStart near_;
  bool drawn_ = false;
  bool met_before_ = false;
  std::uint64_t counted_ = 0;

  // Of (g, ∇g) at the anchor, given the conditions.
  Eigen::Vector4d mean_;
  Eigen::Matrix4d law_;
  RealisationCondition entry_, own_;  // of the realisation that is kept, and of this line alone
};

static_assert(LinePath<RealisationPath>);

}  // namespace gpis

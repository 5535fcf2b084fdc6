// Sampler 2, Markov (math.md §5.2): exact transitions from cell to cell, exact bridges between
// states already drawn, all of which are kept. Matérn 3/2, Matérn 5/2, Wong.
#pragma once

#include <vector>

#include "process/gaussian_process.h"
#include "process/markov_model.h"
#include "process/radial_line.h"

namespace gpis {

template <class Model>
class MarkovPath {
 public:
  static constexpr int kStride = 1;
  struct Plan {
    Plan(const GaussianProcess& process, const Box3& bounds);
    explicit Plan(const Term& term) : line(term) {}  // of a path of variance 1
    double correlation_error = 1e-14;                // rounding
    RadialLine::Plan line;
  };

  void reset(const Plan& plan, const LineGeometry& line, double anchor, double,
             Counters& counters) {
    counters_ = &counters;
    line_.reset(plan.line, line, anchor);
    width_ = kStep;
    transition_ = &kTables.step;
    step_ = kStep / line_.inverse_length();
    nodes_.clear();
    pull_ = 0;
  }

  double step() const { return step_; }
  double last_step() const { return 0; }
  // After a reset: shorter cells than its own, where paths that are added up share them.
  void shorten(double step) {
    step_ = step;
    width_ = step * line_.inverse_length();
    if (width_ > 0) shorter_ = Transition<Model>(Model::kRate * width_);
    transition_ = &shorter_;
  }
  double value_mean() const { return 0; }
  double value_deviation() const { return 1; }
  void slope_law(double, double& mean, double& deviation) const {
    mean = 0;
    deviation = line_.slope_deviation();
  }

  void start_free(Rng& rng, Counters& counters, double& g, double& dg) {
    begin(rng.normal(), kSlopeDeviation * rng.normal(), rng, counters);
    read(nodes_.back(), g, dg);
  }
  double start(const PathStart& known, Rng& rng, Counters& counters) {
    const double slope = known.slope_known ? line_.per_length(known.slope) / Model::kRate
                         : nodes_.empty()  ? kSlopeDeviation * rng.normal()
                                           : nodes_.back().z[1];  // independent of the value
    begin(known.value, slope, rng, counters);
    if (known.gradient_known) line_.remember(known.gradient);
    pull_ = 0;
    for (int i = 0; i < Model::kSize; ++i) pull_ += std::max(0.0, -nodes_.back().z[i]);
    return slope * Model::kRate * line_.inverse_length();
  }
  double pull(double t) const {
    return pull_ > 0 ? pull_ * Model::decay(Model::kRate * line_.q(t)) : 0;
  }

  void prepare(long cell, Rng& rng, Counters& counters) {
    const double left = cell * width_;
    if (nodes_.back().q < left)
      advance(left, Transition<Model>(Model::kRate * (left - nodes_.back().q)), rng, counters);
    if (nodes_.back().q < left + width_) advance(left + width_, *transition_, rng, counters);
  }
  void at_right(long, double& g, double& dg) const { read(nodes_.back(), g, dg); }
  void at(long cell, double t, Rng& rng, double& g, double& dg);

  double deviation(double h) const {
    const double q = h * line_.inverse_length();
    return 4.5 * Model::kDeviation * q * std::sqrt(q) * (Model::kPower > 2 ? q : 1);
  }
  PathGradient gradient(double t, double, double dg, Rng&) const { return line_.gradient(t, dg); }

 private:
  using Vector = typename Model::Vector;
  static constexpr double kStep = 0.25;  // of its own cells, in length scales
  // Narrower intervals are their cubic, off by 1e-10 standard deviations at most.
  static constexpr double kFinest = Model::kPower > 2 ? 1e-4 : 1e-7;
  static constexpr int kLevels = 10;  // halvings of a cell that are tabulated
  static constexpr double kSlopeDeviation = Model::kSize == 3 ? 0.5773502691896258 : 1;

  struct Node {
    double q;
    Vector z;
  };
  struct Tables {
    Transition<Model> step;
    Bridge<Model> halves[kLevels];
    Tables() : step(Model::kRate * kStep) {
      double half = Model::kRate * kStep / 2;
      for (auto& bridge : halves) {
        bridge = Bridge<Model>(half, half);
        half /= 2;
      }
    }
  };
  inline static const Tables kTables;

  void begin(double value, double slope, Rng& rng, Counters& counters) {
    Vector z;
    z[0] = value;
    z[1] = slope;
    // g'' of Matérn 5/2 given the value: covariance -1/3, variance 1 (formulas C3).
    if constexpr (Model::kSize == 3) z[2] = -value / 3 + std::sqrt(8.0 / 9) * rng.normal();
    counters.line_normals += Model::kSize;
    nodes_.assign(1, {0, z});
  }
  Vector noise(Rng& rng) {
    Vector xi;
    for (int i = 0; i < Model::kSize; ++i) xi[i] = rng.normal();
    return xi;
  }
  void advance(double q, const Transition<Model>& by, Rng& rng, Counters& counters) {
    const Vector z = by.from * nodes_.back().z + by.factor * noise(rng);
    nodes_.push_back({q, z});
    counters.line_normals += Model::kSize;
  }
  void read(const Node& node, double& g, double& dg) const {
    g = node.z[0];
    dg = node.z[1] * Model::kRate * line_.inverse_length();
  }

  RadialLine line_;
  double step_ = 1, width_ = kStep, pull_ = 0;     // of a cell, per t and in length scales
  const Transition<Model>* transition_ = nullptr;  // over a cell
  Transition<Model> shorter_;
  Counters* counters_ = nullptr;
  std::vector<Node> nodes_;  // in increasing order
};

}  // namespace gpis

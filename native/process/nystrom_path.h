// Sampler 4, Nyström on Nyquist nodes (math.md §5.4): a smooth g is fixed by its values at half a
// length scale, so values are drawn jointly at such nodes, and g in between is their mean there:
// g(t) = Σ weight · cov(g(t), node). It serves lengths that vary along the line, and any
// conditions.
//
// Nodes are drawn in blocks of a few length scales as the march goes on, all of them given all
// before. Each block starts and ends in a value and a slope, so that the path is smooth across
// blocks, and its nodes reach beyond its end.
#pragma once

#include "process/joint_line.h"

namespace gpis {

class NystromPath : public JointLine {
 public:
  static constexpr int kStride = 1;
  static constexpr double kLastStep = 1e-5;
  struct Plan : JointLine::Plan {
    Plan(const GaussianProcess& process, const Box3& bounds);
    double spacing = 0.5;  // of nodes, in local length scales
  };

  void reset(const Plan& plan, const LineGeometry& line, double anchor, double t_end,
             Counters& counters);
  double step() const { return step_; }
  void start_free(Rng& rng, Counters& counters, double& g, double& dg);
  double start(const PathStart& known, Rng& rng, Counters& counters);
  void prepare(long cell, Rng& rng, Counters& counters);
  void at_left(long cell, double& g, double& dg) const { evaluate(anchor_ + cell * step_, g, dg); }
  void at_right(long cell, double& g, double& dg) const {
    evaluate(anchor_ + (cell + 1) * step_, g, dg);
  }
  void at(long, double t, Rng&, double& g, double& dg) const { evaluate(t, g, dg); }
  double deviation(double h) const;

 private:
  static constexpr int kBlock = 8;   // nodes of a block
  static constexpr int kBeyond = 3;  // nodes behind its end

  struct Block {
    double begin, end;
    JointRows::Mean mean;
  };

  // The node after t.
  double next_node(double t) const;
  void begin_run(double t);
  void extend(Rng& rng, Counters& counters);
  void evaluate(double t, double& g, double& dg) const;

  double spacing_ = 0.5, step_ = 1, t_end_ = 0;
  std::vector<double> nodes_;  // of this run: the first one is where it begins, the rest is drawn
  std::size_t end_ = 0;        // the node where the last block ends
  std::vector<Block> blocks_;
  double margin_ = 0;  // of the cell prepared last, see deviation
  TensorField::Kinks kinks_;
};
static_assert(LinePath<NystromPath>);

}  // namespace gpis

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
    // Where lengths vary, the cubic over a step h is off by this times (h/ℓ)⁴, see deviation.
    double cubic = 0;
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
  // Of the fields' pieces: where A has a kink at an end, its slope there is that between them.
  void enter(double a, double b) {
    piece_begin_ = a;
    piece_end_ = b;
  }
  double deviation(double a, double h) const;

 private:
  static constexpr int kBlock = 8;   // nodes of a block
  static constexpr int kBeyond = 3;  // nodes behind its end

  static constexpr double kSliver = 1e-6;

  struct Block {
    double begin, end;
    JointRows::Mean mean;
  };
  struct Node {
    double t;
    LinePoint at;  // where lengths vary
    double length_scale;
  };

  Node node(double t) const;
  Node after(const Node& node) const;
  double plan_step(double t_end) const;
  void begin_run(double t);
  void extend(Rng& rng, Counters& counters);
  void draw(const Node& node, const Functional& what, Rng& rng, Counters& counters);
  void evaluate(double t, double& g, double& dg) const;
  bool varies() const { return rows_.has_line(); }

  const Plan* plan_ = nullptr;
  double step_ = 1, t_end_ = 0;
  std::vector<Node> nodes_;  // of this run: the first one is where it begins, the rest is drawn
  std::size_t end_ = 0;      // the node where the last block ends
  std::vector<Block> blocks_;
  double margin_ = 0, kink_margin_ = 0;  // of the cell prepared last, see deviation
  double piece_begin_ = 0, piece_end_ = 0;
};
static_assert(LinePath<NystromPath>);

}  // namespace gpis

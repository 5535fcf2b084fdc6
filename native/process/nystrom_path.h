// Sampler 4, Nyström (math.md §5.4): a smooth g is fixed by its values at half a length scale, or
// by its values and slopes at a whole one. Both are drawn at such nodes as the march comes to them,
// all given all before, and g in between is its mean there: g(t) = Σ weight · cov(g(t), row). The
// path is smooth across nodes, and nothing is drawn behind the node after a hit. It serves lengths
// that vary along the line, and any conditions.
#pragma once

#include "process/joint_line.h"
#include "process/near_start.h"

namespace gpis {

class NystromPath : public JointLine {
 public:
  static constexpr int kStride = 1;
  struct Plan : JointLine::Plan {
    Plan(const GaussianProcess& process, const Box3& bounds);
    double spacing = 1;  // of nodes, in local length scales
    // Where lengths vary, the cubic over a step h is off by this times (h/ℓ)⁴, see deviation.
    double cubic = 0;
  };

  void reset(const Plan& plan, const LineGeometry& line, double anchor, double t_end,
             Counters& counters);
  double step() const { return step_; }
  double last_step() const { return 1e-5; }
  void start_free(Rng& rng, Counters& counters, double& g, double& dg);
  double start(const PathStart& known, Rng& rng, Counters& counters);
  void prepare(long cell, Rng& rng, Counters& counters);
  void at_left(long cell, double& g, double& dg) { evaluate(anchor_ + cell * step_, g, dg); }
  void at_right(long cell, double& g, double& dg) { evaluate(anchor_ + (cell + 1) * step_, g, dg); }
  void at(long, double t, Rng&, double& g, double& dg) { evaluate(t, g, dg); }
  // Of the fields' pieces: where A has a kink at an end, its slope there is that between them.
  void enter(double a, double b) {
    piece_begin_ = a;
    piece_end_ = b;
  }
  double deviation(double a, double h) const;

 private:
  static constexpr double kSliver = 1e-6;
  static constexpr double kNear = 1e-3;  // of the way to the first node
  // Behind a known start, of an interval: values and slopes a whole one apart leave 2 % (SE; RQ 15
  // %) of the little variance open that g has there.
  static constexpr double kFirst = 0.35;
  static constexpr int kMostHalvings = 5;
  static constexpr int kLater = 6;  // points behind the last node that error_in looks at

  struct Node {
    double t;
    LinePoint at;  // where lengths vary
    double length_scale;
    double g = 0, dg = 0;
  };
  struct Interval {  // from one node to the next
    double begin, end;
    int mean = -1;  // of means_; not made before it is asked for
  };

  Node node(double t) const;
  Node after(const Node& node) const;
  void begin_at_anchor(double g, double dg);
  double error_in(const Interval& interval);
  void extend(Rng& rng, Counters& counters);
  void draw(Node& node, Rng& rng, Counters& counters);
  const JointRows::Mean& mean(Interval& interval);
  void evaluate(double t, double& g, double& dg);
  void mean_at(double t, double& g, double& dg);
  bool varies() const { return rows_.has_line(); }

  const Plan* plan_ = nullptr;
  double step_ = 1, t_end_ = 0;
  std::vector<Node> nodes_;
  std::vector<Interval> intervals_;
  std::vector<JointRows::Mean> means_;
  NearStart near_;
  bool start_known_ = false;
  double margin_ = 0;  // of the cell prepared last, see deviation
  double piece_begin_ = 0, piece_end_ = 0;
};
static_assert(LinePath<NystromPath>);

}  // namespace gpis

// Sampler 5, dense, where covariances differ from line to line (tensor fields, kernels without
// normal form, off-line conditions): values and slopes of g drawn jointly at points of a fixed
// spacing, all given all before; in between the cubic through both. A rough path (the third
// derivative of its covariance jumps at 0: Matérn 3/2, Wong) has the slopes of a Brownian motion: a
// cubic leaves 6 % of their variance out, so what it misses is added, the bridge of an integrated
// Brownian motion between both ends, halved as far as it is asked for. The last resort.
#pragma once

#include "process/joint_line.h"

namespace gpis {

class JointDensePath : public JointLine {
 public:
  static constexpr int kStride = 1;
  static constexpr double kLastStep = 1e-5;
  struct Plan : JointLine::Plan {
    Plan(const GaussianProcess& process, const Box3& bounds);
    double spacing;  // of points, in the shortest length scale of the line
  };

  void reset(const Plan& plan, const LineGeometry& line, double anchor, double t_end,
             Counters& counters);
  double step() const { return step_; }
  void start_free(Rng& rng, Counters& counters, double& g, double& dg);
  double start(const PathStart& known, Rng& rng, Counters& counters);
  void prepare(long cell, Rng& rng, Counters& counters);
  void at_left(long cell, double& g, double& dg) const;
  void at_right(long cell, double& g, double& dg) const { at_left(cell + 1, g, dg); }
  void at(long cell, double t, Rng& rng, double& g, double& dg);
  double deviation(double a, double h) const;

 private:
  struct Point {
    long index;  // anchor + index · step
    double g, dg;
    double intensity = 0;  // of the noise that drives the slope, in the cell behind it
  };
  // What the path adds to its cubics, at points within cells; nothing at their ends.
  struct Rest {
    double t, g, dg;
  };
  void draw(long index, Rng& rng, Counters& counters);
  const Point& point_of(long cell) const;
  void add_rest(long cell, double t, Rng& rng, double& g, double& dg);

  double step_ = 1;
  std::vector<Point> points_;  // in increasing order
  std::vector<Rest> rests_;    // in increasing order
  Counters* counters_ = nullptr;
};
static_assert(LinePath<JointDensePath>);

}  // namespace gpis

// Sampler 5, dense, where covariances differ from line to line (tensor fields, kernels without
// normal form, off-line conditions): values and slopes of g drawn jointly at points, all given all
// before; in between the cubic through both. Points are as close as the lengths around them ask
// for. A rough path (the third derivative of its covariance jumps at 0: Matérn 3/2, Wong) has the
// slopes of a Brownian motion: a cubic leaves 6 % of their variance out, so what it misses is
// added, the bridge of an integrated Brownian motion between both ends, drawn where it is asked
// for. The last resort.
#pragma once

#include "process/brownian_bridge.h"
#include "process/dense_points.h"
#include "process/joint_line.h"
#include "process/survey.h"

namespace gpis {

class JointDensePath : public JointLine {
 public:
  static constexpr int kStride = 1;
  struct Plan : JointLine::Plan {
    Plan(const GaussianProcess& process, const Box3& bounds);
    DensePoints::Spacing spacing;
  };

  void reset(const Plan& plan, const LineGeometry& line, double anchor, double t_end,
             Counters& counters);
  double step() const { return step_; }
  double last_step() const { return where_.rough() ? 0 : 1e-5; }
  void start_free(Rng& rng, Counters& counters, double& g, double& dg);
  double start(const PathStart& known, Rng& rng, Counters& counters);
  void prepare(long cell, Rng& rng, Counters& counters);
  void at_right(long cell, double& g, double& dg) const;
  void at(long cell, double t, Rng& rng, double& g, double& dg);
  double deviation(double a, double h) const;

 private:
  struct Point {
    double t, g, dg;
    double intensity = 0;  // of the noise that drives the slope, the most up to the next point
  };
  static double error_on(const Plan& plan, const SurveyLine& line);
  static double lost_on(const Plan& plan, const SurveyLine& line);

  void draw(double t, Rng& rng, Counters& counters);
  void extend(Rng& rng, Counters& counters);
  double cell_end(long cell) const { return anchor_ + static_cast<double>(cell + 1) * step_; }
  // The last point not behind t.
  std::size_t before(double t) const;
  void draw_rest(double t, Rng& rng);
  // What is drawn around t, of the piece that holds it.
  std::array<BridgePoint, 2> rests_around(std::size_t piece, double t) const;
  std::vector<BridgePoint>::const_iterator rest_behind(double t) const;
  void read(double t, double& g, double& dg) const;
  double deviation_over_points(std::size_t piece, double a, double h) const;

  DensePoints where_;
  double step_ = 1;
  std::vector<Point> points_;  // in increasing order
  // What the path adds to its cubics, at points within them in increasing order; nothing at their
  // ends.
  std::vector<BridgePoint> rests_;
  Counters* counters_ = nullptr;
};
static_assert(LinePath<JointDensePath>);

}  // namespace gpis

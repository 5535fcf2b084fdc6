// Close to a start where value and slope are known, what a path adds to them is far smaller than
// what it sums up, and lost in its rounding (oracle 8: Var g = q⁴/2, 1e-32 at q = 1e-8). There it
// is the cubic from the start to a place so near that nothing else shows.
#pragma once

#include "core/vec.h"
#include "process/brownian_bridge.h"

namespace gpis {

class NearStart {
 public:
  void forget() { reach_ = -kInfinity; }
  void know(double t, double g, double dg, double reach) {
    start_ = {t, g, dg};
    reach_ = t + reach > t ? reach : -kInfinity;
    far_.t = t;
  }
  bool holds(double t) const { return t - start_.t < reach_; }
  // `path`: (t, g, dg), the path itself, not too close to the start.
  template <class Path>
  void read(double t, double& g, double& dg, const Path& path) {
    if (far_.t == start_.t) {
      far_.t = start_.t + reach_;
      path(far_.t, far_.g, far_.dg);
    }
    const BridgePoint p = cubic_between(start_, far_, t);
    g = p.g;
    dg = p.dg;
  }

 private:
  BridgePoint start_{}, far_{};
  double reach_ = -kInfinity;  // nothing known: not even what lies before an earlier start
};

// As far as a path that cubics miss by `deviation` h⁴ and whose slope deviates by `slope` may be
// one near its start: `share`³ of its curvature there.
inline double near_start_reach(double share, double slope, double deviation) {
  return slope > 0 && deviation > 0 ? share * std::cbrt(slope / deviation) : 0;
}

}  // namespace gpis

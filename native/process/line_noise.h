// A path behind a virtual face: the leaves of a tree may have paths of any kind (process/path.h has
// the calls and their order). A single process never pays for it.
#pragma once

#include "process/path.h"

namespace gpis {

class LineNoise {
 public:
  virtual ~LineNoise() = default;
  virtual void reset(const LineGeometry& line, double anchor, double t_end, Counters& counters) = 0;
  virtual double step() const = 0;
  virtual double value_mean() const = 0;
  virtual double value_deviation() const = 0;
  virtual void slope_law(double value, double& mean, double& deviation) const = 0;
  virtual void start_free(Rng& rng, Counters& counters, double& g, double& dg) = 0;
  virtual double start(const PathStart& known, Rng& rng, Counters& counters) = 0;
  virtual double pull(double t) const = 0;
  // A realisation that an earlier ray of the path has seen.
  virtual bool met_before() const { return false; }
  virtual void prepare(long cell, Rng& rng, Counters& counters) = 0;
  virtual void at_right(long cell, double& g, double& dg) = 0;
  virtual void at(long cell, double t, Rng& rng, double& g, double& dg) = 0;
  virtual double deviation(double a, double h) const = 0;
};

template <LinePath Path>
class PathNoise final : public LineNoise {
 public:
  PathNoise(Path& path, const typename Path::Plan& plan) : path_(path), plan_(plan) {}
  void reset(const LineGeometry& line, double anchor, double t_end, Counters& counters) override {
    path_.reset(plan_, line, anchor, t_end, counters);
  }
  double step() const override { return path_.step(); }
  double value_mean() const override { return path_.value_mean(); }
  double value_deviation() const override { return path_.value_deviation(); }
  void slope_law(double value, double& mean, double& deviation) const override {
    path_.slope_law(value, mean, deviation);
  }
  void start_free(Rng& rng, Counters& counters, double& g, double& dg) override {
    path_.start_free(rng, counters, g, dg);
  }
  double start(const PathStart& known, Rng& rng, Counters& counters) override {
    return path_.start(known, rng, counters);
  }
  double pull(double t) const override { return path_.pull(t); }
  bool met_before() const override {
    if constexpr (requires { path_.met_before(); }) return path_.met_before();
    return false;
  }
  void prepare(long cell, Rng& rng, Counters& counters) override {
    path_.prepare(cell, rng, counters);
  }
  void at_right(long cell, double& g, double& dg) override { path_.at_right(cell, g, dg); }
  void at(long cell, double t, Rng& rng, double& g, double& dg) override {
    path_.at(cell, t, rng, g, dg);
  }
  double deviation(double a, double h) const override { return deviation_over(path_, a, h); }

 private:
  Path& path_;
  const typename Path::Plan& plan_;
};

}  // namespace gpis

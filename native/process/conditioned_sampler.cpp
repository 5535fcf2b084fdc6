#include "process/conditioned_sampler.h"

#include "process/joint_line.h"

namespace gpis {
namespace {

class ConditionedSampler final : public LineSampler {
 public:
  ConditionedSampler(std::unique_ptr<LineSampler> near, std::unique_ptr<LineSampler> far)
      : near_(std::move(near)), far_(std::move(far)), posterior_(near_->posterior()) {}

  double first_hit(const PlannedLine& plan, Line::Impl& line, double t_begin, double t_end,
                   const Start& start, Rng& rng, Counters& counters) const override {
    line.near_conditions = posterior_->conditions().near(line.geometry, t_begin, t_end);
    return of(line).first_hit(plan, line, t_begin, t_end, start, rng, counters);
  }
  void path_at(Line::Impl& line, double t, Rng& rng, double& g, double& dg) const override {
    of(line).path_at(line, t, rng, g, dg);
  }
  PathGradient gradient(Line::Impl& line, double t, double g, double dg, Rng& rng) const override {
    return of(line).gradient(line, t, g, dg, rng);
  }
  std::unique_ptr<LineNoise> noise(Line::Impl& line) const override {
    return std::make_unique<Noise>(*this, line);
  }
  double condition_pull() const override { return near_->condition_pull(); }
  double reach() const override { return std::min(near_->reach(), far_->reach()); }
  double known_share() const override {
    return std::min(near_->known_share(), far_->known_share());
  }
  double correlation_error() const override {
    return std::max(near_->correlation_error(), far_->correlation_error());
  }
  PosteriorPtr posterior() const override { return posterior_; }

 private:
  // Of a leaf of a tree; which one is known when it begins.
  class Noise final : public LineNoise {
   public:
    Noise(const ConditionedSampler& sampler, Line::Impl& line)
        : sampler_(sampler),
          line_(line),
          near_(sampler.near_->noise(line)),
          far_(sampler.far_->noise(line)),
          now_(far_.get()) {}
    void reset(const LineGeometry& line, double anchor, double t_end, Counters& counters) override {
      line_.near_conditions = sampler_.posterior_->conditions().near(line, anchor, t_end);
      now_ = line_.near_conditions ? near_.get() : far_.get();
      now_->reset(line, anchor, t_end, counters);
    }
    double step() const override { return now_->step(); }
    double value_mean() const override { return now_->value_mean(); }
    double value_deviation() const override { return now_->value_deviation(); }
    void slope_law(double value, double& mean, double& deviation) const override {
      now_->slope_law(value, mean, deviation);
    }
    void start_free(Rng& rng, Counters& counters, double& g, double& dg) override {
      now_->start_free(rng, counters, g, dg);
    }
    double start(const PathStart& known, Rng& rng, Counters& counters) override {
      return now_->start(known, rng, counters);
    }
    double pull(double t) const override { return now_->pull(t); }
    void prepare(long cell, Rng& rng, Counters& counters) override {
      now_->prepare(cell, rng, counters);
    }
    void at_right(long cell, double& g, double& dg) override { now_->at_right(cell, g, dg); }
    void at(long cell, double t, Rng& rng, double& g, double& dg) override {
      now_->at(cell, t, rng, g, dg);
    }
    double deviation(double a, double h) const override { return now_->deviation(a, h); }

   private:
    const ConditionedSampler& sampler_;
    Line::Impl& line_;
    std::unique_ptr<LineNoise> near_, far_;
    LineNoise* now_;
  };

  const LineSampler& of(const Line::Impl& line) const {
    return line.near_conditions ? *near_ : *far_;
  }

  std::unique_ptr<LineSampler> near_, far_;
  PosteriorPtr posterior_;
};

}  // namespace

std::unique_ptr<LineSampler> make_conditioned(std::unique_ptr<LineSampler> near,
                                              std::unique_ptr<LineSampler> far) {
  return std::make_unique<ConditionedSampler>(std::move(near), std::move(far));
}

}  // namespace gpis

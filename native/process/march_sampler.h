// The march as a line sampler, for a path and the kinds of fields that the process holds.
#pragma once

#include "process/field_lines.h"
#include "process/joint_line.h"
#include "process/line_sampler.h"
#include "process/march.h"

namespace gpis {

template <class MeanLine, class SigmaLine, LinePath Path>
class MarchSampler final : public LineSampler {
 public:
  explicit MarchSampler(typename Path::Plan plan) : plan_(std::move(plan)) {}

  double first_hit(const PlannedLine& plan, Line::Impl& line, double t_begin, double t_end,
                   const Start& start, Rng& rng, Counters& counters) const override {
    const auto& [origin, direction] = line.geometry;
    return March<MeanLine, SigmaLine, Path>(
               line, line.path<Path>(), plan_, MeanLine(*plan.process->mean, origin, direction),
               SigmaLine(*plan.process->sigma, origin, direction), plan, rng, counters)
        .run(t_begin, t_end, start);
  }

  void path_at(Line::Impl& line, double t, Rng& rng, double& g, double& dg) const override {
    const Line::Impl::Stretch* stretch = &line.stretches.front();
    for (const auto& s : line.stretches)
      if (s.begin <= t) stretch = &s;
    Path& path = line.path<Path>();
    const long cell = static_cast<long>(std::floor((t - line.anchor) / path.step()));
    path.at(std::clamp(cell, 0l, stretch->last_cell), t, rng, g, dg);
  }

  PathGradient gradient(Line::Impl& line, double t, double g, double dg, Rng& rng) const override {
    return line.path<Path>().gradient(t, g, dg, rng);
  }

  std::unique_ptr<LineNoise> noise(Line::Impl& line) const override {
    return std::make_unique<PathNoise<Path>>(line.path<Path>(), plan_);
  }

  JointLine* joint(Line::Impl& line) const override {
    if constexpr (std::derived_from<Path, JointLine>) return &line.path<Path>();
    return nullptr;
  }

  std::shared_ptr<const Posterior> posterior() const override {
    if constexpr (requires { plan_.posterior; }) return plan_.posterior;
    return nullptr;
  }

  double condition_pull() const override {
    if constexpr (requires { plan_.pull(); }) return plan_.pull();
    return 0;
  }

  double reach() const override {
    if constexpr (requires { plan_.reach; }) return plan_.reach;
    return kInfinity;
  }

  double known_share() const override {
    if constexpr (requires { plan_.known_share; }) return plan_.known_share;
    return 1;
  }
  double correlation_error() const override { return plan_.correlation_error; }

 private:
  typename Path::Plan plan_;
};

// Fields that renders hold often are marched under their concrete type by the path that renders use
// most; others spend their time in the path.
enum class Fields { any, by_type };
template <LinePath Path, Fields fields>
std::unique_ptr<LineSampler> make_sampler(const GaussianProcess& process, const Box3& bounds) {
  typename Path::Plan plan(process, bounds);
  const auto make = [&]<class MeanLine, class SigmaLine>() -> std::unique_ptr<LineSampler> {
    return std::make_unique<MarchSampler<MeanLine, SigmaLine, Path>>(std::move(plan));
  };
  const Field* mean = process.mean.get();
  const Field* sigma = process.sigma.get();
  if (dynamic_cast<const ConstantField*>(sigma)) {
    if constexpr (fields == Fields::by_type) {
      if (dynamic_cast<const ConstantField*>(mean))
        return make.template operator()<ConstantLine, ConstantLine>();
      if (dynamic_cast<const SphereField*>(mean))
        return make.template operator()<SphereLine, ConstantLine>();
      if (dynamic_cast<const GridField*>(mean))
        return make.template operator()<GridLine, ConstantLine>();
    }
    return make.template operator()<AnyLine, ConstantLine>();
  }
  if constexpr (fields == Fields::by_type)
    if (dynamic_cast<const GridField*>(sigma) && dynamic_cast<const GridField*>(mean))
      return make.template operator()<GridLine, GridLine>();
  return make.template operator()<AnyLine, AnyLine>();
}

}  // namespace gpis

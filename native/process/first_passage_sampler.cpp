// First hits out of a table, nothing marched (process/first_passage.h): for a constant mean and
// deviation and one radial correlation. A line knows the place and the slope of its end and nothing
// of the way to it: it serves rays that end on this surface alone.
#include "core/lock_or_stop.h"
#include "field/check.h"
#include "process/first_passage.h"
#include "process/plan.h"
#include "process/radial_line.h"

namespace gpis {
namespace {

class FirstPassageSampler final : public LineSampler {
 public:
  FirstPassageSampler(const Term& term, double level, double longest, double missed_root,
                      double correlation_error)
      : line_(term),
        level_(level),
        longest_(longest),
        missed_root_(missed_root),
        correlation_error_(correlation_error) {}

  double first_hit(const PlannedLine& plan, Line::Impl& line, double t_begin, double t_end,
                   const Start& start, Rng& rng, Counters& counters) const override {
    const double sigma = plan.sigma_max, mean = level_ * sigma;
    if (start.kind == Start::Kind::outside && mean > plan.skip_threshold) {
      ++counters.line_skipped;
      return kInfinity;
    }
    const FirstPassage* table = this->table(line.stop);
    if (!table) return kInfinity;
    ++counters.line_segments;
    ++counters.line_tabulated;
    RadialLine& frame = line.path<RadialLine>();
    frame.reset(line_, line.geometry, t_begin);
    const double per_t = frame.inverse_length();
    FirstPassage::Passage passage;
    if (start.kind == Start::Kind::outside) {
      passage = table->outside(rng);
    } else if (start.state.value != 0) {
      refuse(
          "the sampler first_passage serves rays that start on the surface or know nothing of f; "
          "this one starts where f is known.");
    } else {
      const double deviation = std::sqrt(line_.lambda2);
      double slope;  // a length scale
      if (start.kind == Start::Kind::value) {
        slope = deviation * flux_weighted_normal(0, rng);
      } else {
        const Vec3 gradient = start.state.gradient / sigma;
        frame.remember(gradient);
        slope = frame.per_length(dot(line.geometry.direction, gradient));
        // Only rounding at grazing directions says that a ray leaves where the surface falls.
        if (!(slope > 0)) {
          slope = 0;
          counters.line_slope_floor += per_t > 0;
        }
      }
      passage = table->leaving(slope, rng);
    }
    const double t = t_begin + passage.length / per_t;
    if (!(t < t_end)) return kInfinity;
    line.hit_t = t;
    line.hit_g = -level_;
    line.hit_dg = passage.slope * per_t;
    line.hit_mean = {mean, {}};
    line.hit_sigma = {sigma, {}};
    return t;
  }

  PathGradient gradient(Line::Impl& line, double t, double, double dg, Rng&) const override {
    return line.path<RadialLine>().gradient(t, dg);
  }
  // Never asked: nothing was sampled on the way, and a leaf of a tree is not given this sampler.
  void path_at(Line::Impl&, double, Rng&, double& g, double& dg) const override {
    g = dg = std::nan("");
  }
  std::unique_ptr<LineNoise> noise(Line::Impl&) const override { return nullptr; }
  double correlation_error() const override { return correlation_error_; }

 private:
  // Drawn when the first ray asks for it. Null: the render was cancelled meanwhile.
  const FirstPassage* table(const std::atomic<bool>* stop) const {
    if (const FirstPassage* ready = ready_.load(std::memory_order_acquire)) return ready;
    const auto lock = lock_or_stop(mutex_, stop);
    if (!lock) return nullptr;
    if (!table_) table_ = FirstPassage::make(line_.radial, level_, longest_, missed_root_, stop);
    ready_.store(table_.get(), std::memory_order_release);
    return table_.get();
  }

  RadialLine::Plan line_;
  double level_, longest_, missed_root_, correlation_error_;
  mutable std::timed_mutex mutex_;
  mutable std::shared_ptr<const FirstPassage> table_;
  mutable std::atomic<const FirstPassage*> ready_ = nullptr;
};

double longest_chord(const Mat3& whitening, const Box3& box) {
  const Vec3 size = box.max - box.min;
  double longest = 0;
  for (const double y : {-1, 1})
    for (const double z : {-1, 1})
      longest = std::max(longest, length(whitening * Vec3{size.x, y * size.y, z * size.z}));
  return longest;
}

}  // namespace

std::string why_no_first_passage(const GaussianProcess& process, const Box3& bounds,
                                 double missed_root) {
  const Range mean = process.mean->range(), sigma = process.sigma->range();
  if (mean.min != mean.max) return "the mean varies";
  if (sigma.min != sigma.max) return "the deviation varies";
  if (process.anisotropy) return "the length scales vary";
  if (process.conditions) return "there are condition points";
  const auto terms = process.kernel->terms();
  if (!terms || terms->size() != 1 || terms->front().modulated())
    return "the kernel is not one radial correlation";
  const Radial& radial = terms->front().radial;
  if (!radial.differentiable() || !(radial.lambda2() > 0)) return "the kernel has no slopes";
  // By waves, to the end of the longest: ten times as long as a million rays.
  if (radial.family == Radial::Family::rational_quadratic)
    return "excursions of a rational quadratic take long to draw";
  if (!std::isfinite(length(bounds.max - bounds.min))) return "there are no bounds";
  if (FirstPassage::excursions(missed_root) > FirstPassage::kMostExcursions)
    return "so few missed roots would take too large a table";
  if (!FirstPassage::serves(radial, mean.min / sigma.min,
                            longest_chord(terms->front().whitening, bounds)))
    return "the surface is met too rarely, or is nearly certain, at " +
           number_text(mean.min / sigma.min) + " standard deviations";
  return "";
}

std::unique_ptr<LineSampler> make_first_passage(const GaussianProcess& process, const Box3& bounds,
                                                double missed_root, double correlation_error) {
  const Term term = single_term(process, "first_passage");
  return std::make_unique<FirstPassageSampler>(
      term, process.mean->range().min / process.sigma->range().min,
      longest_chord(term.whitening, bounds), missed_root, correlation_error);
}

}  // namespace gpis

// Matérn 1/2, the Ornstein-Uhlenbeck process: continuous, without slope, so no piece of it is a
// cubic and no ray can leave its surface. Its first passage follows from the chance that a bridge
// between two positive ends a, b (in standard deviations) meets zero, exp(-2ab r/(1-r²)), r the
// correlation of the ends (oracle 7): a cell that holds a root is halved, each half with the chance
// it has given that one of them does. Exact where the mean is 0; elsewhere the bridge's drift
// towards 0 is neglected within a cell of ℓ/64.
#include "field/check.h"
#include "process/field_lines.h"
#include "process/line_sampler.h"
#include "process/plan.h"
#include "process/radial_line.h"

namespace gpis {
namespace {

constexpr double kCell = 1.0 / 64, kFinest = 1e-9;  // length scales

class OrnsteinUhlenbeck final : public LineSampler {
 public:
  explicit OrnsteinUhlenbeck(const GaussianProcess& process)
      : whitening_(single_term(process, "The Markov sampler").whitening),
        largest_(1 / process.kernel->min_length_scale()),
        sigma_(process.sigma->range().max) {
    if (!dynamic_cast<const ConstantField*>(process.sigma.get()))
      refuse("Matern 1/2 is served with a constant sigma only.");
  }

  double first_hit(const PlannedLine& plan, Line::Impl& line, double t_begin, double t_end,
                   const Start& start, Rng& rng, Counters& counters) const override {
    const auto& [origin, direction] = line.geometry;
    AnyLine mean(*plan.process->mean, origin, direction);
    // Along a constant axis g all but stands still.
    const double inverse_length =
        std::max(length(whitening_ * direction), 1e-9 * largest_ * length(direction));
    double t = t_begin, g;
    if (start.kind == Start::Kind::outside) {
      t = mean.above_until(t, t_end, plan.skip_threshold);
      if (!(t < t_end)) {
        ++counters.line_skipped;
        return kInfinity;
      }
      g = truncated_normal(-value(mean, t) / sigma_, rng);
      ++counters.truncated_normals;
    } else {
      if (start.state.value == 0)
        refuse("Matern 1/2 has no slope: no ray can leave a point of its surface.");
      g = (start.state.value - value(mean, t)) / sigma_;
    }
    ++counters.line_segments;
    for (long steps = 0; t < t_end; ++steps) {
      if (steps % 4096 == 4095 && line.stop && *line.stop) break;
      const double next = std::min(t + kCell / inverse_length, t_end);
      const double q = (next - t) * inverse_length, r = std::exp(-q);
      const double g_next = r * g + std::sqrt(-std::expm1(-2 * q)) * rng.normal();
      ++counters.line_normals;
      ++counters.line_evaluations;
      End a{t, value(mean, t) / sigma_, g}, b{next, value(mean, next) / sigma_, g_next};
      if (b.f() <= 0 || rng.uniform() < chance(a, b, inverse_length))
        return line.hit_t = passage(mean, a, b, inverse_length, rng, counters);
      t = next;
      g = g_next;
      if (b.mean * sigma_ > plan.skip_threshold) {
        const double clear = mean.above_until(t, t_end, plan.skip_threshold);
        const double gap = (clear - t) * inverse_length;
        g = std::exp(-gap) * g + std::sqrt(-std::expm1(-2 * gap)) * rng.normal();
        t = clear;
        if (t < t_end && value(mean, t) + sigma_ * g <= 0) ++counters.line_entry_inside;
      }
    }
    return kInfinity;
  }

  void path_at(Line::Impl&, double, Rng&, double&, double&) const override {
    refuse("Matern 1/2 is served by first_hits only: its paths are not kept.");
  }
  PathGradient gradient(Line::Impl&, double, double, double, Rng&) const override {
    const double nan = std::numeric_limits<double>::quiet_NaN();
    return {{nan, nan, nan}, {}, {}, 0};
  }
  std::unique_ptr<LineNoise> noise(Line::Impl&) const override {
    refuse("Matern 1/2 has no slope: no tree can march it.");
  }
  double correlation_error() const override { return 1e-14; }

 private:
  struct End {
    double t, mean, g;  // in standard deviations
    double f() const { return mean + g; }
  };

  static double value(AnyLine& mean, double t) {
    double v, dv;
    mean.enter(t, t);
    mean.evaluate(t, v, dv);
    return v;
  }

  static double chance(const End& a, const End& b, double inverse_length) {
    if (a.f() <= 0 || b.f() <= 0) return 1;
    const double q = (b.t - a.t) * inverse_length;
    return std::exp(-2 * a.f() * b.f() * std::exp(-q) / -std::expm1(-2 * q));
  }

  // The first root between two ends, one being certain to exist.
  double passage(AnyLine& mean, End a, End b, double inverse_length, Rng& rng,
                 Counters& counters) const {
    while ((b.t - a.t) * inverse_length > kFinest && b.t - a.t > 1e-14 * b.t) {
      const double t = 0.5 * (a.t + b.t), r = std::exp(-(t - a.t) * inverse_length);
      const double spread = std::sqrt(-std::expm1(-2 * (t - a.t) * inverse_length) / (1 + r * r));
      End middle{t, value(mean, t) / sigma_, 0};
      double left, either;
      do {
        middle.g = r / (1 + r * r) * (a.g + b.g) + spread * rng.normal();
        ++counters.line_normals;
        left = chance(a, middle, inverse_length);
        either = b.f() <= 0 ? 1 : 1 - (1 - left) * (1 - chance(middle, b, inverse_length));
      } while (rng.uniform() >= either);
      ++counters.line_evaluations;
      if (rng.uniform() * either < left)
        b = middle;
      else
        a = middle;
    }
    return b.t;
  }

  Mat3 whitening_;
  double largest_;  // 1/ℓ of the shortest axis
  double sigma_;
};

}  // namespace

std::unique_ptr<LineSampler> make_ornstein_uhlenbeck(const GaussianProcess& process, const Box3&) {
  return std::make_unique<OrnsteinUhlenbeck>(process);
}

}  // namespace gpis

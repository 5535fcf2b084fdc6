#include "process/nystrom_path.h"

#include "field/check.h"
#include "process/march_sampler.h"
#include "process/survey.h"

namespace gpis {
namespace {

// Standard deviation of the middle of [a, a + h] from the cubic through values and slopes of both
// ends, exactly.
double deviation_from_cubic(const Covariance& covariance, const LineGeometry& line, double a,
                            double h) {
  const auto at = [&](double t) { return covariance.at(line.origin + line.direction * t); };
  const LocalPoint p[3] = {at(a), at(a + 0.5 * h), at(a + h)};
  const Vec3 d = line.direction;
  const Functional f[3] = {{-0.5, d * (-h / 8)}, {1, {}}, {-0.5, d * (h / 8)}};
  double variance = 0;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j <= i; ++j)
      variance += (i == j ? 1 : 2) * covariance.between(p[i], f[i], p[j], f[j]);
  return std::sqrt(std::max(0.0, variance));
}

// What bounds a deviation of the middle by that, see LinePath: 1.25 for what is off the middle.
double bound_of(double deviation, double pull) {
  return 1.25 * (4.5 + pull) / 0.75 * deviation;
}

}  // namespace

NystromPath::Plan::Plan(const GaussianProcess& process, const Box3& bounds)
    : JointLine::Plan(process) {
  if (!covariance.smooth())
    refuse("The nystrom sampler cannot serve the kernel ", process.kernel->describe(),
           ": values at half a length scale do not determine it. Take the sampler 'dense'.");
  if (process.anisotropy) {
    GaussianProcess stationary = process;
    stationary.anisotropy = nullptr;
    const double h = 0.5 / std::sqrt(covariance.shortest_inverse2());
    cubic = 16 * bound_of(deviation_from_cubic(Covariance(stationary), {{}, {1, 0, 0}}, 0, h), 0);
  }
  // Closer nodes until the error is small on lines through the bounds. Without a tensor field,
  // where this sampler is asked for or serves conditions, nodes closer than that determine each
  // other but for rounding.
  const double enough = process.anisotropy ? 5e-4 : 3e-3;
  for (;; spacing *= 0.85) {
    correlation_error = 0;
    for (const SurveyLine& line : survey_lines(covariance, bounds)) {
      NystromPath path;
      Rng rng(1, 0);
      Counters counters;
      double g, dg;
      path.reset(*this, line.geometry, 0, line.end, counters);
      path.start_free(rng, counters, g, dg);
      while (path.nodes_.back().t < line.end && path.nodes_.size() < kMostSurveyed) {
        path.extend(rng, counters);
        const double error = path.error_in(path.intervals_.back());
        correlation_error = std::max(correlation_error, error / covariance.variance());
      }
      correlation_error = std::max(correlation_error, path.lost());
    }
    if (correlation_error < enough || spacing < 0.3) break;
  }
}

// |implied - exact covariance|: what the rows so far leave of g in the middle of an interval is
// left out, so that nothing drawn later has its covariance with that.
double NystromPath::error_in(const Interval& interval) {
  if (!std::isfinite(interval.end)) return 0;
  const double middle = 0.5 * (interval.begin + interval.end);
  const Node x = node(middle), last = nodes_.back();
  const auto left = [&](double t) {
    const Node y = node(t);
    return std::abs(rows_.covariance_left(point(middle), varies() ? &x.at : nullptr, point(t),
                                          varies() ? &y.at : nullptr));
  };
  double error = left(middle);
  if (!std::isfinite(last.t)) return error;
  for (int i = 1; i <= kLater; ++i)
    error = std::max(error, left(last.t + 0.5 * i * last.length_scale));
  return error;
}

void NystromPath::reset(const Plan& plan, const LineGeometry& line, double anchor, double t_end,
                        Counters& counters) {
  begin(plan, line, anchor, counters);
  plan_ = &plan;
  t_end_ = t_end;
  step_ = (varies() ? plan_->spacing : 0.5) * near_length(t_end);
  margin_ = -1;
  near_.forget();
  start_known_ = false;
  enter(anchor, anchor);
}

NystromPath::Node NystromPath::node(double t) const {
  Node out{t, {}, kInfinity};
  if (varies()) {
    out.at = t == anchor_ ? *line_anchor() : rows_.line().at(t);
    out.length_scale = rows_.line().length_scale(out.at);
  } else if (std::isfinite(t)) {
    out.length_scale = covariance_->length_scale(point(t), line_.direction);
  }
  return out;
}

void NystromPath::begin_at_anchor(double g, double dg) {
  nodes_.assign(1, node(anchor_));
  nodes_[0].g = g;
  nodes_[0].dg = dg;
  intervals_.clear();
  means_.clear();
}

void NystromPath::start_free(Rng& rng, Counters& counters, double& g, double& dg) {
  JointLine::start_free(rng, counters, g, dg);
  begin_at_anchor(g, dg);
}

double NystromPath::start(const PathStart& known, Rng& rng, Counters& counters) {
  const double slope = JointLine::start(known, rng, counters);
  begin_at_anchor(known.value, slope);
  start_known_ = true;
  return slope;
}

// As far as the lengths at both allow (half as far until the next one does: what is short may be in
// that one place), and the kinks between: where A has sharp ones, as along the crease of a fit,
// lengths may be short between two places where they are long. Where lengths vary,
// at the ends of cells if these are no farther apart: what is known at a node serves the march too.
NystromPath::Node NystromPath::after(const Node& last) const {
  const double spacing = plan_->spacing * (start_known_ && last.t == anchor_ ? kFirst : 1);
  const auto farther = [&](double length) {
    const double t = last.t + spacing * length;
    if (!varies() || t - last.t < (1 - 1e-9) * step_) return t;
    return anchor_ + std::floor((t - anchor_) / step_ + 1e-6) * step_;
  };
  Node next = node(farther(last.length_scale));
  while (next.t - last.t > (1 + 1e-6) * spacing * next.length_scale)
    next = node(last.t + 0.5 * (next.t - last.t));
  if (!varies()) return next;
  for (int i = 0; i < kMostHalvings; ++i) {
    const double h = next.t - last.t;
    const double kinks = covariance_->anisotropy()->kinks(
        line_.origin, line_.direction, last.t + kSliver * h, next.t - kSliver * h);
    if (kinks * h <= spacing) break;
    next = node(last.t + 0.5 * h);
  }
  return next;
}

void NystromPath::draw(Node& at, Rng& rng, Counters& counters) {
  if (forgets(at.t)) {  // not without the mean of intervals that may still be asked for
    const int same = static_cast<int>(means_.size());
    bool needed = false;
    for (Interval& interval : intervals_)
      if (interval.mean < 0) {
        interval.mean = same;
        needed = true;
      }
    if (needed) means_.push_back(rows_.mean());
    reach(at.t, counters);
  }
  const bool value_is_enough = varies() && alone();
  const LocalPoint local = value_is_enough ? rows_.line().local(at.at) : point(at.t);
  const LinePoint* on_line = varies() ? &at.at : nullptr;
  counters.tensor_lookups += varies();
  at.g = rows_.add_free(local, value_row(), rng, counters, 0, on_line);
  at.dg = rows_.add_free(local, slope_row(), rng, counters, 0, on_line);
}

void NystromPath::extend(Rng& rng, Counters& counters) {
  Node next = after(nodes_.back());
  // At infinity where g is constant along the line.
  if (std::isfinite(next.t)) draw(next, rng, counters);
  if (start_known_ && nodes_.size() == 1 && std::isfinite(next.t))
    near_.know(anchor_, nodes_[0].g, nodes_[0].dg, kNear * (next.t - anchor_));
  intervals_.push_back({nodes_.back().t, next.t});
  nodes_.push_back(next);
}

void NystromPath::prepare(long cell, Rng& rng, Counters& counters) {
  const double left = anchor_ + cell * step_, right = std::min(left + step_, t_end_);
  if (left > nodes_.back().t) {  // a stretch was skipped: goes on here, given all before it
    nodes_.push_back(node(left));
    draw(nodes_.back(), rng, counters);
  }
  // Behind a known start the first interval is short: the node behind it matters there too.
  const std::size_t least = start_known_ ? 2 : 1;
  while (nodes_.back().t < right || (intervals_.size() < least && std::isfinite(nodes_.back().t)))
    extend(rng, counters);
  if (varies())
    margin_ = 1 + pull(left) / 4.5;
  else if (std::isfinite(step_) && margin_ < 0)
    margin_ = bound_of(deviation_from_cubic(*covariance_, line_, left, step_), pull(left));
}

// Later rows change nothing that matters of the mean between nodes that both are among them.
const JointRows::Mean& NystromPath::mean(Interval& interval) {
  if (interval.mean < 0) {
    interval.mean = static_cast<int>(means_.size());
    means_.push_back(rows_.mean());
  }
  return means_[static_cast<std::size_t>(interval.mean)];
}

void NystromPath::evaluate(double t, double& g, double& dg) {
  for (std::size_t i = nodes_.size(); i-- > 0 && nodes_[i].t >= t;)
    if (nodes_[i].t == t) {
      g = nodes_[i].g;
      dg = nodes_[i].dg;
      return;
    }
  const auto mean = [this](double at, double& v, double& dv) { mean_at(at, v, dv); };
  near_.holds(t) ? near_.read(t, g, dg, mean) : mean(t, g, dg);
}

void NystromPath::mean_at(double t, double& g, double& dg) {
  std::size_t i = intervals_.size() - 1;
  while (i > 0 && t < intervals_[i].begin) --i;
  const JointRows::Mean& of = mean(intervals_[i]);
  if (!varies() || of.elsewhere) {
    const LocalPoint at = point(t);
    return rows_.evaluate(of, at, line_.direction, along(at), g, dg);
  }
  const bool inside = piece_begin_ <= t && t <= piece_end_;
  const double sliver = kSliver * (piece_end_ - piece_begin_);
  const double side = inside ? std::clamp(t, piece_begin_ + sliver, piece_end_ - sliver) : t;
  rows_.evaluate(of, rows_.line().at(t, side), g, dg);
}

// The cubic is off by the fourth derivative, so by h⁴ of what it is off over a whole cell, or by
// (h/ℓ)⁴ of what it is off over a length scale; and where the slope jumps by J, by at most J h/6.
double NystromPath::deviation(double a, double h) const {
  if (std::isinf(step_)) return 0;
  if (!varies()) {
    const double s = h / step_;
    return margin_ * (s * s) * (s * s);
  }
  double shortest = kInfinity;  // of the nodes around
  for (std::size_t i = nodes_.size(); i-- > 0;) {
    if (i > 0 && nodes_[i - 1].t >= a + h) continue;
    shortest = std::min(shortest, nodes_[i].length_scale);
    if (nodes_[i].t <= a) break;
  }
  const double s = h / shortest, sliver = kSliver * h;
  const double kinks =
      covariance_->anisotropy()->kinks(line_.origin, line_.direction, a + sliver, a + h - sliver);
  return margin_ * (plan_->cubic * (s * s) * (s * s) + 0.75 * h * kinks);
}

std::unique_ptr<LineSampler> make_nystrom(const GaussianProcess& process, const Box3& bounds) {
  return make_sampler<NystromPath, Fields::any>(process, bounds);
}

}  // namespace gpis

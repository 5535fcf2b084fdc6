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
  // |implied - exact covariance| is at most the variance that the nodes leave, here on lines
  // through the bounds; closer nodes until it is small.
  for (;; spacing *= 0.8) {
    correlation_error = 0;
    for (const SurveyLine& line : survey_lines(covariance, bounds)) {
      NystromPath path;
      Rng rng(1, 0);
      Counters counters;
      double g, dg;
      path.reset(*this, line.geometry, 0, line.end, counters);
      path.start_free(rng, counters, g, dg);
      while (path.nodes_[path.end_].t < line.end) {
        const std::size_t begin = path.end_;
        path.extend(rng, counters);
        for (std::size_t i = begin; i < path.end_; ++i) {
          Eigen::Vector4d mean;
          Eigen::Matrix4d law;
          const double t = 0.5 * (path.nodes_[i].t + path.nodes_[i + 1].t);
          path.rows_.law(path.point(t), mean, law);
          correlation_error = std::max(correlation_error, law(0, 0) / covariance.variance());
        }
      }
    }
    if (correlation_error < 2e-4 || spacing < 0.2) break;
  }
}

void NystromPath::reset(const Plan& plan, const LineGeometry& line, double anchor, double t_end,
                        Counters& counters) {
  begin(plan, line, anchor, counters);
  plan_ = &plan;
  t_end_ = t_end;
  step_ = varies() ? plan_step(t_end) : survey_step(*covariance_, line, anchor, t_end);
  margin_ = -1;
  enter(anchor, anchor);
  begin_run(anchor);
}

// The spacing of nodes at the shortest length scale near the anchor: where others follow, nodes and
// steps come closer by themselves.
double NystromPath::plan_step(double t_end) const {
  const LineRows& line = rows_.line();
  double shortest = line.length_scale(*line_anchor());
  for (const double lengths : {1.5, 4.0}) {
    const double t = anchor_ + lengths * shortest;
    if (t < t_end) shortest = std::min(shortest, line.length_scale(line.at(t)));
  }
  return plan_->spacing * shortest;
}

NystromPath::Node NystromPath::node(double t) const {
  Node out{t, {}, 0};
  if (varies()) {
    out.at = t == anchor_ ? *line_anchor() : rows_.line().at(t);
    out.length_scale = rows_.line().length_scale(out.at);
  } else if (std::isfinite(t)) {
    out.length_scale = covariance_->length_scale(point(t), line_.direction);
  }
  return out;
}

void NystromPath::begin_run(double t) {
  nodes_.assign(1, node(t));
  end_ = 0;
  if (t == anchor_) blocks_.clear();
}

void NystromPath::start_free(Rng& rng, Counters& counters, double& g, double& dg) {
  JointLine::start_free(rng, counters, g, dg);
  begin_run(anchor_);
}

double NystromPath::start(const PathStart& known, Rng& rng, Counters& counters) {
  const double slope = JointLine::start(known, rng, counters);
  begin_run(anchor_);
  return slope;
}

// As far as the lengths at both allow. Where lengths vary, on the ends and middles of cells if
// these are no farther apart: what is known at a node serves the march too.
NystromPath::Node NystromPath::after(const Node& last) const {
  const auto farther = [&](double length) {
    const double t = last.t + plan_->spacing * length;
    if (!varies() || t - last.t < (1 - 1e-9) * step_) return t;
    return anchor_ + 0.5 * std::floor(2 * (t - anchor_) / step_ + 1e-6) * step_;
  };
  Node next = node(farther(last.length_scale));
  if (next.length_scale < last.length_scale) {
    const double t = farther(next.length_scale);
    if (t < next.t) next = node(t);
  }
  return next;
}

void NystromPath::draw(const Node& at, const Functional& what, Rng& rng, Counters& counters) {
  reach(at.t, counters);
  if (!varies())
    rows_.add_free(point(at.t), what, rng, counters);
  else
    rows_.add_free(what.value_only() ? rows_.line().local(at.at) : point(at.t), what, rng, counters,
                   0, &at.at);
}

void NystromPath::extend(Rng& rng, Counters& counters) {
  const double begin = nodes_[end_].t;
  for (int i = 0; i < kBlock && (i == 0 || nodes_[end_].t < t_end_); ++i) {
    ++end_;
    while (nodes_.size() <= end_ + kBeyond) {
      nodes_.push_back(after(nodes_.back()));
      if (std::isfinite(nodes_.back().t)) draw(nodes_.back(), value_row(), rng, counters);
    }
  }
  // At infinity where g is constant along the line.
  if (std::isfinite(nodes_[end_].t)) draw(nodes_[end_], slope_row(), rng, counters);
  blocks_.push_back({begin, nodes_[end_].t, rows_.mean()});
}

void NystromPath::prepare(long cell, Rng& rng, Counters& counters) {
  const double left = anchor_ + cell * step_, right = std::min(left + step_, t_end_);
  if (left > nodes_.back().t) {  // a stretch was skipped: a run of its own, given all before it
    begin_run(left);
    draw(nodes_[0], value_row(), rng, counters);
    draw(nodes_[0], slope_row(), rng, counters);
  }
  while (nodes_[end_].t < right || blocks_.empty()) extend(rng, counters);
  if (varies()) {
    // The shortest length scale around the cell.
    double shortest = kInfinity;
    for (std::size_t i = nodes_.size(); i-- > 0;) {
      if (i > 0 && nodes_[i - 1].t >= right) continue;
      shortest = std::min(shortest, nodes_[i].length_scale);
      if (nodes_[i].t <= left) break;
    }
    const double s = step_ / shortest;
    margin_ = (1 + pull(left) / 4.5) * plan_->cubic * (s * s) * (s * s);
    kink_margin_ = 0.75 * (1 + pull(left) / 4.5);
  } else if (std::isfinite(step_) && margin_ < 0) {
    margin_ = bound_of(deviation_from_cubic(*covariance_, line_, left, step_), pull(left));
  }
}

void NystromPath::evaluate(double t, double& g, double& dg) const {
  std::size_t block = blocks_.size() - 1;
  while (block > 0 && t < blocks_[block].begin) --block;
  const JointRows::Mean& mean = blocks_[block].mean;
  if (!varies() || mean.elsewhere) {
    const LocalPoint at = point(t);
    return rows_.evaluate(mean, at, line_.direction, along(at), g, dg);
  }
  for (const Node& node : nodes_)
    if (node.t == t) return rows_.evaluate(mean, node.at, g, dg);
  const bool inside = piece_begin_ <= t && t <= piece_end_;
  const double sliver = kSliver * (piece_end_ - piece_begin_);
  const double side = inside ? std::clamp(t, piece_begin_ + sliver, piece_end_ - sliver) : t;
  rows_.evaluate(mean, rows_.line().at(t, side), g, dg);
}

// The cubic is off by the fourth derivative, so by h⁴ of what it is off over a whole cell; and
// where the slope jumps by J, by at most J h/6.
double NystromPath::deviation(double a, double h) const {
  if (std::isinf(step_)) return 0;
  const double s = h / step_, smooth = margin_ * (s * s) * (s * s), sliver = kSliver * h;
  if (!varies()) return smooth;
  return smooth + kink_margin_ * h *
                      covariance_->anisotropy()->kinks(line_.origin, line_.direction, a + sliver,
                                                       a + h - sliver);
}

std::unique_ptr<LineSampler> make_nystrom(const GaussianProcess& process, const Box3& bounds) {
  return std::make_unique<MarchSampler<AnyLine, AnyLine, NystromPath>>(
      NystromPath::Plan(process, bounds));  // covariances cost more than virtual fields
}

}  // namespace gpis

#include "process/nystrom_path.h"

#include "field/check.h"
#include "process/march_sampler.h"
#include "process/survey.h"

namespace gpis {

NystromPath::Plan::Plan(const GaussianProcess& process, const Box3& bounds)
    : JointLine::Plan(process) {
  if (!covariance.smooth())
    refuse("The nystrom sampler cannot serve the kernel ", process.kernel->describe(),
           ": values at half a length scale do not determine it. Take the sampler 'dense'.");
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
      while (path.nodes_[path.end_] < line.end) {
        const std::size_t begin = path.end_;
        path.extend(rng, counters);
        for (std::size_t i = begin; i < path.end_; ++i) {
          Eigen::Vector4d mean;
          Eigen::Matrix4d law;
          const double t = 0.5 * (path.nodes_[i] + path.nodes_[i + 1]);
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
  spacing_ = plan.spacing;
  t_end_ = t_end;
  step_ = survey_step(*covariance_, line, anchor, t_end);
  kinks_ = {};
  if (covariance_->anisotropy()) kinks_ = covariance_->anisotropy()->kinks(line.direction);
  margin_ = -1;
  begin_run(anchor);
}

void NystromPath::begin_run(double t) {
  nodes_.assign(1, t);
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

double NystromPath::next_node(double t) const {
  const double here = covariance_->length_scale(point(t), line_.direction);
  if (!std::isfinite(t + here)) return kInfinity;
  const double there = covariance_->length_scale(point(t + spacing_ * here), line_.direction);
  return t + spacing_ * std::min(here, there);
}

void NystromPath::extend(Rng& rng, Counters& counters) {
  const double begin = nodes_[end_];
  for (int i = 0; i < kBlock && (i == 0 || nodes_[end_] < t_end_); ++i) {
    ++end_;
    while (nodes_.size() <= end_ + kBeyond) {
      nodes_.push_back(next_node(nodes_.back()));
      if (!std::isfinite(nodes_.back())) continue;
      reach(nodes_.back(), counters);
      rows_.add_free(point(nodes_.back()), value_row(), rng, counters);
    }
  }
  // At infinity where g is constant along the line.
  if (std::isfinite(nodes_[end_])) rows_.add_free(point(nodes_[end_]), slope_row(), rng, counters);
  blocks_.push_back({begin, nodes_[end_], rows_.mean()});
}

void NystromPath::prepare(long cell, Rng& rng, Counters& counters) {
  const double left = anchor_ + cell * step_, right = std::min(left + step_, t_end_);
  if (left > nodes_.back()) {  // a stretch was skipped: a run of its own, given all before it
    const LocalPoint at = point(left);
    reach(left, counters);
    rows_.add_free(at, value_row(), rng, counters);
    rows_.add_free(at, slope_row(), rng, counters);
    begin_run(left);
  }
  while (nodes_[end_] < right || blocks_.empty()) extend(rng, counters);
  if (std::isfinite(step_) && (margin_ < 0 || !covariance_->stationary()))
    margin_ = 1.25 * (4.5 + pull(left)) / 0.75 * deviation_from_cubic(left, step_);
}

void NystromPath::evaluate(double t, double& g, double& dg) const {
  std::size_t block = blocks_.size() - 1;
  while (block > 0 && t < blocks_[block].begin) --block;
  const LocalPoint at = point(t);
  rows_.evaluate(blocks_[block].mean, at, line_.direction, along(at), g, dg);
}

// The cubic is off by the fourth derivative, so by h⁴ of what it is off over a whole cell; and
// where the slope jumps by J, by at most J h/6.
double NystromPath::deviation(double h) const {
  if (std::isinf(step_)) return 0;
  const double s = h / step_;
  return margin_ * (s * s) * (s * s) + 0.75 * h * (kinks_.once + kinks_.rate * h);
}

std::unique_ptr<LineSampler> make_nystrom(const GaussianProcess& process, const Box3& bounds) {
  return std::make_unique<MarchSampler<AnyLine, AnyLine, NystromPath>>(
      NystromPath::Plan(process, bounds));  // covariances cost more than virtual fields
}

}  // namespace gpis

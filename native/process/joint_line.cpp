#include "process/joint_line.h"

#include "field/check.h"

namespace gpis {
namespace {

// Times the shortest length scale: as far as is looked ahead where no longest one is known.
constexpr double kLongest = 1e3;
// Of the points looked at there: how far apart, in length scales, how far, and what their distances
// grow by from there on.
constexpr double kBetween = 0.6, kNear = 40, kGrowth = 0.1;

Eigen::Vector4d of(const Functional& f) {
  return {f.value, f.slope.x, f.slope.y, f.slope.z};
}

}  // namespace

JointLine::Plan::Plan(const GaussianProcess& process) : covariance(process) {
  if (!covariance.differentiable())
    refuse("The kernel ", process.kernel->describe(),
           " has no gradient: the joint samplers take differentiable kernels.");
  posterior = posterior_of(process);
}

void JointLine::begin(const Plan& plan, const LineGeometry& line, double anchor,
                      Counters& counters) {
  const int block =
      plan.posterior ? plan.posterior->block(line.origin + line.direction * anchor) : -1;
  const bool same_base = covariance_ == &plan.covariance && posterior_ == plan.posterior &&
                         block == block_ && !segments_ && !base_has_segments_;
  covariance_ = &plan.covariance;
  posterior_ = plan.posterior;
  line_ = line;
  anchor_ = anchor;
  at_anchor_ = point(anchor);
  ++counters.factorisations;
  if (!same_base) begin_base(block, counters);
  if (same_base && !rebased_) {
    rows_.truncate(lasting_rows_);
    counters.condition_rows += lasting_rows_;
  } else {
    rows_.reset(base_);
  }
  rebased_ = false;
  lost_ = 0;
  lasting_rows_ = rows_.count();
  if (covariance_->anisotropy()) {
    ++counters.tensor_lookups;
    rows_.begin_line(line_);
    on_line_at_anchor_ = rows_.line().at(anchor, at_anchor_);
  }
  rows_.law(at_anchor_, anchor_mean_, anchor_law_);
  pull_end_ = anchor;
  // Of conditions that the line may come to meet, and of what it knows already.
  pull_ = plan.pull() + (segments_ ? base_.known_norm() : 0);
}

void JointLine::begin_base(int block, Counters& counters) {
  block_ = block;
  if (block >= 0) {
    base_.reset(posterior_->rows(block));
    counters.condition_rows += base_.count();
  } else {
    base_.reset(*covariance_);
  }
  if (segments_)
    for (const auto& segment : segments_->segments)
      for (const SegmentMemory::Row& row : segment)
        base_.add_known(covariance_->at(row.at), row.what, sign_ * row.value, row.noise, counters);
  base_has_segments_ = segments_;
}

bool JointLine::forgets(double t) const {
  return rows_.active() - base_.count() > kMostRows ||
         (posterior_ && posterior_->block(line_.origin + line_.direction * t) != block_);
}

void JointLine::reach(double t, Counters& counters) {
  if (!forgets(t)) return;
  const int block = posterior_ ? posterior_->block(line_.origin + line_.direction * t) : -1;
  const bool same = block == block_;
  const int given = base_.count();
  if (!same) begin_base(block, counters);
  ++counters.factorisations;
  rebased_ = true;
  lost_ = std::max(lost_, rows_.rebase(base_, given, same, kKept, ahead(t)));
}

// So close that nothing lies between for kNear lengths, then at distances that grow so slowly that
// no wave meets all of them in the same phase; slopes where they are not but differences of these
// values.
std::vector<JointRows::Ahead> JointLine::ahead(double t) const {
  std::vector<JointRows::Ahead> out;
  const double length = covariance_->length_scale(point(t), line_.direction);
  const double end = 4 * std::min(covariance_->longest_length() / gpis::length(line_.direction),
                                  kLongest * length);
  for (double h = 0; h <= end; h += std::max(kBetween, kGrowth * (h / length - kNear)) * length) {
    const LocalPoint at = point(t + h);
    const LinePoint on_line = rows_.has_line() ? rows_.line().at(t + h, at) : LinePoint{};
    out.push_back({at, on_line, value_row()});
    if (h < length) out.push_back({at, on_line, slope_row()});
  }
  return out;
}

double JointLine::near_length(double t_end) const {
  if (covariance_->stationary()) return covariance_->length_scale(at_anchor_, line_.direction);
  const LineRows& line = rows_.line();
  double shortest = line.plain_length_scale(on_line_at_anchor_);
  for (const double lengths : {1.0, 3.0}) {
    const double t = anchor_ + lengths * shortest;
    if (t < t_end) shortest = std::min(shortest, line.plain_length_scale(line.at(t)));
  }
  return shortest;
}

// A start that conditions or segments fix has no freedom left.
double JointLine::value_deviation() const {
  return anchor_law_(0, 0) > JointRows::kPivot * covariance_->variance()
             ? std::sqrt(anchor_law_(0, 0))
             : 0;
}

void JointLine::record(double t, std::vector<SegmentMemory::Row>& rows) const {
  const Vec3& d = line_.direction;
  rows_.visit_own(lasting_rows_,
                  [&](const Vec3& at, const Functional& what, double value, double noise) {
                    if (dot(at - line_.origin, d) <= t * dot(d, d))
                      rows.push_back({at, what, sign_ * value, noise});
                  });
}

void JointLine::slope_law(double g0, double& mean, double& deviation) const {
  const Eigen::Vector4d d = of(slope_row());
  const double variance = anchor_law_(0, 0), shared = anchor_law_.row(0).dot(d);
  const double gain = variance > JointRows::kPivot ? shared / variance : 0;
  mean = anchor_mean_.dot(d) + gain * (g0 - anchor_mean_[0]);
  deviation = std::sqrt(std::max(0.0, d.dot(anchor_law_ * d) - gain * shared));
}

void JointLine::start_free(Rng& rng, Counters& counters, double& g, double& dg) {
  rows_.truncate(lasting_rows_);
  const LinePoint* here = line_anchor();
  g = rows_.add_free(at_anchor_, value_row(), rng, counters, 0, here);
  dg = rows_.add_free(at_anchor_, slope_row(), rng, counters, 0, here);
}

double JointLine::start(const PathStart& known, Rng& rng, Counters& counters) {
  rows_.truncate(lasting_rows_);
  const LinePoint* here = line_anchor();
  rows_.add_known(at_anchor_, value_row(), known.value, 0, counters, here);
  double slope = known.slope;
  if (known.slope_known)
    rows_.add_known(at_anchor_, slope_row(), slope, 0, counters, here);
  else
    slope = rows_.add_free(at_anchor_, slope_row(), rng, counters, 0, here);
  if (known.gradient_known) {
    const Frame across(normalize(line_.direction));
    for (const Vec3& w : {across.s, across.t})
      rows_.add_known(at_anchor_, {0, w}, dot(w, known.gradient), 0, counters, here);
  }
  // A correlation of 1e-6 of what is known no longer matters; lengths at most the longest.
  const double reach = std::min(covariance_->reach(1e-6), 60.0) * covariance_->longest_length();
  pull_end_ = std::max(pull_end_, anchor_ + reach / length(line_.direction));
  return slope;
}

// The law of ∇g given all rows. The little variance that they leave to the slope along the line is
// the path's error; the path's slope stands. Slope and error lie along C d, C = Cov ∇g, which is
// independent of the gradient across: along d itself, lengths of 1 : 1000 would turn an error of
// 1e-3 in the slope into one of 1 across.
PathGradient JointLine::gradient(double t, double, double dg, Rng&) {
  const LocalPoint at = point(t);
  Eigen::Vector4d mean;
  Eigen::Matrix4d law;
  if (rows_.has_line())
    rows_.law(at, rows_.line().at(t, at), mean, law);
  else
    rows_.law(at, mean, law);
  const Eigen::Matrix4d prior = covariance_->block(at, at);
  const Vec3& direction = line_.direction;
  const Frame frame(normalize(direction));
  PathGradient out;
  out.mean = {mean[1], mean[2], mean[3]};
  const Eigen::Vector4d d = of({0, direction}), along = prior * d;
  const double variance = d.dot(along);
  const Eigen::Vector4d unit =
      variance > 0 ? Eigen::Vector4d(along / variance) : Eigen::Vector4d(d / d.squaredNorm());
  out.mean += Vec3{unit[1], unit[2], unit[3]} * (dg - dot(direction, out.mean));
  Eigen::Matrix4d project = Eigen::Matrix4d::Identity();
  project -= unit * d.transpose();
  const Eigen::Vector4d s = of({0, frame.s}), u = of({0, frame.t});
  const auto across = [&](const Eigen::Matrix4d& whole_law) {
    const Eigen::Matrix4d m = project * whole_law * project.transpose();
    Eigen::Matrix2d c;
    c << s.dot(m * s), s.dot(m * u), u.dot(m * s), u.dot(m * u);
    return c;
  };
  const Eigen::Matrix2d spread = across(law), whole = across(prior);
  const double first = std::sqrt(std::max(0.0, spread(0, 0)));
  const double both = first > 0 ? spread(0, 1) / first : 0;
  const double second = std::sqrt(std::max(0.0, spread(1, 1) - both * both));
  out.b1 = frame.s * first + frame.t * both;
  out.b2 = frame.t * second;
  const auto area2 = [](const Eigen::Matrix2d& c) {
    return std::max(0.0, c(0, 0) * c(1, 1) - c(0, 1) * c(1, 0));
  };
  out.free_variance = std::sqrt(area2(spread) / std::max(area2(whole), 1e-300));
  return out;
}

}  // namespace gpis

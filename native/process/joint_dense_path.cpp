#include "process/joint_dense_path.h"

#include <algorithm>

#include "process/march_sampler.h"

namespace gpis {
namespace {

// Values and slopes of a smooth process at points this close all but determine each other: without
// noise of their own the rows drawn last follow from the ones before by weights of 1e4 and more,
// and rounding made covariances of 1e3 σ² out of them over 7 length scales (leaving such rows out
// costs 1e-3 where it is stable). The correlation is off by this much, the path stays a cubic.
constexpr double kJitter = 1e-6;
// Of the little that a known start leaves of rows close to it.
constexpr double kBehindStart = 1e-3;

// What is found on the lines surveyed may be exceeded on others: by 1.12 on the most unlike of
// tests/native/test_implied_covariance.cpp, whose true errors are below two thirds of it.
constexpr double kElsewhere = 1.25;
constexpr double kEnough = 8e-4, kClosest = 0.05;
// Length scales of a line that forgets.
constexpr double kFar = 40;

// Of the way between two points: nearer to what is drawn, rests are the cubic around, off by 1e-10
// standard deviations at most.
constexpr double kFinest = 1e-7;

// How far off its cubic, in units of (B₁ + B₂), a path between points may be, for 4.5 standard
// deviations of a bridge: as DensePath's, (B₁+B₂)(½) = ¾, and 5 % for shorter intervals.
double bridge_bound(double intensity, double h) {
  return 4.5 * 1.05 / 0.75 * std::sqrt(intensity * h * h * h / 192);
}

}  // namespace

JointDensePath::Plan::Plan(const GaussianProcess& process, const Box3& bounds)
    : JointLine::Plan(process),
      spacing{covariance.smooth() ? 0.25 : 0.15, 0.04, 5e-4,
              DensePoints::roughness_under(process)} {
  spacing.first = DensePoints::first_under(process, spacing.lengths);
  spacing.widest = spacing.lengths;
  const std::vector<SurveyLine> lines = survey_lines(covariance, bounds);
  // Closer points until the cubics are good enough for lengths that vary.
  for (;; spacing.lengths *= 0.8, spacing.kinks *= 0.5, spacing.missed *= 0.5) {
    correlation_error = 0;
    for (const SurveyLine& line : lines)
      correlation_error = std::max(correlation_error, kElsewhere * error_on(*this, line));
    if (correlation_error < kEnough || spacing.lengths < kClosest) break;
  }
  double lost = 0;
  for (const SurveyLine& line : survey_lines(covariance, bounds, kFar))
    lost = std::max(lost, lost_on(*this, line));
  correlation_error += kElsewhere * lost;
}

// Between cubics over one interval and over the same, the next and farther ones: what kinks do
// shows from afar too.
double JointDensePath::error_on(const Plan& plan, const SurveyLine& line) {
  JointDensePath path;
  Counters counters;
  path.reset(plan, line.geometry, 0, line.end, counters);
  if (std::isinf(path.step_)) return 0;
  std::vector<DensePoints::Interval> intervals;
  double largest = 0;
  for (double t = 0; t < line.end && intervals.size() < kMostSurveyed; t = intervals.back().end) {
    intervals.push_back({t, path.where_.after(t)});
    for (const std::size_t back : {0, 1, 2, 3, 5, 8, 13, 21})
      if (back < intervals.size())
        largest = std::max(largest, path.where_.error_of_cubics(
                                        intervals[intervals.size() - 1 - back], intervals.back()));
    if (!path.rows_.has_line() && intervals.size() > 21) break;  // all are like these
  }
  return largest;
}

// The largest correlation that a line forgets.
double JointDensePath::lost_on(const Plan& plan, const SurveyLine& line) {
  JointDensePath path;
  Rng rng(1, 0);
  Counters counters;
  double g, dg;
  path.reset(plan, line.geometry, 0, line.end, counters);
  path.start_free(rng, counters, g, dg);
  while (std::isfinite(path.step_) && path.points_.back().t < line.end &&
         path.points_.size() < kMostSurveyed)
    path.extend(rng, counters);
  return path.lost();
}

void JointDensePath::reset(const Plan& plan, const LineGeometry& line, double anchor, double t_end,
                           Counters& counters) {
  begin(plan, line, anchor, counters);
  rests_.clear();
  counters_ = &counters;
  step_ = plan.spacing.lengths * near_length(t_end);
  where_.reset(*covariance_, line_, rows_.has_line() ? &rows_.line() : nullptr, plan.spacing,
               anchor, step_);
}

void JointDensePath::start_free(Rng& rng, Counters& counters, double& g, double& dg) {
  JointLine::start_free(rng, counters, g, dg);
  points_.assign(1, {anchor_, g, dg});
}

double JointDensePath::start(const PathStart& known, Rng& rng, Counters& counters) {
  const double slope = JointLine::start(known, rng, counters);
  points_.assign(1, {anchor_, known.value, slope});
  where_.start_known();
  return slope;
}

void JointDensePath::draw(double t, Rng& rng, Counters& counters) {
  reach(t, counters);
  LinePoint place;
  LocalPoint p;
  const LinePoint* on_line = nullptr;
  if (rows_.has_line()) {
    ++counters.tensor_lookups;
    place = rows_.line().at(t);
    on_line = &place;
    p = alone() ? rows_.line().local(place) : point(t);
  } else {
    p = point(t);
  }
  const double of_left = where_.grows(t) ? kBehindStart : kInfinity;
  const double g = rows_.add_free(p, value_row(), rng, counters, kJitter, on_line, of_left);
  points_.push_back(
      {t, g, rows_.add_free(p, slope_row(), rng, counters, kJitter, on_line, of_left)});
}

void JointDensePath::extend(Rng& rng, Counters& counters) {
  const double t = points_.back().t;
  draw(where_.after(t), rng, counters);
  points_[points_.size() - 2].intensity =
      std::max(where_.slope_intensity(t), where_.slope_intensity(points_.back().t));
}

void JointDensePath::prepare(long cell, Rng& rng, Counters& counters) {
  if (std::isinf(step_)) return;  // constant along the line
  // A stretch was skipped: goes on here, given all before it.
  if (points_.back().t < cell_end(cell - 1)) draw(cell_end(cell - 1), rng, counters);
  while (points_.back().t < cell_end(cell)) extend(rng, counters);
  draw_rest(cell_end(cell), rng);
}

std::size_t JointDensePath::before(double t) const {
  std::size_t i = points_.size() - 1;
  while (i > 0 && points_[i].t > t) --i;
  return i;
}

std::vector<BridgePoint>::const_iterator JointDensePath::rest_behind(double t) const {
  return std::upper_bound(rests_.begin(), rests_.end(), t,
                          [](double x, const BridgePoint& rest) { return x < rest.t; });
}

std::array<BridgePoint, 2> JointDensePath::rests_around(std::size_t piece, double t) const {
  std::array<BridgePoint, 2> around{BridgePoint{points_[piece].t, 0, 0},
                                    BridgePoint{points_[piece + 1].t, 0, 0}};
  const auto right = rest_behind(t);
  if (right != rests_.begin() && (right - 1)->t > around[0].t) around[0] = *(right - 1);
  if (right != rests_.end() && right->t < around[1].t) around[1] = *right;
  return around;
}

void JointDensePath::draw_rest(double t, Rng& rng) {
  const std::size_t piece = before(t);
  if (!(points_[piece].intensity > 0) || piece + 1 == points_.size()) return;
  const double finest = kFinest * (points_[piece + 1].t - points_[piece].t);
  const auto [a, b] = rests_around(piece, t);
  if (!(std::min(t - a.t, b.t - t) > finest)) return;
  counters_->line_normals += 2;
  rests_.insert(rest_behind(t), draw_between(a, b, where_.slope_intensity(t), t, rng));
}

void JointDensePath::read(double t, double& g, double& dg) const {
  const std::size_t piece = before(t);
  const Point& a = points_[piece];
  g = a.g;
  dg = a.dg;
  if (t == a.t || piece + 1 == points_.size()) return;
  const Point& b = points_[piece + 1];
  const BridgePoint middle = cubic_between({a.t, a.g, a.dg}, {b.t, b.g, b.dg}, t);
  g = middle.g;
  dg = middle.dg;
  if (!(a.intensity > 0)) return;
  const auto [left, right] = rests_around(piece, t);
  const BridgePoint rest = cubic_between(left, right, t);
  g += rest.g;
  dg += rest.dg;
}

void JointDensePath::at_right(long cell, double& g, double& dg) const {
  if (std::isinf(step_)) {
    g = points_[0].g;
    dg = points_[0].dg;
    return;
  }
  read(cell_end(cell), g, dg);
}

void JointDensePath::at(long, double t, Rng& rng, double& g, double& dg) {
  draw_rest(t, rng);
  read(t, g, dg);
}

double JointDensePath::deviation(double a, double h) const {
  if (std::isinf(step_)) return 0;
  const std::size_t piece = before(a);
  const bool whole = piece + 1 >= points_.size() || points_[piece + 1].t >= a + h;
  return whole ? bridge_bound(points_[piece].intensity, h) : deviation_over_points(piece, a, h);
}

// Over points the path is off that cubic by one in every piece, of Bernstein's coefficients c, and
// what bridges add. In the inner ones (B₁+B₂)(s) = 3s(1-s) is that of their ends at least; in the
// first, w of the whole, c₀ = c₁ = 0, and at a fraction u of it 3uw(1-uw) are there to hold
// 3u²(1-u)|c₂| + u³|c₃| and the bridge's 3u(1-u).
double JointDensePath::deviation_over_points(std::size_t piece, double a, double h) const {
  Point left{a, 0, 0}, end{a + h, 0, 0};
  read(a, left.g, left.dg);
  read(end.t, end.g, end.dg);
  const Point begin = left;
  const auto off = [&](const Point& p) {
    const BridgePoint c = cubic_between({a, begin.g, begin.dg}, {end.t, end.g, end.dg}, p.t);
    return std::array{p.g - c.g, p.dg - c.dg};
  };
  double largest = 0;
  for (std::array<double, 2> e0{0, 0}; left.t < end.t; ++piece) {
    const bool last = piece + 1 >= points_.size() || points_[piece + 1].t >= end.t;
    const Point right = last ? end : points_[piece + 1];
    const std::array<double, 2> e1 = last ? std::array{0.0, 0.0} : off(right);
    const double k = right.t - left.t, w = k / h;
    const double c[] = {std::abs(e0[0]), std::abs(e0[0] + e0[1] * k / 3),
                        std::abs(e1[0] - e1[1] * k / 3), std::abs(e1[0])};
    const double bridge = bridge_bound(points_[piece].intensity, k);
    if (left.t == a) {
      largest = std::max(largest, (c[2] / 4 + c[3] / 3) / (w * (1 - w)) + bridge / w);
    } else if (last) {
      largest = std::max(largest, (c[1] / 4 + c[0] / 3) / (w * (1 - w)) + bridge / w);
    } else {
      const double s = (left.t - a) / h, u = (right.t - a) / h;
      largest = std::max(largest, (*std::max_element(c, c + 4) + 0.75 * bridge) /
                                      (3 * std::min(s * (1 - s), u * (1 - u))));
    }
    left = right;
    e0 = e1;
  }
  return largest;
}

std::unique_ptr<LineSampler> make_joint_dense(const GaussianProcess& process, const Box3& bounds) {
  return make_sampler<JointDensePath, Fields::any>(process, bounds);
}

}  // namespace gpis

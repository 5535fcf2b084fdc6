#include "process/joint_dense_path.h"

#include <algorithm>
#include <span>

#include "process/march_sampler.h"
#include "process/survey.h"

namespace gpis {
namespace {

// Values and slopes of a smooth process at points this close all but determine each other: without
// noise of their own the rows drawn last follow from the ones before by weights of 1e4 and more,
// and rounding made covariances of 1e3 σ² out of them over 7 length scales (leaving such rows out
// costs 1e-3 where it is stable). The correlation is off by this much, the path stays a cubic.
constexpr double kJitter = 1e-6;

// Of a line that is surveyed, each as a ray of its own.
constexpr int kParts = 6;
// What is found there is exceeded on lines of other directions, by 1.4 in
// tests/native/test_implied_covariance.cpp.
constexpr double kElsewhere = 2;

// Through (a, da) at `begin` and (b, db) at `end`, in Bernstein's form.
void cubic(double begin, double a, double da, double end, double b, double db, double t, double& g,
           double& dg) {
  const double h = end - begin, s = (t - begin) / h, r = 1 - s;
  const double c1 = a + da * h / 3, c2 = b - db * h / 3;
  g = r * r * r * a + 3 * r * r * s * c1 + 3 * r * s * s * c2 + s * s * s * b;
  dg = 3 * (r * r * (c1 - a) + 2 * r * s * (c2 - c1) + s * s * (b - c2)) / h;
}

// Of a cell, of which the rest is a cubic.
constexpr int kHalvings = 8;

// One of a sum of values and slopes of g.
struct Part {
  LocalPoint at;
  Functional what;
};

double shared(const Covariance& covariance, std::span<const Part> a, std::span<const Part> b) {
  double sum = 0;
  for (const Part& p : a)
    for (const Part& q : b) sum += covariance.between(p.at, p.what, q.at, q.what);
  return sum;
}

// At a fraction s of [a, a + h]: what the cubic through both ends has there, less g.
std::array<Part, 3> error_of_cubic(const Covariance& covariance, const LineGeometry& line, double a,
                                   double h, double s) {
  const double r = 1 - s;
  const Vec3 d = line.direction;
  const auto at = [&](double t) { return covariance.at(line.origin + d * t); };
  return {Part{at(a), {r * r * (1 + 2 * s), d * (r * r * s * h)}}, Part{at(a + s * h), {-1, {}}},
          Part{at(a + h), {s * s * (1 + 2 * r), d * (-s * s * r * h)}}};
}

// q of Var(g'(t + h) - g'(t)) = q h + O(h²), 0 of smoother paths. The cubic through values and
// slopes h apart misses a variance of q h³/192 in the middle, and one of order h⁵ of what has a
// second derivative: taken off by that of half the interval about the same place.
double slope_intensity(const Covariance& covariance, const LineGeometry& line, double a, double h) {
  const auto missed = [&](double begin, double length) {
    const auto error = error_of_cubic(covariance, line, begin, length, 0.5);
    return shared(covariance, error, error) / covariance.variance();
  };
  const double rough = (32 * missed(a + h / 4, h / 2) - missed(a, h)) / 3;
  return std::max(0.0, 192 * rough / (h * h * h));
}

// |implied - exact correlation| of the cubics through values and slopes at points h apart from
// within one cell to within another and to the points, at most.
double error_of_cubics(const Covariance& covariance, const SurveyLine& survey, double t, double h) {
  const LineGeometry& line = survey.geometry;
  const auto error = [&](double a, double s) { return error_of_cubic(covariance, line, a, h, s); };
  const auto value = [&](double s) {
    return std::array<Part, 1>{Part{covariance.at(line.origin + line.direction * s), {}}};
  };
  const auto shared = [&](std::span<const Part> a, std::span<const Part> b) {
    return gpis::shared(covariance, a, b);
  };
  double largest = 0;
  for (const double s : {0.25, 0.5, 0.75}) {
    const auto here = error(t, s);
    for (int k = 0; k < 4; ++k) {
      const double a = t + k * h;
      if (a + h > survey.end) break;  // lengths may change at once where bounds end
      largest = std::max(largest, std::abs(shared(here, value(a))));
      for (const double u : {0.25, 0.5, 0.75}) {
        const auto there = error(a, u);
        largest =
            std::max(largest, std::abs(shared(here, value(a + u * h)) +
                                       shared(value(t + s * h), there) + shared(here, there)));
      }
    }
  }
  return largest / covariance.variance();
}

}  // namespace

JointDensePath::Plan::Plan(const GaussianProcess& process, const Box3& bounds)
    : JointLine::Plan(process), spacing(covariance.smooth() ? 0.25 : 0.15) {
  // Closer points until the cubics are good enough for lengths that vary.
  for (;; spacing *= 0.7) {
    correlation_error = 0;
    for (const SurveyLine& line : survey_lines(covariance, bounds))
      // Points of a short ray lie farther apart: the shortest lengths of the line may be elsewhere.
      for (int part = 0; part < kParts; ++part) {
        const double begin = line.end * part / kParts, end = line.end * (part + 1) / kParts;
        const double h = 2 * spacing * survey_step(covariance, line.geometry, begin, end);
        if (!std::isfinite(h)) continue;
        const int cells = static_cast<int>(std::min(std::ceil((end - begin) / h), 40.0));
        for (int i = 0; i < cells; ++i)
          correlation_error =
              std::max(correlation_error, error_of_cubics(covariance, line, begin + i * h, h));
      }
    correlation_error *= kElsewhere;
    if (correlation_error < 1e-3 || spacing < 0.05) break;
  }
}

void JointDensePath::reset(const Plan& plan, const LineGeometry& line, double anchor, double t_end,
                           Counters& counters) {
  begin(plan, line, anchor, counters);
  rests_.clear();
  counters_ = &counters;
  step_ = 2 * plan.spacing * survey_step(*covariance_, line, anchor, t_end);
}

void JointDensePath::start_free(Rng& rng, Counters& counters, double& g, double& dg) {
  JointLine::start_free(rng, counters, g, dg);
  points_.assign(1, {0, g, dg});
}

double JointDensePath::start(const PathStart& known, Rng& rng, Counters& counters) {
  const double slope = JointLine::start(known, rng, counters);
  points_.assign(1, {0, known.value, slope});
  return slope;
}

void JointDensePath::draw(long index, Rng& rng, Counters& counters) {
  if (points_.back().index >= index) return;
  if (std::isinf(step_)) {  // constant along the line
    points_.push_back({index, points_.back().g, points_.back().dg});
    return;
  }
  reach(anchor_ + index * step_, counters);
  const LocalPoint p = point(anchor_ + index * step_);
  counters.tensor_lookups += !covariance_->stationary();
  const double g = rows_.add_free(p, value_row(), rng, counters, kJitter);
  points_.push_back({index, g, rows_.add_free(p, slope_row(), rng, counters, kJitter)});
}

void JointDensePath::prepare(long cell, Rng& rng, Counters& counters) {
  draw(cell, rng, counters);
  const std::size_t left = points_.size() - 1;
  draw(cell + 1, rng, counters);
  if (covariance_->smooth() || std::isinf(step_) || left + 1 == points_.size()) return;
  points_[left].intensity =
      slope_intensity(*covariance_, line_, anchor_ + points_[left].index * step_, step_);
}

const JointDensePath::Point& JointDensePath::point_of(long cell) const {
  std::size_t i = points_.size() - 1;
  while (points_[i].index > cell) --i;
  return points_[i];
}

void JointDensePath::at_left(long cell, double& g, double& dg) const {
  const Point& p = point_of(cell);
  g = p.g;
  dg = p.dg;
}

// As DensePath's: 4.5 standard deviations, (B₁+B₂)(½) = ¾, and 5 % for shorter intervals.
double JointDensePath::deviation(double a, double h) const {
  if (covariance_->smooth() || std::isinf(step_)) return 0;
  const Point& p = point_of(static_cast<long>(std::floor((a - anchor_) / step_ + 1e-9)));
  return 4.5 * 1.05 / 0.75 * std::sqrt(p.intensity * h * h * h / 192);
}

// An integrated Brownian motion given value and slope at both ends of an interval: the value of its
// middle has the variance q h³/192, the slope there q h/16, and neither knows of the other.
void JointDensePath::add_rest(long cell, double t, Rng& rng, double& g, double& dg) {
  const double intensity = point_of(cell).intensity;
  if (!(intensity > 0)) return;
  const double begin = anchor_ + cell * step_;
  Rest a{begin, 0, 0}, b{begin + step_, 0, 0};
  if (!(t > a.t && t < b.t)) return;
  auto right = std::upper_bound(rests_.begin(), rests_.end(), t,
                                [](double x, const Rest& rest) { return x < rest.t; });
  if (right != rests_.begin() && (right - 1)->t > a.t) a = *(right - 1);
  if (right != rests_.end() && right->t < b.t) b = *right;
  for (double h = b.t - a.t; a.t < t && h > 1.5 * std::ldexp(step_, -kHalvings); h = b.t - a.t) {
    const Rest middle{
        a.t + h / 2,
        (a.g + b.g) / 2 + h * (a.dg - b.dg) / 8 +
            std::sqrt(intensity * h * h * h / 192) * rng.normal(),
        1.5 * (b.g - a.g) / h - (a.dg + b.dg) / 4 + std::sqrt(intensity * h / 16) * rng.normal()};
    counters_->line_normals += 2;
    right = rests_.insert(right, middle);
    if (middle.t <= t) {
      a = middle;
      ++right;
    } else {
      b = middle;
    }
  }
  double rest, slope;
  cubic(a.t, a.g, a.dg, b.t, b.g, b.dg, t, rest, slope);
  g += rest;
  dg += slope;
}

void JointDensePath::at(long cell, double t, Rng& rng, double& g, double& dg) {
  double a, da, b, db;
  at_left(cell, a, da);
  if (std::isinf(step_)) {
    g = a;
    dg = da;
    return;
  }
  at_right(cell, b, db);
  const double begin = anchor_ + cell * step_;
  cubic(begin, a, da, begin + step_, b, db, t, g, dg);
  if (!covariance_->smooth()) add_rest(cell, t, rng, g, dg);
}

std::unique_ptr<LineSampler> make_joint_dense(const GaussianProcess& process, const Box3& bounds) {
  return make_sampler<JointDensePath, Fields::any>(process, bounds);
}

}  // namespace gpis

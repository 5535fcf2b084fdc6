#include "process/joint_dense_path.h"

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

// |implied - exact correlation| of the cubics through values and slopes at points h apart from
// within one cell to within another and to the points, at most.
double error_of_cubics(const Covariance& covariance, const SurveyLine& survey, double t, double h) {
  const LineGeometry& line = survey.geometry;
  struct Part {
    LocalPoint at;
    Functional what;
  };
  const Vec3 d = line.direction;
  const auto at = [&](double s) { return covariance.at(line.origin + d * s); };
  // The error at a fraction s of a cell: what the cubic has there, less g.
  const auto error = [&](double a, double s) {
    const double r = 1 - s;
    return std::array<Part, 3>{Part{at(a), {r * r * (1 + 2 * s), d * (r * r * s * h)}},
                               Part{at(a + s * h), {-1, {}}},
                               Part{at(a + h), {s * s * (1 + 2 * r), d * (-s * s * r * h)}}};
  };
  const auto value = [&](double s) { return std::array<Part, 1>{Part{at(s), {}}}; };
  const auto shared = [&](const auto& a, const auto& b) {
    double sum = 0;
    for (const Part& p : a)
      for (const Part& q : b) sum += covariance.between(p.at, p.what, q.at, q.what);
    return sum;
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
  draw(cell + 1, rng, counters);
}

void JointDensePath::at_left(long cell, double& g, double& dg) const {
  std::size_t i = points_.size() - 1;
  while (points_[i].index > cell) --i;
  g = points_[i].g;
  dg = points_[i].dg;
}

void JointDensePath::at(long cell, double t, Rng&, double& g, double& dg) const {
  double a, da, b, db;
  at_left(cell, a, da);
  if (std::isinf(step_)) {
    g = a;
    dg = da;
    return;
  }
  at_right(cell, b, db);
  // Bernstein form of the cubic through both ends.
  const double s = (t - anchor_) / step_ - cell, r = 1 - s;
  const double c1 = a + da * step_ / 3, c2 = b - db * step_ / 3;
  g = r * r * r * a + 3 * r * r * s * c1 + 3 * r * s * s * c2 + s * s * s * b;
  dg = 3 * (r * r * (c1 - a) + 2 * r * s * (c2 - c1) + s * s * (b - c2)) / step_;
}

std::unique_ptr<LineSampler> make_joint_dense(const GaussianProcess& process, const Box3& bounds) {
  return make_sampler<JointDensePath, Fields::any>(process, bounds);
}

}  // namespace gpis

#include "process/survey.h"

namespace gpis {
namespace {

// Length scales that a line is surveyed for: most lines end before.
constexpr double kReach = 12;

}  // namespace

std::vector<SurveyLine> survey_lines(const Covariance& covariance, const Box3& bounds) {
  Box3 box = bounds;
  for (int i = 0; i < 3; ++i) {
    if (!std::isfinite(box.min[i])) box.min[i] = std::isfinite(box.max[i]) ? box.max[i] : 0;
    if (!std::isfinite(box.max[i])) box.max[i] = box.min[i];
  }
  const Vec3 middle = (box.min + box.max) * 0.5;
  std::vector<SurveyLine> lines;
  for (const Vec3& d : {Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}, Vec3{1, 1, 1}, Vec3{-1, 1, 1},
                        Vec3{1, -1, 1}, Vec3{1, 1, -1}}) {
    const Vec3 direction = normalize(d);
    auto [t0, t1] = clip(box, middle, direction, -kInfinity, kInfinity);
    const double scale = covariance.length_scale(covariance.at(middle), direction);
    t0 = std::max(t0, -kReach / 2 * scale);
    t1 = std::min(t1, kReach / 2 * scale);
    if (!(t0 < t1)) {  // unbounded, or flat
      t0 = 0;
      t1 = std::isfinite(scale) ? kReach * scale : 1;
    }
    lines.push_back({{middle + direction * t0, direction}, t1 - t0});
  }
  return lines;
}

double survey_step(const Covariance& covariance, const LineGeometry& line, double t_begin,
                   double t_end) {
  const auto scale = [&](double t) {
    return covariance.length_scale(covariance.at(line.origin + line.direction * t), line.direction);
  };
  double shortest = scale(t_begin);
  if (covariance.stationary()) return 0.5 * shortest;
  // Where lengths shrink on the way, points come closer too.
  double t = t_begin;
  const double end = std::min(t_end, t_begin + kReach * shortest);
  for (int i = 0; i < 64 && t < end; ++i) {
    t += std::max(0.5 * shortest, (end - t_begin) / 64);
    shortest = std::min(shortest, scale(t));
  }
  return 0.5 * shortest;
}

}  // namespace gpis

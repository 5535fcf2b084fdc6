#include "process/survey.h"

namespace gpis {
namespace {

// As much of a line as the box holds, up to so far from `middle`; unbounded or flat: `otherwise`.
SurveyLine within(const Box3& box, const Vec3& middle, const Vec3& direction, double farthest,
                  double otherwise) {
  auto [t0, t1] = clip(box, middle, direction, -kInfinity, kInfinity);
  t0 = std::max(t0, -farthest);
  t1 = std::min(t1, farthest);
  if (!(t0 < t1)) {
    t0 = 0;
    t1 = otherwise;
  }
  return {{middle + direction * t0, direction}, t1 - t0};
}

}  // namespace

std::vector<SurveyLine> survey_lines(const Covariance& covariance, const Box3& bounds,
                                     double lengths) {
  Box3 box = bounds;
  for (int i = 0; i < 3; ++i) {
    if (!std::isfinite(box.min[i])) box.min[i] = std::isfinite(box.max[i]) ? box.max[i] : 0;
    if (!std::isfinite(box.max[i])) box.max[i] = box.min[i];
  }
  const Vec3 middle = (box.min + box.max) * 0.5;
  const auto scale = [&](const Vec3& x, const Vec3& direction) {
    return covariance.length_scale(covariance.at(x), direction);
  };
  std::vector<SurveyLine> lines;
  for (const Vec3& d : {Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}, Vec3{1, 1, 1}, Vec3{-1, 1, 1},
                        Vec3{1, -1, 1}, Vec3{1, 1, -1}}) {
    const Vec3 direction = normalize(d);
    const double length = scale(middle, direction);
    lines.push_back(within(bounds, middle, direction, lengths / 2 * length,
                           std::isfinite(length) ? lengths * length : 1));
  }
  if (!covariance.anisotropy()) return lines;
  for (const Vec3& place : covariance.anisotropy()->extremes())
    if (bounds.contains(place))
      for (const Vec3& d : {Vec3{1, 0.1, 0.2}, Vec3{-0.2, 1, 0.1}, Vec3{-0.1, 0.2, 1}}) {
        const Vec3 direction = normalize(d);
        // Of its own length, and of those around.
        const double near = scale(place, direction), far = scale(middle, direction);
        for (const double length : {near, far})
          if (length == near || far > 3 * near)
            lines.push_back(
                within(bounds, place, direction, lengths / 2 * length, lengths * length));
      }
  return lines;
}

}  // namespace gpis

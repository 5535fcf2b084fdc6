// How far rays go: Embree would end the program on others. A medium without bounds goes on.
#pragma once

#include <algorithm>
#include <cmath>

#include "core/vec.h"
#include "scene/description.h"

namespace gpis {

inline constexpr double kReach = 2 * kFarthest;
inline constexpr Box3 kWithinReach{{-kReach, -kReach, -kReach}, {kReach, kReach, kReach}};

// The part of a ray within reach. From near the origin, where nearly all rays start, that is a
// distance which all objects lie in.
inline std::pair<double, double> within_reach(const Ray& ray, double t_max) {
  const Vec3& o = ray.origin;
  const double far = std::max({std::abs(o.x), std::abs(o.y), std::abs(o.z)});
  if (far < 1e-3 * kFarthest) return {0, std::min(t_max, 0.99 * kReach)};
  return clip(kWithinReach, o, ray.direction, 0, t_max);
}

}  // namespace gpis

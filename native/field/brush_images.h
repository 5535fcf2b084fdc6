// A dab and its mirror images.
#pragma once

#include "field/brush.h"

namespace gpis {

class DabImages {
 public:
  static constexpr int kMost = 8;

  DabImages(const Dab& dab, const std::array<bool, 3>& symmetry)
      : radius(dab.radius), strength(dab.strength) {
    for (int image = 0; image < kMost; ++image) {
      Vec3 sign{1, 1, 1};
      bool asked = true;
      for (int axis = 0; axis < 3; ++axis)
        if (image & (1 << axis)) {
          sign[axis] = -1;
          asked &= symmetry[axis];
        }
      if (!asked) continue;
      centers[count] = dab.center * sign;
      directions[count++] = dab.direction * sign;
    }
  }

  // The images nearest to a point inside of the brush; none outside.
  struct Nearest {
    double distance = 0;
    int count = 0;
    int image[kMost];
  };
  Nearest nearest(const Vec3& x) const {
    double squared[kMost], least = radius * radius;
    for (int i = 0; i < count; ++i) {
      const Vec3 d = x - centers[i];
      squared[i] = dot(d, d);
      least = std::min(least, squared[i]);
    }
    Nearest out;
    if (least >= radius * radius) return out;
    out.distance = std::sqrt(least);
    // Equally near but for rounding.
    const double limit = (out.distance + 1e-9 * radius) * (out.distance + 1e-9 * radius);
    for (int i = 0; i < count; ++i)
      if (squared[i] <= limit) out.image[out.count++] = i;
    return out;
  }

  int count = 0;
  std::array<Vec3, kMost> centers, directions;
  double radius, strength;
};

}  // namespace gpis

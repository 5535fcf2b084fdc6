// What is known so far of F and ∇F at one node, whatever the number of realisations. Sums of powers
// about a reference that Clark's formulas give within a fraction of a standard deviation: as stable
// as Welford's updates (Pébay 2008), without their divisions.
#pragma once

#include <cstdint>

#include "fit/clark.h"

namespace gpis {

struct Moments {
  double reference = 0, scale = 1;
  double power[4] = {};     // Σ y^k, y = (F - reference)/scale
  double gradient[3] = {};  // Σ E[∇F | values]
  double with_value[3] = {};
  double second[6] = {};  // Σ of its second moments
  // Where y falls, in steps of .2: for the distance to the normal distribution.
  static constexpr int kBins = 32;
  static constexpr double kBin = 0.2;
  std::uint32_t count[kBins] = {};

  void add(double f, const Vec3& slope, const SymMat3& spread) {
    const double y = (f - reference) / scale, y2 = y * y;
    power[0] += y;
    power[1] += y2;
    power[2] += y2 * y;
    power[3] += y2 * y2;
    for (int axis = 0; axis < 3; ++axis) {
      gradient[axis] += slope[axis];
      with_value[axis] += y * slope[axis];
    }
    second[0] += slope.x * slope.x + spread.xx;
    second[1] += slope.y * slope.y + spread.yy;
    second[2] += slope.z * slope.z + spread.zz;
    second[3] += slope.x * slope.y + spread.xy;
    second[4] += slope.x * slope.z + spread.xz;
    second[5] += slope.y * slope.z + spread.yz;
    const double bin = std::clamp(y / kBin + kBins / 2, 0.0, kBins - 1.0);
    ++count[static_cast<int>(bin)];
  }

  struct Summary {
    Jet jet;
    double mean_error, sigma_error, skewness, kolmogorov;
  };
  Summary summary(int n, const SymMat3& slopes_if_certain) const;
};

}  // namespace gpis

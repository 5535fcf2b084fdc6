// Pixel filters, by importance sampling: a camera sample is moved about the pixel's centre with the
// filter as density, so all samples weigh the same and belong to one pixel only (Ernst, Stamminger,
// Greiner 2006, "Filter importance sampling").
#pragma once

#include <array>

#include "scene/description.h"

namespace gpis {

class PixelFilter {
 public:
  PixelFilter(SettingsDescription::Filter type, double width);

  // Uniform u in [0, 1) to an offset from the pixel's centre, in pixels, within half the filter's
  // width.
  double offset(double u) const;

 private:
  static constexpr int kCells = 1024;

  SettingsDescription::Filter type_;
  double width_;
  std::array<double, kCells + 1> inverse_{};  // Blackman-Harris: quantiles, on [-1/2, 1/2]
};

}  // namespace gpis

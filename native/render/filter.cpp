#include "render/filter.h"

#include <cmath>

namespace gpis {

namespace {

// Integral from -1/2 to x of the four-term Blackman-Harris window on [-1/2, 1/2] (Harris 1978, -92
// dB), divided by its total.
double blackman_harris_cdf(double x) {
  constexpr double a0 = 0.35875, a1 = 0.48829, a2 = 0.14128, a3 = 0.01168;
  const double w = 2 * kPi * x;
  const double integral =
      a0 * (x + 0.5) +
      (a1 * std::sin(w) + a2 / 2 * std::sin(2 * w) + a3 / 3 * std::sin(3 * w)) / (2 * kPi);
  return integral / a0;
}

double blackman_harris_quantile(double u) {
  double low = -0.5, high = 0.5;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (blackman_harris_cdf(middle) < u ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

}  // namespace

PixelFilter::PixelFilter(SettingsDescription::Filter type, double width)
    : type_(type), width_(width) {
  if (type_ == SettingsDescription::Filter::blackman_harris)
    for (int i = 0; i <= kCells; ++i)
      inverse_[i] = blackman_harris_quantile(static_cast<double>(i) / kCells);
}

double PixelFilter::offset(double u) const {
  if (type_ == SettingsDescription::Filter::box) return (u - 0.5) * width_;
  const double x = u * kCells;
  const int i = std::min(static_cast<int>(x), kCells - 1);
  return width_ * (inverse_[i] + (x - i) * (inverse_[i + 1] - inverse_[i]));
}

}  // namespace gpis

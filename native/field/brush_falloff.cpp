#include "field/brush_falloff.h"

#include <algorithm>
#include <cmath>

#include "field/check.h"

namespace gpis {

Falloff::Falloff(const std::string& preset) {
  const auto found = std::find(std::begin(kNames), std::end(kNames), preset);
  if (found == std::end(kNames)) {
    std::string all;
    for (const char* name : kNames) all += (all.empty() ? "'" : ", '") + std::string(name) + "'";
    refuse("falloff is '", preset, "'; it takes ", all, ".");
  }
  preset_ = static_cast<Preset>(found - std::begin(kNames));
}

Falloff::Falloff(std::vector<double> curve) : curve_(std::move(curve)) {
  if (curve_.size() < 2)
    refuse("curve has ", curve_.size(),
           " values; it takes at least two, from the centre to the rim.");
  for (double v : curve_)
    if (!(v >= 0 && v <= 1)) refuse("curve holds ", v, "; it takes values from 0 to 1.");
}

// With p = 1 − distance, as Blender's sculpt brushes (BKE_brush_curve_strength).
double Falloff::operator()(double distance) const {
  const double p = 1 - distance;
  if (!curve_.empty()) {
    const double x = distance * static_cast<double>(curve_.size() - 1);
    const auto i = std::min(static_cast<std::size_t>(x), curve_.size() - 2);
    return curve_[i] + (x - static_cast<double>(i)) * (curve_[i + 1] - curve_[i]);
  }
  switch (preset_) {
    case Preset::smooth:
      return p * p * (3 - 2 * p);
    case Preset::smoother:
      return p * p * p * (p * (6 * p - 15) + 10);
    case Preset::sphere:
      return std::sqrt(p * (2 - p));
    case Preset::root:
      return std::sqrt(p);
    case Preset::sharp:
      return p * p;
    case Preset::sharper:
      return p * p * p * p;
    case Preset::inverse_square:
      return p * (2 - p);
    case Preset::linear:
      return p;
    case Preset::constant:
      return 1;
  }
  return 0;
}

}  // namespace gpis

// Certified stretches above a threshold from a Lipschitz bound alone: where nothing better is known
// of a field.
#pragma once

#include "field/field.h"

namespace gpis {

// `value(t)` never changes faster than `rate`. Each step goes as far as the value allows; stops
// where steps become short. A ray that leaves for good doubles its way with every step and is
// followed to its end: stopped on the way it would be evaluated where there is no digit left for a
// length scale.
template <class Value>
double above_by_lipschitz(const Value& value, double rate, double t, double t_end,
                          double threshold) {
  constexpr int kSteps = 32;
  constexpr double kGone = 1e100;  // squares of what lies behind are no numbers
  if (!std::isfinite(rate)) return t;
  const double begin = t;
  for (int i = 0; t < t_end; ++i) {
    if (t > kGone) return t_end;
    const double gap = value(t) - threshold;
    if (!(gap > 0)) return t;
    if (rate == 0) return t_end;
    const double step = gap / rate;
    if (i >= kSteps && !(step > 0.1 * (t - begin) && t + step > t)) return t;
    t += step;
  }
  return std::min(t, t_end);
}

}  // namespace gpis

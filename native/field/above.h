// Certified stretches above a threshold from a Lipschitz bound alone: where nothing better is known
// of a field.
#pragma once

#include "field/field.h"

namespace gpis {

// `value(t)` never changes faster than `rate`. Each step goes as far as the value allows; stops
// where steps become short.
template <class Value>
double above_by_lipschitz(const Value& value, double rate, double t, double t_end,
                          double threshold) {
  constexpr int kSteps = 32;
  if (!std::isfinite(rate)) return t;
  for (int i = 0; i < kSteps && t < t_end; ++i) {
    const double gap = value(t) - threshold;
    if (!(gap > 0)) return t;
    if (rate == 0) return t_end;
    t += gap / rate;
  }
  return std::min(t, t_end);
}

}  // namespace gpis

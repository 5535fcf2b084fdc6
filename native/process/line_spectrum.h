// Spectrum of a radial correlation on a line as finitely many frequencies (formulas C8):
//   κ(q) = Σ weight cos(frequency q) for |q| <= reach,
// to a certified error: the largest difference on a dense set of lags.
#pragma once

#include <optional>
#include <vector>

#include "kernel/radial.h"

namespace gpis {

struct LineSpectrum {
  double reach = 0;
  std::vector<double> frequency, weight;  // per length scale; weights sum up to 1
  double error = 0;                       // of the correlation, on [0, reach]
  double slope_variance = 0;  // Σ weight frequency², λ₂ but for the error of slopes
};

// Nothing where it would take more than 4096 frequencies; throws std::invalid_argument where the
// radial is not smooth.
std::optional<LineSpectrum> line_spectrum(const Radial& radial, double reach);

}  // namespace gpis

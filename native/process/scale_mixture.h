// Correlations as mixtures of squared exponentials of many lengths,
//   κ(q) = ∫ exp(-q²/2s) dF(s),
// s ~ Gamma(ν, rate ν) for Matérn, 1/s ~ Gamma(α, rate α) for the rational quadratic (formulas C8).
// Under a field A(x) of squared length scales the factor s leaves |A_x|^¼|A_y|^¼/|(A_x+A_y)/2|^½ as
// it is, so the same weights serve the covariance of Paciorek and Schervish.
#pragma once

#include <vector>

#include "kernel/radial.h"

namespace gpis {

struct ScaleMixture {
  struct Part {
    double weight, length;  // weights sum up to 1; √s
  };
  std::vector<Part> parts;
  double error = 0;  // of κ, the largest at any distance
};

// Throws std::invalid_argument where too many lengths would do.
ScaleMixture scale_mixture(const Radial& radial);

}  // namespace gpis

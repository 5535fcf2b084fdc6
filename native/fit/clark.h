// The greatest of two jointly normal variables: Clark 1961, "The greatest of a finite set of random
// variables" (math.md §10). The least is minus the greatest of the two negated.
#pragma once

#include "fit/jet.h"

namespace gpis {

struct Greatest {
  double mean, variance, skewness, kolmogorov;
  double first_share;  // E[∂F/∂(the first)]: the probability that it is the greater
  Jet jet;
};

// `covariance` of the two values. Exact; a second variable that is the first plus a constant, or
// two certain ones, are no special case. `kolmogorov`, if `shape` is asked for: distance to the
// normal distribution of the same mean and variance, over 65 points of it and of each operand that
// is less than half as wide, and some about the largest.
Greatest greatest(const Jet& a, const Jet& b, double covariance, bool shape);

// Standard normal distribution function and density.
double normal_cdf(double x);
double normal_density(double x);

}  // namespace gpis

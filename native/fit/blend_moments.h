// The smooth greatest of two jointly normal variables, F = max(a, b) + (k - |a - b|)²₊/4k with the
// blend radius k (process/tree.h). The smooth least is minus that of the two negated.
#pragma once

#include "fit/clark.h"

namespace gpis {

// Becomes greatest() as k → 0. Exact but for quadratures of one dimension: of moments to 1e-12 of
// the deviations, of `kolmogorov` (if `shape` is asked for) to 2e-3.
Greatest smooth_greatest(const Jet& a, const Jet& b, double covariance, double blend, bool shape);

}  // namespace gpis

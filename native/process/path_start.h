// What a remembered state says of g at the start of a line (definitions B1-B4): for a single
// process and for the leaves of a tree.
#pragma once

#include "process/path.h"
#include "process/surface.h"

namespace gpis {

// From f and ∇f = ∇μ + g∇σ + σ∇g at t, where `fields` holds mean and sigma > 0 and their slopes
// along the line (dmean, dsigma). `sign`: -1 for a leaf that counts as its complement, whose ray
// leaves where the leaf falls. `path` says slope_law, the lines of mean and deviation sample(t).
template <class Path, class Fields, class MeanLine, class SigmaLine>
PathStart path_start(const Start& start, double t, const Fields& fields, double dmean, double sign,
                     const Vec3& direction, const Path& path, const MeanLine& mean_line,
                     const SigmaLine& sigma_line, Rng& rng) {
  PathStart known;
  known.value = (start.state.value - fields.mean) / fields.sigma;
  const double without_path = dmean + known.value * fields.dsigma;
  if (start.kind == Start::Kind::value_slope) {
    const Vec3& gradient = start.state.gradient;
    known.slope_known = known.gradient_known = true;
    known.slope = (dot(direction, gradient) - without_path) / fields.sigma;
    known.gradient =
        (gradient - mean_line.sample(t).gradient - sigma_line.sample(t).gradient * known.value) /
        fields.sigma;
  } else if (start.state.value == 0) {
    // Flux-weighted (B3); a path that is constant along the line has but one slope.
    double mean, deviation;
    path.slope_law(known.value, mean, deviation);
    const double m = sign * (without_path + fields.sigma * mean), s = fields.sigma * deviation;
    known.slope_known = true;
    known.slope =
        s > 0 ? (sign * s * flux_weighted_normal(m / s, rng) - without_path) / fields.sigma : mean;
  }
  return known;
}

}  // namespace gpis

// Dabs on the standard deviation σ, in log space; a the weight (brush.h), v the value.
//   set:     ln σ ← ln σ + a (ln v − ln σ)
//   add:     ln σ ← ln σ + a ln v
//   smooth:  ln σ ← ln σ + a (mean of ln σ over the six neighbours − ln σ)
#include "field/leaf_nodes.h"

namespace gpis {

PaintCounts paint_deviation(const PaintLayers& layers, const Brush& brush, const DabImages& dab) {
  const auto log_of = [](double v) { return std::log(std::max(v, kLeastDeviation)); };
  const double log_value = brush.operation == Operation::smooth ? 0 : std::log(brush.value.x);
  const auto leaves = leaves_of_balls(layers, dab.centers.data(), dab.count, dab.radius);
  return rewrite<ScalarLayer>(layers, layers.sigma, leaves, [&] {
    return [&, sigma = LeafNodes<ScalarLayer>(layers.sigma.grid, layers.box), logs = LeafNumbers()](
               const openvdb::Coord& c, const Vec3& x, double old,
               PaintCounts& counts) mutable -> std::optional<double> {
      const DabImages::Nearest near = dab.nearest(x);
      if (near.count == 0) return std::nullopt;
      const double a = dab.strength * brush.falloff(near.distance / dab.radius);
      if (a == 0) return std::nullopt;  // exp(ln σ) is not σ in every digit
      const double log_old = log_of(old);
      double change = log_value;
      if (brush.operation == Operation::set) change = log_value - log_old;
      if (brush.operation == Operation::smooth) {
        sigma.enter(c);
        change = logs.mean_around(sigma, c, log_of) - log_old;
      }
      if (change == 0) return std::nullopt;
      const double value = std::exp(log_old + a * change);
      counts.clamped += value < kLeastDeviation || value > kMostDeviation;
      return std::clamp(value, kLeastDeviation, kMostDeviation);
    };
  });
}

}  // namespace gpis

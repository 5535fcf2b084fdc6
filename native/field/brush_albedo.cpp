// Dabs on the albedo c, a colour that multiplies the material's; a the weight (brush.h), v the
// value.
//   set:  c ← c + a (v − c)        smooth:  c ← c + a (mean of the six neighbours − c)
#include "field/leaf_nodes.h"

namespace gpis {

PaintCounts paint_albedo(const PaintLayers& layers, const Brush& brush, const DabImages& dab) {
  const auto leaves = leaves_of_balls(layers, dab.centers.data(), dab.count, dab.radius);
  return rewrite<ColorLayer>(layers, layers.albedo, leaves, [&] {
    return [&, albedo = LeafNodes<ColorLayer>(layers.albedo.grid, layers.box)](
               const openvdb::Coord& c, const Vec3& x, const Vec3& old,
               PaintCounts&) mutable -> std::optional<Vec3> {
      const DabImages::Nearest near = dab.nearest(x);
      if (near.count == 0) return std::nullopt;
      const double a = dab.strength * brush.falloff(near.distance / dab.radius);
      if (brush.operation == Operation::set) return old + (brush.value - old) * a;
      albedo.enter(c);
      return old + (around(albedo, c) - old) * a;
    };
  });
}

}  // namespace gpis

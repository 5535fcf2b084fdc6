// Dabs on the mean μ, positive outside; a the weight (brush.h), r the radius, v the value.
//   inflate:  μ ← μ − a v r          deflate:  μ ← μ + a v r
//   smooth:   μ ← μ + a (μ̄ − μ),     μ̄ the mean of the six neighbours
//   flatten:  μ ← μ + a (P(x) − μ),  P(x) = Σφμ/Σφ + (Σφ∇μ/Σφ)·(x − Σφx/Σφ): the plane of the
//             mean's own average value and slope under the brush; sums over nodes, ∇μ by central
//             differences, for each image by itself
//   grab:     μ(x) ← μ(x − a d),     d the direction; trilinear between nodes
// Beyond the box stands the nearest node.
#include "field/leaf_nodes.h"

namespace gpis {
namespace {

struct Plane {
  double value = 0;
  Vec3 slope, point;

  double at(const Vec3& x) const { return value + dot(slope, x - point); }
};

// Sums run over leaves one after the other, so they do not depend on threads.
Plane plane_under(const PaintLayers& layers, const Falloff& falloff, const Vec3& center,
                  double radius) {
  struct Sum {
    double weight = 0, value = 0;
    Vec3 slope, point;
  };
  const std::vector<openvdb::Coord> leaves = leaves_of_balls(layers, &center, 1, radius);
  std::vector<Sum> sums(leaves.size());
  using Leaf = Layer<ScalarLayer>::Leaf;
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, leaves.size()), [&](const auto& some) {
    LeafNodes<ScalarLayer> mean(layers.mean.grid, layers.box);
    for (std::size_t l = some.begin(); l < some.end(); ++l)
      for (openvdb::Index n = 0; n < Leaf::SIZE; ++n) {
        const openvdb::Coord c = leaves[l] + Leaf::offsetToLocalCoord(n);
        const Vec3 from_center = layers.point(c) - center;
        const double distance = length(from_center);
        if (!layers.box.isInside(c) || distance >= radius) continue;
        const double w = falloff(distance / radius);
        mean.enter(c);
        sums[l].weight += w;
        sums[l].value += w * mean.at(c);
        sums[l].slope += layers.gradient_to_object * difference(mean, layers.box, c) * w;
        sums[l].point += from_center * w;
      }
  });
  Sum all;
  for (const Sum& s : sums) {
    all.weight += s.weight;
    all.value += s.value;
    all.slope += s.slope;
    all.point += s.point;
  }
  if (!(all.weight > 0)) return {};  // no node has a weight: none is changed
  return {all.value / all.weight, all.slope / all.weight, center + all.point / all.weight};
}

}  // namespace

PaintCounts paint_mean(const PaintLayers& layers, const Brush& brush, const DabImages& dab) {
  std::array<Plane, DabImages::kMost> planes;
  if (brush.operation == Operation::flatten)
    for (int i = 0; i < dab.count; ++i)
      planes[i] = plane_under(layers, brush.falloff, dab.centers[i], dab.radius);

  const auto leaves = leaves_of_balls(layers, dab.centers.data(), dab.count, dab.radius);
  return rewrite<ScalarLayer>(layers, layers.mean, leaves, [&] {
    return [&, mean = layers.mean_reader(),
            nodes = LeafNodes<ScalarLayer>(layers.mean.grid, layers.box)](
               const openvdb::Coord& c, const Vec3& x, double old,
               PaintCounts&) mutable -> std::optional<double> {
      const DabImages::Nearest near = dab.nearest(x);
      if (near.count == 0) return std::nullopt;
      const double a = dab.strength * brush.falloff(near.distance / dab.radius);
      switch (brush.operation) {
        case Operation::inflate:
          return old - a * brush.value.x * dab.radius;
        case Operation::deflate:
          return old + a * brush.value.x * dab.radius;
        case Operation::smooth:
          nodes.enter(c);
          return old + a * (around(nodes, c) - old);
        case Operation::flatten: {
          double sum = 0;
          for (int i = 0; i < near.count; ++i) sum += planes[near.image[i]].at(x);
          return old + a * (sum / near.count - old);
        }
        default: {  // grab
          Vec3 d;
          for (int i = 0; i < near.count; ++i) d += dab.directions[near.image[i]];
          return mean.sample(layers.to_index.point(x - d * (a / near.count)));
        }
      }
    };
  });
}

}  // namespace gpis

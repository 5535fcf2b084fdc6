// Brushes: what a dab does to the value of a node. Formulas are in the files named after what they
// change (brush_mean.cpp, brush_deviation.cpp, brush_tensor.cpp, brush_albedo.cpp).
//
// A dab of radius r and strength s has at a point x the weight
//   a = s · φ(|x − c| / r)  for |x − c| < r, else 0,
// with c the nearest of its mirror images and φ the falloff; where images are equally near, what
// they do is averaged. A dab reads the values that all dabs before it have left, at its own node
// and at others, and writes single precision; so the grids do not depend on threads.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/vec.h"
#include "field/brush_falloff.h"

namespace gpis {

enum class Channel { mean, deviation, length_scale, anisotropy, albedo };
enum class Operation { inflate, deflate, smooth, flatten, grab, set, add, comb };

struct Brush {
  Channel channel = Channel::mean;
  Operation operation = Operation::inflate;
  Falloff falloff;
  // inflate, deflate: displacement in radii. set: the deviation, length scale or colour. add: the
  // factor of a dab. Of others nothing.
  Vec3 value{0.1, 0.1, 0.1};
  Vec3 ratios{1, 1, 1};  // comb: lengths along the stroke, across it, and along the normal
  std::array<bool, 3> symmetry{};  // mirror images in x, y, z = 0 of the object's space
};

struct Dab {
  Vec3 center;
  double radius = 1, strength = 1;
  Vec3 direction;  // grab: how far the surface is dragged; comb: the stroke's tangent
};

struct PaintCounts {
  std::int64_t nodes = 0;    // values that changed
  std::int64_t leaves = 0;   // blocks of 8³ nodes that were written
  std::int64_t clamped = 0;  // values kept inside of what single precision and the process can take
  std::int64_t undirected = 0;  // nodes left as they are: no normal there, or it is the tangent
  std::int64_t rejected = 0;  // matrices left as they are: rounded, they were not positive definite

  void add(const PaintCounts& o) {
    nodes += o.nodes;
    leaves += o.leaves;
    clamped += o.clamped;
    undirected += o.undirected;
    rejected += o.rejected;
  }
};

// Values stay in these bounds, and the longest to the shortest of `ratios` in the last.
inline constexpr double kLeastDeviation = 1e-12, kMostDeviation = 1e12;
inline constexpr double kLeastLength = 1e-9, kMostLength = 1e9;
inline constexpr double kMostRatio = 100;

// Refuses, with a sentence, what no dab can do.
void check_brush(const Brush& brush);
void check_dabs(const Brush& brush, const std::vector<Dab>& dabs);

}  // namespace gpis

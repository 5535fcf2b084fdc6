#include "field/brick_grid.h"

#include <algorithm>
#include <cstdint>

#include "field/check.h"

namespace gpis {

BrickGrid::BrickGrid(const Index3& nodes, const NodeValue& value, const ConstantBrick& constant)
    : nodes_(nodes), range_{kInfinity, -kInfinity} {
  double count = 1;
  for (int axis = 0; axis < 3; ++axis) {
    if (nodes[axis] < 2)
      refuse("The grid has ", nodes[0], " x ", nodes[1], " x ", nodes[2],
             " nodes; interpolation takes at least 2 along each axis.");
    bricks_along_[axis] = (nodes[axis] - 2) / kCells + 1;
    count *= bricks_along_[axis];
  }
  if (count > 2e8)
    refuse("The grid has ", nodes[0], " x ", nodes[1], " x ", nodes[2],
           " nodes, which is too many to index; take a coarser one.");
  bricks_.reserve(static_cast<std::size_t>(count));

  std::array<float, kNodes * kNodes * kNodes> block;
  for (int i = 0; i < nodes[0] - 1; i += kCells)
    for (int j = 0; j < nodes[1] - 1; j += kCells)
      for (int k = 0; k < nodes[2] - 1; k += kCells) {
        Brick brick{0, 0, -1};
        if (const auto known = constant ? constant(i, j, k) : std::nullopt) {
          brick.min = brick.max = *known;
        } else {
          // Past the last node the last one repeats: such cells are never looked up, and the
          // extremes stay right.
          std::size_t n = 0;
          for (int di = 0; di < kNodes; ++di)
            for (int dj = 0; dj < kNodes; ++dj)
              for (int dk = 0; dk < kNodes; ++dk)
                block[n++] = value(std::min(i + di, nodes[0] - 1), std::min(j + dj, nodes[1] - 1),
                                   std::min(k + dk, nodes[2] - 1));
          const auto [low, high] = std::minmax_element(block.begin(), block.end());
          brick.min = *low;
          brick.max = *high;
          if (brick.min != brick.max) {
            brick.values = static_cast<std::int64_t>(values_.size());
            values_.insert(values_.end(), block.begin(), block.end());
          }
        }
        range_.min = std::min(range_.min, static_cast<double>(brick.min));
        range_.max = std::max(range_.max, static_cast<double>(brick.max));
        bricks_.push_back(brick);
      }
}

// In a trilinear cell each component of the gradient is a convex combination of the differences
// along the four edges of that axis.
double BrickGrid::lipschitz(const Vec3& voxel_size) const {
  double largest = 0;
  constexpr int stride[3] = {kNodes * kNodes, kNodes, 1};
  for (const Brick& brick : bricks_) {
    if (brick.values < 0) continue;
    const float* values = values_.data() + brick.values;
    for (int i = 0; i < kCells; ++i)
      for (int j = 0; j < kCells; ++j)
        for (int k = 0; k < kCells; ++k) {
          const float* v = values + i * stride[0] + j * stride[1] + k;
          double square = 0;
          for (int axis = 0; axis < 3; ++axis) {
            const int a = stride[(axis + 1) % 3], b = stride[(axis + 2) % 3], s = stride[axis];
            const auto edge = [&](int offset) {
              return std::abs(double{v[offset + s]} - double{v[offset]});
            };
            const double d = std::max({edge(0), edge(a), edge(b), edge(a + b)}) / voxel_size[axis];
            square += d * d;
          }
          largest = std::max(largest, square);
        }
  }
  return std::sqrt(largest);
}

}  // namespace gpis

// Node values of a regular grid in bricks of 8³ cells. Each brick keeps its own 9³ nodes, so the
// eight corners of a cell lie together; a brick of one value keeps that value alone; every brick
// knows its smallest and largest value.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "field/field.h"

namespace gpis {

using Index3 = std::array<int, 3>;

class BrickGrid {
 public:
  static constexpr int kCells = 8;           // cells of a brick along each axis
  static constexpr int kNodes = kCells + 1;  // nodes

  using NodeValue = std::function<float(int i, int j, int k)>;
  // The value of all nodes i..i+8, j..j+8, k..k+8, if the caller knows that there is only one.
  using ConstantBrick = std::function<std::optional<float>(int i, int j, int k)>;

  // `nodes`: at least 2 along each axis.
  BrickGrid(const Index3& nodes, const NodeValue& value, const ConstantBrick& constant = nullptr);

  const Index3& nodes() const { return nodes_; }
  Range range() const { return range_; }
  // An upper bound of the gradient in every cell, for cells of this size.
  double lipschitz(const Vec3& voxel_size) const;

  struct Brick {
    float min, max;
    std::int64_t values;  // offset of the 9³ values, -1 where all of them are `min`
  };
  const Brick& brick_of(const Index3& cell) const { return brick(brick_index(cell)); }
  // Of the brick that holds a cell: the same in all grids of the same nodes.
  std::size_t brick_index(const Index3& cell) const {
    return (static_cast<std::size_t>(cell[0] / kCells) * bricks_along_[1] + cell[1] / kCells) *
               bricks_along_[2] +
           cell[2] / kCells;
  }
  const Brick& brick(std::size_t index) const { return bricks_[index]; }
  // The corners of a cell in a brick that is not constant: index 4i + 2j + k.
  void corners(const Brick& brick, const Index3& cell, float out[8]) const {
    const float* v = values_.data() + brick.values +
                     ((cell[0] % kCells) * kNodes + cell[1] % kCells) * kNodes + cell[2] % kCells;
    constexpr int j = kNodes, i = kNodes * kNodes;
    out[0] = v[0];
    out[1] = v[1];
    out[2] = v[j];
    out[3] = v[j + 1];
    out[4] = v[i];
    out[5] = v[i + 1];
    out[6] = v[i + j];
    out[7] = v[i + j + 1];
  }

 private:
  Index3 nodes_, bricks_along_;
  std::vector<Brick> bricks_;
  std::vector<float> values_;
  Range range_;
};

}  // namespace gpis

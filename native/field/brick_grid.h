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
    const unsigned i = cell[0], j = cell[1], k = cell[2];  // division by 8 is then a shift
    return (static_cast<std::size_t>(i / kCells) * bricks_along_[1] + j / kCells) *
               bricks_along_[2] +
           k / kCells;
  }
  const Brick& brick(std::size_t index) const { return bricks_[index]; }
  // The first corner of a cell in a brick that is not constant; corner 4i + 2j + k is at
  // corner_offset(i, j), and one further for k.
  const float* first_corner(const Brick& brick, const Index3& cell) const {
    const unsigned i = cell[0], j = cell[1], k = cell[2];
    return values_.data() + brick.values + ((i % kCells) * kNodes + j % kCells) * kNodes +
           k % kCells;
  }
  static constexpr int corner_offset(int i, int j) { return (i * kNodes + j) * kNodes; }
  void corners(const Brick& brick, const Index3& cell, float out[8]) const {
    const float* v = first_corner(brick, cell);
    for (int i = 0; i < 2; ++i)
      for (int j = 0; j < 2; ++j)
        for (int k = 0; k < 2; ++k) out[4 * i + 2 * j + k] = v[corner_offset(i, j) + k];
  }

 private:
  Index3 nodes_, bricks_along_;
  std::vector<Brick> bricks_;
  std::vector<float> values_;
  Range range_;
};

}  // namespace gpis

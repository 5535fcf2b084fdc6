// The nodes of one leaf and those beside its faces, for brushes that look at the six neighbours of
// every node: read row by row, where a search in the tree for each would take most of a dab.
#pragma once

#include <cmath>

#include "field/paint_layers.h"

namespace gpis {

inline constexpr int kLeafSide = 8, kBlockSide = kLeafSide + 2;

inline openvdb::Coord leaf_of(const openvdb::Coord& c) {
  return c & ~(kLeafSide - 1);
}
// Where a node stands in a block of kBlockSide³ around a leaf.
inline int place_in_block(const openvdb::Coord& leaf, const openvdb::Coord& c) {
  const openvdb::Coord i = c - leaf;
  return ((i.x() + 1) * kBlockSide + i.y() + 1) * kBlockSide + i.z() + 1;
}

// Beyond the box stands the nearest node. One for each thread.
template <class Kind>
class LeafNodes {
 public:
  using Value = typename Kind::Value;
  using Grid = typename Kind::Grid;

  LeafNodes(const std::array<typename Grid::Ptr, Kind::K>& grids, const openvdb::CoordBBox& box)
      : box_(box) {
    for (int k = 0; k < Kind::K; ++k) voxels_[k].emplace(grids[k]->tree());
  }
  // From now on `at` is for the nodes of this one's leaf, and those beside its faces.
  void enter(const openvdb::Coord& c) {
    if (leaf_of(c) == leaf_) return;
    leaf_ = leaf_of(c);
    for (int k = 0; k < Kind::K; ++k)
      for (int i = -1; i <= kLeafSide; ++i)
        for (int j = -1; j <= kLeafSide; ++j) {
          const bool beside = i < 0 || i == kLeafSide, besides = j < 0 || j == kLeafSide;
          if (!(beside && besides)) read_row(k, leaf_.offsetBy(i, j, 0), !beside && !besides);
        }
  }
  Value at(const openvdb::Coord& c) const { return Kind::load(nodes_[place_in_block(leaf_, c)]); }
  const openvdb::Coord& leaf() const { return leaf_; }

 private:
  using Voxels = openvdb::tree::ValueAccessor<const typename Grid::TreeType, false>;

  // Eight nodes along z, and with `ends` the ones before and after them.
  void read_row(int k, const openvdb::Coord& first, bool ends) {
    auto* row = &nodes_[place_in_block(leaf_, first)];
    const openvdb::Coord from = clamped(first, box_);
    const auto* leaf = voxels_[k]->probeConstLeaf(from);
    const bool whole = first.z() >= box_.min().z() && first.z() + kLeafSide - 1 <= box_.max().z();
    if (whole && leaf) {
      const auto* values = leaf->buffer().data() + Layer<Kind>::Leaf::coordToOffset(from);
      for (int z = 0; z < kLeafSide; ++z) row[z][k] = values[z];
    } else {
      for (int z = 0; z < kLeafSide; ++z)
        row[z][k] = voxels_[k]->getValue(clamped(first.offsetBy(0, 0, z), box_));
    }
    if (ends)
      for (int z : {-1, kLeafSide})
        row[z][k] = voxels_[k]->getValue(clamped(first.offsetBy(0, 0, z), box_));
  }

  std::array<std::optional<Voxels>, Kind::K> voxels_;
  openvdb::CoordBBox box_;
  openvdb::Coord leaf_ = openvdb::Coord::max();
  std::array<typename Kind::Stored, kBlockSide * kBlockSide * kBlockSide> nodes_;
};

// A number of each of these nodes, computed when it is first asked for.
class LeafNumbers {
 public:
  template <class Kind, class Compute>
  double at(const LeafNodes<Kind>& nodes, const openvdb::Coord& c, const Compute& compute) {
    if (!(nodes.leaf() == leaf_)) {
      leaf_ = nodes.leaf();
      known_.fill(std::nan(""));
    }
    double& value = known_[place_in_block(leaf_, c)];
    if (std::isnan(value)) value = compute(nodes.at(c));
    return value;
  }
  // Of the six neighbours.
  template <class Kind, class Compute>
  double mean_around(const LeafNodes<Kind>& nodes, const openvdb::Coord& c,
                     const Compute& compute) {
    double sum = 0;
    for (int axis = 0; axis < 3; ++axis)
      for (int side : {-1, 1}) {
        openvdb::Coord next = c;
        next[axis] += side;
        sum += at(nodes, next, compute);
      }
    return sum / 6;
  }

 private:
  openvdb::Coord leaf_ = openvdb::Coord::max();
  std::array<double, kBlockSide * kBlockSide * kBlockSide> known_;
};

}  // namespace gpis

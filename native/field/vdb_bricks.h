// Bricks of values read from the voxels of a tree, for the readers in this folder.
#pragma once

#include <memory>
#include <string>

#include "field/brick_grid.h"
#include "field/check.h"
#include "field/openvdb.h"

namespace gpis {

// `read` makes the number wanted of a voxel's value; `name` is the grid's in sentences. Where the
// tree has no leaf, a brick is one value and costs no storage.
template <class GridType, class Read>
std::shared_ptr<const BrickGrid> vdb_bricks(const GridType& grid, const openvdb::CoordBBox& box,
                                            const Read& read, const std::string& name) {
  const auto voxels = grid.getConstAccessor();
  const openvdb::Coord low = box.min(), size = box.dim();
  // A brick and its far nodes touch the leaves that hold its eight corners, and no others.
  const auto constant = [&](int i, int j, int k) -> std::optional<float> {
    std::optional<float> value;
    for (int corner = 0; corner < 8; ++corner) {
      const openvdb::Coord c =
          low + openvdb::Coord(i + (corner & 1 ? 8 : 0), j + (corner & 2 ? 8 : 0),
                               k + (corner & 4 ? 8 : 0));
      if (voxels.probeConstLeaf(c)) return std::nullopt;
      const float v = read(voxels.getValue(c));
      if (value && *value != v) return std::nullopt;
      value = v;
    }
    return value;
  };
  try {
    return std::make_shared<BrickGrid>(
        Index3{size.x(), size.y(), size.z()},
        [&](int i, int j, int k) { return read(voxels.getValue(low + openvdb::Coord(i, j, k))); },
        constant);
  } catch (const std::invalid_argument& e) {
    refuse("", name, " cannot be used: ", e.what());
  }
}

}  // namespace gpis

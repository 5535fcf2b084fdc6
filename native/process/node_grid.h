// The nodes of a regular grid over a box: [i,j,k] stands at origin + (i, j, k)·voxel_size.
#pragma once

#include <array>

#include "field/check.h"

namespace gpis {

struct NodeGrid {
  std::array<int, 3> resolution{};  // nodes
  double voxel_size = 0;
  Vec3 origin;

  NodeGrid() = default;
  // `nodes` along the longest side, the first and last on its ends; the other sides are covered.
  // `what` names it in sentences.
  NodeGrid(const Box3& bounds, int nodes, const char* what) : origin(bounds.min) {
    const Vec3 size = bounds.max - bounds.min;
    if (!(is_finite(size) && size.x > 0 && size.y > 0 && size.z > 0))
      refuse("The bounds of a ", what, " go from ", bounds.min, " to ", bounds.max,
             "; every side must be finite and of positive length.");
    if (nodes < 2 || nodes > 512)
      refuse("resolution is ", nodes, "; it takes 2 to 512 nodes along the longest side.");
    voxel_size = max_component(size) / (nodes - 1);
    for (int axis = 0; axis < 3; ++axis)
      resolution[axis] =
          std::max(2, static_cast<int>(std::ceil(size[axis] / voxel_size - 1e-9)) + 1);
  }

  std::size_t count() const {
    return static_cast<std::size_t>(resolution[0]) * resolution[1] * resolution[2];
  }
  std::size_t index(int i, int j, int k) const {
    return (static_cast<std::size_t>(i) * resolution[1] + j) * resolution[2] + k;
  }
  Vec3 at(int i, int j, int k) const {
    return origin + Vec3{double(i), double(j), double(k)} * voxel_size;
  }
};

}  // namespace gpis

// The surface {value = level} of a grid of nodes as a triangle mesh.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/vec.h"

namespace gpis {

struct LevelSetMesh {
  std::vector<Vec3> vertices;
  std::vector<std::array<std::int32_t, 3>> triangles;  // facing where the values are larger
};

// Marching tetrahedra: every cell is cut into six along its diagonal, in each of which the surface
// of the linear interpolant is one triangle or two. Needs no table of cases, and the mesh is closed
// wherever the surface does not leave the grid. values[(i·Y + j)·Z + k] stands at origin +
// (i, j, k)·voxel_size.
LevelSetMesh level_set_mesh(const float* values, const std::array<int, 3>& nodes,
                            const Vec3& voxel_size, const Vec3& origin, double level);

}  // namespace gpis

// Grids of .vdb files: what a file holds, whole grids as arrays, and arrays as a new file.
#pragma once

#include <string>
#include <vector>

#include "field/brick_grid.h"

namespace gpis {

struct VdbGridInfo {
  std::string name;
  std::string type;   // "float", "double", "vec3s", ... as OpenVDB calls it
  Index3 resolution;  // nodes of the box of active voxels; zeros where no voxel is active
  Box3 bounds;        // of these nodes, object space; empty where there are none, or in a frustum
  Vec3 voxel_size;    // zero in a frustum
  std::optional<Range> values;       // of the active voxels; float and double grids
  std::optional<double> background;  // likewise
};

// Throws FileNotFound, or std::invalid_argument where the file is no OpenVDB file.
std::vector<VdbGridInfo> vdb_grids(const std::string& path);

struct VdbArray {
  std::string name;
  int components = 1;         // 1 or 3
  std::vector<float> values;  // index ((i·Y + j)·Z + k)·components + c
};

// Grids on the same nodes: [i,j,k] stands at origin + (i,j,k)·voxel_size.
struct VdbArrays {
  Index3 resolution{};
  Vec3 voxel_size, origin;
  std::vector<VdbArray> grids;
};

// All nodes are active, blocks of one value are kept as one; the background of a scalar grid is its
// largest value (a mean is positive far outside), of a vector grid 0. Written beside `path` first,
// so that nobody ever sees half a file.
void write_vdb(const std::string& path, const VdbArrays& arrays);

// The grids of these names (all, if there are none) over the box of all their active voxels. Scalar
// and three-component floating-point grids on the same nodes only: throws std::invalid_argument on
// others.
VdbArrays read_vdb(const std::string& path, const std::vector<std::string>& names);

}  // namespace gpis

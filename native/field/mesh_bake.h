// The signed distance from a triangle mesh, baked to a .vdb grid: the mean of a process that looks
// like the mesh.
//
// Inside is where the generalized winding number exceeds ½. For a closed mesh that does not meet
// itself this is the usual inside, and the distance is that to its triangles. Else the surface is
// the boundary of {winding number > ½}: the triangles on it, and the sheets over the holes. There
// - next to the surface, |distance| is the lesser of that to the triangles on it and |w - ½| /
// |∇w|. Off the triangles w is
//   harmonic and ∇w is the Biot-Savart integral of the open edges alone, so the second is the
//   distance to a sheet to first order (exact in angle at an open edge, where w is an angle), and
//   both vanish on the surface: it is continuous;
// - away from it, the eikonal equation is solved from there.
#pragma once

#include <array>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "field/brick_grid.h"

namespace gpis {

struct MeshBake {
  Index3 resolution;  // nodes
  double voxel_size;
  Vec3 origin;
  std::size_t
      open_edges;     // edges whose triangles do not close, or do not agree which side is outside
  bool meets_itself;  // parts of the surface lie inside the mesh
};

// Vertices at one place count as one. `resolution`: nodes along the longest side of the mesh's
// bounds with `margin` around them, the first and last on its ends. Distances beyond `narrow_band`
// (0: none) are cut off there. Writes the grid `mean`, positive outside, to `path`. `progress`
// (fraction) returns false to cancel: then nothing is written, and nothing returned. Throws
// std::invalid_argument with a sentence.
std::optional<MeshBake> bake_mesh_distance(const std::vector<Vec3>& vertices,
                                           const std::vector<std::array<int, 3>>& triangles,
                                           const std::string& path, int resolution, double margin,
                                           double narrow_band,
                                           const std::function<bool(double)>& progress);

}  // namespace gpis

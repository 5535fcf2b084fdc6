// |∇f| = 1 on a regular grid.
#pragma once

#include <vector>

#include "field/brick_grid.h"

namespace gpis {

// Replaces |f| by the distance to its zero set, starting from the nodes that are `fixed`, which
// must be all those beside it; signs stay. First order in the voxel size h (fast sweeping, Zhao
// 2005). Index: (i·Y + j)·Z + k.
void solve_eikonal(std::vector<float>& f, const std::vector<char>& fixed, const Index3& nodes,
                   double h);

}  // namespace gpis

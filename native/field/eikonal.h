// |∇f| = 1 on a regular grid.
#pragma once

#include <vector>

#include "field/brick_grid.h"

namespace gpis {

// Lowers |f| to the distance from its zero set where it is above. Starts from the nodes that are
// `fixed`, among them all beside that set; elsewhere |f| is an upper bound. Signs stay. First order
// in the voxel size h (fast sweeping, Zhao 2005). Index: (i·Y + j)·Z + k.
void solve_eikonal(std::vector<float>& f, const std::vector<char>& fixed, const Index3& nodes,
                   double h);

}  // namespace gpis

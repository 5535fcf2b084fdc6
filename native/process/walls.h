// Where bounds end inside of a body and what is beyond them is known, the body has a wall: where
// those of a subtracted operand do (outside of them it is absent, and what is left of the others
// begins), and those of a certain one that is solid there (a random one is entered outside,
// definitions B4). A march meets changes of sign alone, and these are jumps. The wall is a certain
// box, a leaf beside the operand's.
#pragma once

#include <vector>

#include "process/surface.h"
#include "process/tree.h"

namespace gpis {

// For each leaf the box that ends it, null where it needs none. `leaves`: those of the tree,
// planned.
std::vector<ProcessTree::ProcessPtr> walls(const ProcessTree& tree,
                                           const std::vector<ProcessSurface>& leaves);

}  // namespace gpis

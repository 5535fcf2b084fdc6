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

// For each leaf; `leaves`: those of the tree, planned. Where a leaf is blended it goes on behind
// its walls as far as that reaches; bounds of a certain one move out a little, so that a face of it
// that lies on them is seen.
std::vector<ProcessTree::Wall> walls(const ProcessTree& tree,
                                     const std::vector<ProcessSurface>& leaves);

}  // namespace gpis

// Processes moved by an affine map M: f(M⁻¹x), not rescaled (definitions B12). So an operand of a
// tree has a place, size and shape of its own.
#pragma once

#include "process/tree.h"

namespace gpis {

// Refuses a matrix that flattens space. Bounds become the box around the moved ones.
std::shared_ptr<GaussianProcess> transformed(const GaussianProcess& process, const Affine& matrix);
// All leaves; those that share their noise still do.
TreePtr transformed(const ProcessTree& tree, const Affine& matrix);

}  // namespace gpis

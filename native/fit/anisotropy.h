// Squared length scales A(x) from G = Cov ∇g at the nodes of a grid.
#pragma once

#include <array>
#include <functional>
#include <vector>

#include "core/vec.h"

namespace gpis {

struct AnisotropyFit {
  std::size_t limited = 0;         // nodes brought into [shortest, longest]
  std::size_t change_limited = 0;  // nodes where the term of varying lengths was limited
};

// `slopes` holds G, xx,yy,zz,xy,xz,yz a node, and A afterwards, for a squared exponential:
// G = A⁻¹ + ⅛ tr(A⁻¹∂_iA A⁻¹∂_jA) (definitions E3), so the second term, of central differences, is
// taken off first. Length scales are kept within [shortest, longest].
AnisotropyFit fit_anisotropy(std::vector<float>& slopes, const std::array<int, 3>& nodes,
                             double voxel_size, double shortest, double longest,
                             const std::function<void(int, const std::function<void(int)>&)>& each);

}  // namespace gpis

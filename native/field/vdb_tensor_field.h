// A tensor field from two vector grids of a .vdb file.
#pragma once

#include <string>

#include "field/tensor_field.h"

namespace gpis {

// Where the six entries of A stand: xx, yy, zz and xy, xz, yz.
inline constexpr const char* kAnisotropyGrids[2] = {"anisotropy_diagonal",
                                                    "anisotropy_offdiagonal"};

// The grids of these names, on the same voxels; entries are in object space whatever the grids'
// transform. Throws FileNotFound, or std::invalid_argument with a sentence (no such grids, another
// type, no active voxel, a matrix that is not positive definite).
TensorFieldPtr load_vdb_tensor_field(const std::string& path);

}  // namespace gpis

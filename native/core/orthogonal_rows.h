#pragma once

#include "core/vec.h"

namespace gpis {

// B with BᵀB = aᵀa + bᵀb and orthogonal rows, the longest first: S Vᵀ of both on top of each other,
// for squaring them first would lose a ratio above 1e8. Rows shorter than 1e-14 of the first, the
// rounding of a zero, are 0.
Mat3 orthogonal_rows(const Mat3& a, const Mat3& b = Mat3{} * 0);

}  // namespace gpis

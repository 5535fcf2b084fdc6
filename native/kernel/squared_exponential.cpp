#include "kernel/squared_exponential.h"

#include <stdexcept>
#include <string>

namespace gpis {

SquaredExponential::SquaredExponential(const Vec3& length_scale, const Mat3& axes)
    : length_scale_(length_scale) {
  for (int i = 0; i < 3; ++i)
    if (!(length_scale[i] > 0) || !std::isfinite(length_scale[i]))
      throw std::invalid_argument("length_scale must be positive and finite, it holds " +
                                  std::to_string(length_scale[i]) + ".");
  // A = R diag(ℓ²) Rᵀ, so B = diag(1/ℓ) Rᵀ whitens: A⁻¹ = BᵀB.
  const Mat3 rt = transpose(axes);
  for (int i = 0; i < 3; ++i) whitening_.row[i] = rt.row[i] / length_scale[i];
  inverse_a_ = transpose(whitening_) * whitening_;
}

}  // namespace gpis

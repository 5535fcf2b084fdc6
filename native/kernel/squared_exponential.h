// Squared-exponential correlation κ(q) = exp(-q²/2), q² = rᵀA⁻¹r, A symmetric positive definite
// (squared length scales).
#pragma once

#include <cmath>

#include "core/vec.h"

namespace gpis {

class SquaredExponential {
 public:
  // Length scales along the axes of the rotation (columns of `axes`); all must be positive and
  // finite.
  explicit SquaredExponential(const Vec3& length_scale = {1, 1, 1}, const Mat3& axes = {});

  static double correlation(double q) { return std::exp(-0.5 * q * q); }
  static constexpr double kLambda2 = 1;  // -κ''(0)

  double covariance(const Vec3& x, const Vec3& y) const {
    const Vec3 r = x - y;
    return std::exp(-0.5 * dot(r, inverse_a_ * r));
  }
  const Vec3& length_scale() const { return length_scale_; }
  const Mat3& inverse_a() const { return inverse_a_; }  // A⁻¹
  // B with A⁻¹ = Bᵀ B: whitens a vector, |B d| = 1/ℓ_d.
  const Mat3& whitening() const { return whitening_; }
  double min_length_scale() const {
    return std::min({length_scale_.x, length_scale_.y, length_scale_.z});
  }

 private:
  Vec3 length_scale_;
  Mat3 inverse_a_, whitening_;
};

}  // namespace gpis

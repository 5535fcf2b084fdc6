// Three length scales and the rotation of their axes: the matrix A of squared length scales as
// people write it.
#pragma once

#include <array>
#include <string>

#include "core/vec.h"

namespace gpis {

class LengthScales {
 public:
  // All positive; an infinite one = constant along that axis. `rotation` is a quaternion
  // (w, x, y, z) of any length but 0.
  LengthScales(const Vec3& length, const std::array<double, 4>& rotation = {1, 0, 0, 0});
  LengthScales(double length) : LengthScales(Vec3{length, length, length}) {}

  // B with A⁻¹ = BᵀB: whitens a vector, |B d| = 1/ℓ_d.
  const Mat3& whitening() const { return whitening_; }
  double shortest() const { return std::min({length_.x, length_.y, length_.z}); }
  std::string describe() const;  // the arguments as Python writes them
  std::string describe_rotation() const;

 private:
  Vec3 length_;
  std::array<double, 4> rotation_;
  Mat3 whitening_;
};

}  // namespace gpis

#include "kernel/length_scales.h"

#include "field/check.h"
#include "kernel/kernel.h"

namespace gpis {

LengthScales::LengthScales(const Vec3& length, const std::array<double, 4>& rotation)
    : length_(length), rotation_(rotation) {
  for (int i = 0; i < 3; ++i)
    if (!(length[i] > 1e-100))  // below, squares of its inverse overflow
      refuse("length_scale must be positive (inf = constant along that axis), it holds ", length[i],
             ".");
  double n = 0;
  for (double v : rotation) n = std::hypot(n, v);
  if (!(n > 0) || !std::isfinite(n))
    refuse("rotation must be a quaternion that is not zero, of finite numbers.");
  const double w = rotation[0] / n, x = rotation[1] / n, y = rotation[2] / n, z = rotation[3] / n;
  // Rows: the turned axes, R's columns. A = R diag(ℓ²) Rᵀ, so B = diag(1/ℓ) Rᵀ.
  whitening_ = {{Vec3{1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)},
                 Vec3{2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)},
                 Vec3{2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)}}};
  for (int i = 0; i < 3; ++i) whitening_.row[i] *= 1 / length[i];
}

std::string LengthScales::describe() const {
  const bool isotropic = length_.x == length_.y && length_.y == length_.z;
  return isotropic ? number_text(length_.x) : vector_text(length_);
}

std::string LengthScales::describe_rotation() const {
  if (rotation_ == std::array<double, 4>{1, 0, 0, 0}) return "";
  std::string text = ", rotation=(";
  for (int i = 0; i < 4; ++i) text += (i ? ", " : "") + number_text(rotation_[i]);
  return text + ")";
}

}  // namespace gpis

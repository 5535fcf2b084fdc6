// Length scales that vary along x alone, as tests/tensor_grids.py has them.
#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <string>

#include "field/tensor_grid_field.h"

namespace gpis::test {

// From -2 to `end`; beyond, the values there.
inline TensorFieldPtr along_x(const std::function<SymMat3(double)>& at, int nodes, double end = 8) {
  const double voxel = (end + 2) / (nodes - 1);
  TensorGridField::Bricks bricks;
  for (int e = 0; e < 6; ++e)
    bricks[e] = std::make_shared<BrickGrid>(Index3{nodes, 2, 2}, [&](int i, int, int) {
      return static_cast<float>(at(-2 + i * voxel)[e]);
    });
  return std::make_shared<TensorGridField>(
      bricks, Affine{{Vec3{voxel, 0, 0}, Vec3{0, 10, 0}, Vec3{0, 0, 10}}, {-2, -5, -5}},
      [](const Index3&) { return std::string("node"); });
}

inline SymMat3 isotropic(double length) {
  return SymMat3::identity(length * length);
}

// 3:1, turning about z by a right angle in 3 units.
inline SymMat3 rotating(double x) {
  const double c = std::cos(x * kPi / 6), s = std::sin(x * kPi / 6), a = 3, b = 1.0 / 3;
  return {c * c * a + s * s * b, s * s * a + c * c * b, 1, c * s * (a - b), 0, 0};
}

inline double smooth_step(double x) {
  x = std::clamp(x, 0.0, 1.0);
  return x * x * (3 - 2 * x);
}

inline SymMat3 growing(double x) {
  return isotropic(std::exp(0.25 * x));
}

inline SymMat3 stepping(double x) {
  return isotropic(std::pow(4, smooth_step(x - 2)));
}

// Short at one node of 101, as along the crease of a fit.
inline SymMat3 crease(double x) {
  return isotropic(std::abs(x - 2) < 0.05 ? 0.1 : 1);
}

// Painted with a brush of radius ½.
inline SymMat3 dab(double x) {
  const double q = std::min(std::abs(x - 1.2) / 0.5, 1.0), w = (1 - q * q) * (1 - q * q);
  return isotropic(std::pow(0.05, w));
}

}  // namespace gpis::test

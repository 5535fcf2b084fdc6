// Maps of the unit square to the shapes that sampling needs (pbrt-v4, appendix A.5).
#pragma once

#include "core/vec.h"

namespace gpis {

// A point of the unit square: the two numbers of one random decision.
struct SquarePoint {
  double u, v;
};

// Uniform on the unit disk, with little distortion (Shirley & Chiu 1997).
inline std::pair<double, double> square_to_disk(double u1, double u2) {
  const double a = 2 * u1 - 1, b = 2 * u2 - 1;
  if (a == 0 && b == 0) return {0, 0};
  const bool wide = std::abs(a) > std::abs(b);
  const double r = wide ? a : b;
  const double phi = wide ? kPi / 4 * (b / a) : kPi / 2 - kPi / 4 * (a / b);
  return {r * std::cos(phi), r * std::sin(phi)};
}

// Two independent standard normal numbers (Box & Muller 1958).
inline std::pair<double, double> square_to_normals(SquarePoint at) {
  const double r = std::sqrt(-2 * std::log1p(-at.u)), phi = 2 * kPi * at.v;
  return {r * std::cos(phi), r * std::sin(phi)};
}

// Density cos θ/π about +z; z > 0 always, since u1 < 1.
inline Vec3 square_to_cosine_hemisphere(double u1, double u2) {
  const double r = std::sqrt(u1), phi = 2 * kPi * u2;
  return {r * std::cos(phi), r * std::sin(phi), std::sqrt(1 - u1)};
}

// Uniform in the cone about +z with 1 - cos(half angle) = `cap`; density 1/(2π cap). The argument
// is `cap` and not the cosine because the cosine of a small cone rounds to 1.
inline Vec3 square_to_cone(double u1, double u2, double cap) {
  const double below = u1 * cap;  // 1 - cos θ
  const double sin = std::sqrt(std::max(0.0, below * (2 - below))), phi = 2 * kPi * u2;
  return {sin * std::cos(phi), sin * std::sin(phi), 1 - below};
}

}  // namespace gpis

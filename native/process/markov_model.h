// Correlations whose restriction to a line is a Markov process of a small state z (Hartikainen &
// Särkkä 2010, formulas C2-C4): z(x + Δ) = A(Δ) z(x) + N(0, Q(Δ)), Q = c ∫₀^Δ h hᵀ ds with h the
// last column of A, c = kIntensity. z₀ = g, the others derivatives of it per x = kRate · q.
#pragma once

#include <Eigen/Core>

#include "kernel/radial.h"

namespace gpis {

struct Matern32 {
  static constexpr int kSize = 2;
  using Vector = Eigen::Vector2d;
  using Matrix = Eigen::Matrix2d;
  static constexpr Radial::Family kFamily = Radial::Family::matern32;
  static constexpr double kRate = 1.7320508075688772;  // √3
  static constexpr double kIntensity = 4;
  // Of g from the cubic through values and slopes h length scales apart: standard deviation over
  // (B₁+B₂) at most kDeviation · h^kPower. √(12√3)/(6√3), the bridge of integrated Brownian motion.
  static constexpr double kDeviation = 0.439, kPower = 1.5;
  static Matrix stationary() { return Matrix::Identity(); }
  static Vector response(double x) { return Vector(x, 1 - x) * std::exp(-x); }
  static Matrix transition(double x) { return std::exp(-x) * Matrix{{1 + x, x}, {-x, 1 - x}}; }
  // No entry of the first row of A(y), y >= x, is greater.
  static double decay(double x) { return (1 + x) * std::exp(-x); }
};

struct Matern52 {
  static constexpr int kSize = 3;
  using Vector = Eigen::Vector3d;
  using Matrix = Eigen::Matrix3d;
  static constexpr Radial::Family kFamily = Radial::Family::matern52;
  static constexpr double kRate = 2.23606797749979;  // √5
  static constexpr double kIntensity = 16.0 / 3;
  static constexpr double kDeviation = 0.263, kPower = 2.5;  // limit h -> 0, evaluated numerically
  static Matrix stationary() { return Matrix{{1, 0, -1.0 / 3}, {0, 1.0 / 3, 0}, {-1.0 / 3, 0, 1}}; }
  static Vector response(double y) {
    const double half = 0.5 * y * y;
    return Vector(half, y - half, 1 - 2 * y + half) * std::exp(-y);
  }
  static Matrix transition(double y) {
    const double y2 = y * y, half = 0.5 * y2;
    return std::exp(-y) * Matrix{{1 + y + half, y + y2, half},
                                 {-half, 1 + y - y2, y - half},
                                 {-y + half, -3 * y + y2, 1 - 2 * y + half}};
  }
  static double decay(double y) {
    y = std::max(y, 1.0);
    return (1 + y + y * y) * std::exp(-y);
  }
};

struct Wong {
  static constexpr int kSize = 2;
  using Vector = Eigen::Vector2d;
  using Matrix = Eigen::Matrix2d;
  static constexpr Radial::Family kFamily = Radial::Family::wong;
  static constexpr double kRate = 1;
  static constexpr double kA = 0.5773502691896258, kB = 1.7320508075688772;  // 1/√3, √3
  static constexpr double kIntensity = 4.618802153517006;                    // 2 (a + b)
  static constexpr double kDeviation = 0.207, kPower = 1.5;
  static Matrix stationary() { return Matrix::Identity(); }
  static Vector response(double t) {
    const double ea = std::exp(-kA * t), difference = -std::expm1(-(kB - kA) * t);
    return kB / 2 * ea * Vector(difference, kB - kA - kB * difference);
  }
  static Matrix transition(double t) {
    const double ea = std::exp(-kA * t), eb = std::exp(-kB * t);
    return kB / 2 * Matrix{{kB * ea - kA * eb, ea - eb}, {eb - ea, kB * eb - kA * ea}};
  }
  static double decay(double t) { return 1.5 * std::exp(-kA * t); }
};

// Q(Δ) = c ∫ h hᵀ, to full relative precision however small Δ is.
template <class Model>
typename Model::Matrix transition_noise(double delta);

// z anywhere between two known states: z = from_left z_l + from_right z_r + factor ξ.
template <class Model>
struct Bridge {
  typename Model::Matrix from_left, from_right, factor;
  Bridge() = default;
  Bridge(double left, double right);  // distances to them in x
};

// z after a step from a known state: z = from z_l + factor ξ.
template <class Model>
struct Transition {
  typename Model::Matrix from, factor;
  Transition() = default;
  explicit Transition(double delta);
};

extern template struct Bridge<Matern32>;
extern template struct Bridge<Matern52>;
extern template struct Bridge<Wong>;
extern template struct Transition<Matern32>;
extern template struct Transition<Matern52>;
extern template struct Transition<Wong>;

}  // namespace gpis

// One squared-exponential term of a realisation (formulas C11, constant A): in whitened coordinates
// y = Bx, g(x) = Σ_j φ(y₀ - j₀h) φ(y₁ - j₁h) φ(y₂ - j₂h) ξ_j, exactly Gaussian. A modulated term
// κ(|Br|) cos(k·r) is cos(k·x) g₁ + sin(k·x) g₂ with two such fields (C9).
#pragma once

#include "field/field.h"
#include "kernel/kernel.h"
#include "process/gaussian_window.h"
#include "process/lattice_noise.h"

namespace gpis {

// E ω⁸ of a normal frequency of mean m and variance v.
inline double eighth_moment(double m, double v) {
  const double m2 = m * m;
  return m2 * (m2 * (m2 * (m2 + 28 * v) + 210 * v * v) + 420 * v * v * v) + 105 * v * v * v * v;
}

// One field of unit variance on one lattice.
class Lattice {
 public:
  // A⁻¹ = BᵀB. B may have rows of zeros: the field is then constant along some axis.
  Lattice(const Mat3& whitening, int number);

  FieldSample sample(LatticeNoise& noise, const Vec3& x);
  // g at x + (i, j, k) spacing, 0 <= i, j, k < size, k contiguous: axis by axis, so that a point
  // costs one sum over one axis.
  void box(LatticeNoise& noise, const Vec3& x, double spacing, const std::array<int, 3>& size,
           double* g);

 private:
  // The whitened coordinates in echelon form from z up: only the first depends on z. The rows of a
  // singular B that vanish come last.
  Mat3 factor_;
  unsigned thin_ = 0;
  int number_;

  // The nodes read last, kept for the next point: along a ray or a row most windows repeat.
  struct Window {
    std::uint64_t generation = 0;
    Node first{};
    std::array<int, 3> size{};
    std::vector<double> normals;
  };
  const double* window(LatticeNoise& noise, const Node& first, const std::array<int, 3>& size);
  void box(LatticeNoise& noise, const Vec3& x, double spacing, const std::array<int, 3>& size,
           std::ptrdiff_t slice, std::ptrdiff_t row, double* g);
  Window window_;
  std::vector<double> plane_, row_;  // of `box`: normals summed over one and two axes
  std::vector<GaussianWindow> along_;
};

class LatticeField {
 public:
  // Serves squared-exponential and constant terms; takes the lattices `number` and up.
  LatticeField(const Term& term, int number);
  int lattices() const { return static_cast<int>(lattices_.size()); }

  void add(LatticeNoise& noise, const Vec3& x, FieldSample& g);
  void add_box(LatticeNoise& noise, const Vec3& x, double spacing, const std::array<int, 3>& size,
               float* g);
  // Of the fourth derivative along d.
  double fourth_derivative_variance(const Vec3& d) const;

 private:
  std::vector<Lattice> lattices_;
  Mat3 whitening_;
  double scale_;
  Vec3 wave_vector_;
  std::vector<double> scratch_;
};

}  // namespace gpis

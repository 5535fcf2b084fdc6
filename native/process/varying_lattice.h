// The squared exponential under a field A(x) of squared length scales, with exactly the covariance
// of Paciorek and Schervish (formulas C11): g(x) = Σ_j φ_{A(x)}(x - s_j) ξ_j h^{3/2},
//   φ_A(u) = (2/π)^¾ |A|^{-¼} exp(-uᵀA⁻¹u),
// on one lattice of spacing h = ½ √(smallest eigenvalue of A anywhere): where A is large a point
// takes many nodes.
#pragma once

#include "field/tensor_field.h"
#include "process/lattice_noise.h"

namespace gpis {

class VaryingLattice {
 public:
  // Squared length scales length² · A(x).
  VaryingLattice(TensorFieldPtr a, double length, int number);

  FieldSample sample(LatticeNoise& noise, const Vec3& x);
  double value(LatticeNoise& noise, const Vec3& x);  // alone, at a fraction of the cost
  // A bound of the variance of the fourth derivative along d.
  double fourth_derivative_variance(const Vec3& d) const;

 private:
  // The nodes in reach of x, those s with uᵀA⁻¹u below a bound, u = s - x: the box about them.
  struct Ellipsoid {
    Ellipsoid(const SymMat3& a, const Vec3& x, double h);
    Cholesky3 factor;
    SymMat3 p;  // A⁻¹
    Node first;
    std::array<int, 3> size;
    double scale;
  };
  // Calls visit(uy, uz, u, b, least, ξ, n) for every row of n nodes, the first at u along x.
  template <class Visit>
  void rows(const Ellipsoid& e, const Vec3& x, const double* normals, const Visit& visit) const;
  const double* window(LatticeNoise& noise, const Node& first, const std::array<int, 3>& size);

  TensorFieldPtr a_;
  double length2_, spacing_;
  int number_;

  std::uint64_t generation_ = 0;
  Node first_{};
  std::array<int, 3> size_{};
  std::vector<double> normals_, gauss_;
};

}  // namespace gpis

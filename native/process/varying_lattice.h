// The squared exponential under a field A(x) of squared length scales, with exactly the covariance
// of Paciorek and Schervish (formulas C11): g(x) = Σ_j φ_{A(x)}(x - s_j) ξ_j h^{3/2},
//   φ_A(u) = (2/π)^¾ |A|^{-¼} exp(-uᵀA⁻¹u),
// on one lattice of spacing h = ½ √(smallest eigenvalue of A anywhere). `value` takes that noise
// smoothed, W_S, on nodes as far apart as the smallest eigenvalue at x allows: with M = A(x) - 2S
//   g(x) = (2/π)^¾ |A|^¼ |M|^{-½} H³ Σ_n exp(-uᵀM⁻¹u) W_S(s_n).
#pragma once

#include <Eigen/Core>

#include "field/tensor_field.h"
#include "process/smoothed_noise.h"

namespace gpis {

class VaryingLattice {
 public:
  // Squared length scales length² · A(x).
  VaryingLattice(TensorFieldPtr a, double length, int number);

  // The white noise is as fine as the shortest length anywhere asks for, so that a realisation is
  // the same whatever bounds it is looked at in; a kernel is as wide as the lengths where it
  // stands. Refuses bounds in which these are too far apart.
  static constexpr double kMostRatio = 8;
  static void check(const TensorField& a, const Box3& bounds);

  // From the white noise itself: a few points of a realisation do not pay for smoothing it.
  FieldSample sample(LatticeNoise& noise, SmoothedNoise& smoothed, const Vec3& x);
  // Alone, of many points: from smoothed noise.
  double value(LatticeNoise& noise, SmoothedNoise& smoothed, const Vec3& x);
  // A bound of the variance of the fourth derivative along d.
  double fourth_derivative_variance(const Vec3& d) const;

 private:
  // The nodes in reach of x, those s with uᵀM⁻¹u below a bound, u = s - x: the box about them.
  struct Ellipsoid {
    Ellipsoid(const SymMat3& a, const SmoothedNoise::White& white, const Vec3& x, bool smoothed);
    int level;  // -1: the white noise itself
    double h;
    SymMat3 inverse_a, p;  // p = M⁻¹
    Node first;
    std::array<int, 3> size;
    double scale;
  };
  // The noise of one level about the last point, with a margin that serves the points around too.
  struct Window {
    std::uint64_t generation = 0;
    Node first{};
    std::array<int, 3> size{};
    std::vector<float> noise;
  };
  // Where its row and slice are `row` and `slice` apart.
  struct View {
    const float* noise;
    std::ptrdiff_t row, slice;
  };
  View window(LatticeNoise& noise, SmoothedNoise& smoothed, const Ellipsoid& e);
  // A row of n nodes, the first at u = (x, y, z): weights exp(-least - p.xx (x + b + ih)²).
  struct Row {
    double x, y, z, b, least;
    const float* noise;
    int n;
  };
  // Calls visit(row) for every row with nodes in reach.
  template <class Visit>
  static void rows(const Ellipsoid& e, const Vec3& x, const View& view, const Visit& visit);

  TensorFieldPtr a_;
  double length2_;
  SmoothedNoise::White white_;
  std::vector<Window> windows_;  // by level + 1
  std::vector<double> normals_;
  // Of `value`: of a row's nodes; of rows, the logarithms of two factors.
  std::vector<float> gauss_;
  std::vector<Row> rows_;
  Eigen::ArrayXd first_weight_, ratio_;
};

}  // namespace gpis

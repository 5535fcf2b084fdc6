// The covariance of (g, ∇g) between any two points: by the kernel where it is stationary, after
// Paciorek and Schervish where the squared length scales A(x) vary (math.md §2, formulas C10).
// Everything that draws or conditions g jointly goes through it.
#pragma once

#include <Eigen/Core>
#include <array>
#include <string>
#include <vector>

#include "core/sym_mat3.h"
#include "process/gaussian_process.h"

namespace gpis {

// A point with what its covariances need; where the kernel is stationary, x alone.
struct LocalPoint {
  Vec3 x;
  SymMat3 a, inverse_a;
  std::array<SymMat3, 3> da;  // ∂A/∂x_i
  double root = 1;            // |A|^¼
};

// A linear functional of g at a point: value · g + slope · ∇g.
struct Functional {
  double value = 1;
  Vec3 slope;

  bool value_only() const { return slope.x == 0 && slope.y == 0 && slope.z == 0; }
};

class Covariance {
 public:
  // Throws a sentence where the kernel and an anisotropy do not go together.
  explicit Covariance(const GaussianProcess& process);

  LocalPoint at(const Vec3& x) const;
  double value(const LocalPoint& x, const LocalPoint& y) const;
  // Covariance of g at x and of its slope along d there with a functional at y; `da` is ∂_d A at x.
  double along(const LocalPoint& x, const Vec3& d, const SymMat3& da, const LocalPoint& y,
               const Functional& of_y, double& slope) const;
  // Rows (g, ∇g) at x, columns (g, ∇g) at y.
  Eigen::Matrix4d block(const LocalPoint& x, const LocalPoint& y) const;
  // Of (g, ∇g) at x with a functional at y.
  Eigen::Vector4d cross(const LocalPoint& x, const LocalPoint& y, const Functional& of_y) const;
  double between(const LocalPoint& x, const Functional& of_x, const LocalPoint& y,
                 const Functional& of_y) const;

  double variance() const { return variance_; }
  bool stationary() const { return !anisotropy_; }
  bool differentiable() const { return differentiable_; }
  // Whether values of g at spacings of half a length scale determine it (math.md §5.4).
  bool smooth() const { return smooth_; }
  const TensorField* anisotropy() const { return anisotropy_.get(); }
  // The shortest length scale at x along d, in units of d.
  double length_scale(const LocalPoint& x, const Vec3& d) const;
  // Distance in whitened space, from where on correlations are below `correlation`; infinite where
  // none is known.
  double reach(double correlation) const;
  // Metrics, one for each term, in which points further than 1 apart in all of them have
  // correlations below `correlation`; none where none is known.
  std::vector<Mat3> reach_metrics(double correlation) const;
  // ψ(Q) = Σ weight κ(√Q/ℓ) and its derivatives, for the terms of the kernel under an anisotropy.
  struct Profile {
    double psi, psi1, psi2;
  };
  Profile profile(double Q) const { return profile<2>(Q); }
  void profiles(const double* Q, int n, double* psi, double* psi1, double* psi2) const;
  // 1/ℓ² of the shortest of these terms.
  double shortest_inverse2() const;
  // The largest length scale anywhere: a distance in whitened space is at least the distance over
  // it.
  double longest_length() const { return longest_; }

 private:
  struct Scale {
    Radial radial;
    double weight, inverse_length2;
  };
  template <int derivatives>
  Profile profile(double Q) const;
  struct Pair;

  KernelPtr kernel_;
  TensorFieldPtr anisotropy_;
  std::vector<Scale> scales_;   // under an anisotropy
  std::vector<Term> terms_;     // without
  Mat3 derivative_covariance_;  // without, where differentiable
  double variance_, longest_ = 0;
  bool differentiable_, smooth_ = false;
};

}  // namespace gpis

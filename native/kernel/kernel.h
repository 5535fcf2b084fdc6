// Covariance of the zero-mean process g: stationary, a function of r = x - y, with its analytic
// derivatives. Immutable and shared.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "kernel/radial.h"

namespace gpis {

// One of the independent processes whose sum is g: covariance weight · κ(|B r|) · cos(k·r).
struct Term {
  double weight = 1;
  Radial radial;
  Mat3 whitening;    // B, A⁻¹ = BᵀB; rows orthogonal, a zero row = constant along that axis
  Vec3 wave_vector;  // k, 0 = none

  bool modulated() const { return wave_vector.x != 0 || wave_vector.y != 0 || wave_vector.z != 0; }
  // q = |B r|, below the square root of the largest double.
  double distance(const Vec3& r) const { return std::min(length(whitening * r), 1e150); }
  double covariance(const Vec3& r) const;
  // 1/ℓ of its shortest axis.
  double max_inverse_length() const;
};

// weight · Π κᵢ(|Bᵢ r|) cos(kᵢ·r): a term whose radial part is a product of several. The weights of
// the factors do not count.
struct ProductTerm {
  double weight = 1;
  std::vector<Term> factors;
};

class Kernel {
 public:
  // A normal form longer than this is not made: whoever needs one serves the kernel jointly.
  static constexpr std::size_t kMaxTerms = 4096;

  virtual ~Kernel() = default;
  virtual double covariance(const Vec3& r) const = 0;
  // ∂/∂x_i k(x - y) and ∂²/∂x_i∂y_j k(x - y), the latter minus the Hessian of k(r).
  virtual Vec3 gradient(const Vec3& r) const = 0;
  // Both together.
  virtual double covariance_and_gradient(const Vec3& r, Vec3& slopes) const {
    slopes = gradient(r);
    return covariance(r);
  }
  virtual Mat3 mixed(const Vec3& r) const = 0;
  // False with a Matérn 1/2 inside: g has no gradient, `mixed` is infinite at 0.
  virtual bool differentiable() const = 0;
  // The shortest length over which g changes: for steps and bounds.
  virtual double min_length_scale() const = 0;
  // The normal form: g as a sum of independent terms; nothing where a product has none.
  virtual std::optional<std::vector<Term>> terms() const = 0;
  // The same for products too, for those who need no more than to draw from its spectrum; nothing
  // where there are more than kMaxTerms.
  virtual std::optional<std::vector<ProductTerm>> products() const;
  // As Python writes it.
  virtual std::string describe() const = 0;

  // 1 except after sums and scaling.
  double variance() const { return covariance({}); }
  // G = Cov ∇g (definitions E3).
  Mat3 derivative_covariance() const { return mixed({}); }
  // dᵀGd; infinite where there is no derivative.
  double derivative_variance(const Vec3& direction) const;
};
using KernelPtr = std::shared_ptr<const Kernel>;

// Shortest text that reads back as the same number, and a tuple of three.
std::string number_text(double v);
std::string vector_text(const Vec3& v);

}  // namespace gpis

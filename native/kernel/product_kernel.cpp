#include "kernel/product_kernel.h"

#include <Eigen/SVD>

namespace gpis {
namespace {

// B with BᵀB = B₁ᵀB₁ + B₂ᵀB₂ and orthogonal rows, from the singular values of both on top of each
// other: squaring them first would lose a ratio of lengths above 1e8.
Mat3 combined_whitening(const Mat3& a, const Mat3& b) {
  Eigen::Matrix<double, 6, 3> both;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      both(i, j) = a.row[i][j];
      both(i + 3, j) = b.row[i][j];
    }
  const Eigen::JacobiSVD<Eigen::Matrix<double, 6, 3>> svd(both, Eigen::ComputeFullV);
  const Eigen::Vector3d& s = svd.singularValues();
  Mat3 out;
  for (int i = 0; i < 3; ++i)  // below 1e-14 of the largest it is the rounding of a zero
    for (int j = 0; j < 3; ++j)
      out.row[i][j] = s[i] > 1e-14 * s[0] ? s[i] * svd.matrixV()(j, i) : 0;
  return out;
}

// False where the product of the radial parts is not one of the families.
bool multiply_radial(const Term& a, const Term& b, Term& out) {
  using Family = Radial::Family;
  if (a.radial.family == Family::constant || b.radial.family == Family::constant) {
    const Term& other = a.radial.family == Family::constant ? b : a;
    out.radial = other.radial;
    out.whitening = other.whitening;
    return true;
  }
  if (a.radial.family != Family::squared_exponential ||
      b.radial.family != Family::squared_exponential)
    return false;
  out.radial = a.radial;
  out.whitening = combined_whitening(a.whitening, b.whitening);
  return true;
}

bool is_zero(const Vec3& v) {
  return v.x == 0 && v.y == 0 && v.z == 0;
}

}  // namespace

Mat3 ProductKernel::mixed(const Vec3& r) const {
  const Vec3 a = a_->gradient(r), b = b_->gradient(r);
  return a_->mixed(r) * b_->covariance(r) + b_->mixed(r) * a_->covariance(r) +
         (outer(a, b) + outer(b, a)) * -1;
}

std::optional<std::vector<Term>> ProductKernel::terms() const {
  const auto left = a_->terms(), right = b_->terms();
  if (!left || !right || left->size() * right->size() > kMaxTerms) return std::nullopt;
  std::vector<Term> out;
  for (const Term& a : *left)
    for (const Term& b : *right) {
      Term product;
      if (!multiply_radial(a, b, product)) return std::nullopt;
      product.weight = a.weight * b.weight;
      product.wave_vector = a.wave_vector + b.wave_vector;
      if (is_zero(a.wave_vector) || is_zero(b.wave_vector)) {
        out.push_back(product);
        continue;
      }
      product.weight *= 0.5;
      out.push_back(product);
      product.wave_vector = a.wave_vector - b.wave_vector;
      out.push_back(product);
    }
  if (out.size() > kMaxTerms) return std::nullopt;
  return out;
}

}  // namespace gpis

#include "kernel/product_kernel.h"

#include "core/orthogonal_rows.h"

namespace gpis {
namespace {

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
  out.whitening = orthogonal_rows(a.whitening, b.whitening);
  return true;
}

bool is_zero(const Vec3& v) {
  return v.x == 0 && v.y == 0 && v.z == 0;
}

// Adds the terms of the product; false where it has none.
bool multiply(const Term& a, const Term& b, std::vector<Term>& out) {
  Term product;
  if (!multiply_radial(a, b, product)) return false;
  product.weight = a.weight * b.weight;
  product.wave_vector = a.wave_vector + b.wave_vector;
  if (is_zero(a.wave_vector) || is_zero(b.wave_vector)) {
    out.push_back(product);
    return true;
  }
  product.weight *= 0.5;
  out.push_back(product);
  product.wave_vector = a.wave_vector - b.wave_vector;
  out.push_back(product);
  return true;
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
    for (const Term& b : *right)
      if (!multiply(a, b, out)) return std::nullopt;
  if (out.size() > kMaxTerms) return std::nullopt;
  return out;
}

std::optional<std::vector<ProductTerm>> ProductKernel::products() const {
  const auto left = a_->products(), right = b_->products();
  if (!left || !right || left->size() * right->size() > kMaxTerms) return std::nullopt;
  std::vector<ProductTerm> out;
  for (const ProductTerm& a : *left)
    for (const ProductTerm& b : *right) {
      std::vector<Term> terms;
      if (a.factors.size() == 1 && b.factors.size() == 1 &&
          multiply(a.factors[0], b.factors[0], terms)) {
        // Cosines of two waves are half of each of two terms.
        for (const Term& term : terms)
          out.push_back({a.weight * b.weight / static_cast<double>(terms.size()), {term}});
        continue;
      }
      ProductTerm both{a.weight * b.weight, a.factors};
      both.factors.insert(both.factors.end(), b.factors.begin(), b.factors.end());
      out.push_back(std::move(both));
    }
  if (out.size() > kMaxTerms) return std::nullopt;
  return out;
}

}  // namespace gpis

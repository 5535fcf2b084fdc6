#include "kernel/kernel.h"

#include <charconv>

namespace gpis {

double Term::covariance(const Vec3& r) const {
  const double k = weight * radial.value(distance(r));
  return modulated() ? k * std::cos(dot(wave_vector, r)) : k;
}

double Term::max_inverse_length() const {
  double longest = 0;
  for (const Vec3& row : whitening.row) longest = std::max(longest, length(row));
  return longest;
}

std::optional<std::vector<ProductTerm>> Kernel::products() const {
  const auto terms = this->terms();
  if (!terms) return std::nullopt;
  std::vector<ProductTerm> out;
  for (const Term& term : *terms) out.push_back({term.weight, {term}});
  return out;
}

double Kernel::derivative_variance(const Vec3& direction) const {
  if (!differentiable()) return kInfinity;
  // A quadratic form of a positive semi-definite matrix: below 0 by rounding alone.
  return std::max(0.0, dot(direction, derivative_covariance() * direction));
}

std::string number_text(double v) {
  char text[32];
  return {text, std::to_chars(text, text + sizeof text, v).ptr};
}

std::string vector_text(const Vec3& v) {
  return "(" + number_text(v.x) + ", " + number_text(v.y) + ", " + number_text(v.z) + ")";
}

}  // namespace gpis

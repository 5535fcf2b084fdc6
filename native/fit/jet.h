// What a fit keeps of a stochastic field at one point: f = mean + sigma·g there, and to first order
// around it. Given f the gradient is normal,
//   ∇f | f = ∇mean + (f - mean)/sigma ∇sigma + sigma ∇g,   Cov ∇g = G  (math.md §2),
// with ∇g independent of all values at the point, as the variance of g is 1 everywhere: gradients
// need not be drawn to have their moments.
#pragma once

#include "core/sym_mat3.h"

namespace gpis {

struct Jet {
  double mean = 0, sigma = 0;
  Vec3 mean_gradient, sigma_gradient;
  SymMat3 slopes;  // G

  // E[∇f | f], less the last term.
  Vec3 gradient_given(double f) const {
    return sigma > 0 ? mean_gradient + sigma_gradient * ((f - mean) / sigma) : mean_gradient;
  }
};

inline SymMat3 square(const Vec3& v) {
  return {v.x * v.x, v.y * v.y, v.z * v.z, v.x * v.y, v.x * v.z, v.y * v.z};
}
// a bᵀ + b aᵀ
inline SymMat3 symmetric_product(const Vec3& a, const Vec3& b) {
  return square(a + b) - square(a) - square(b);
}

// A jet from moments of (f, ∇f). `fallback`: the slopes where f is certain.
inline Jet jet_of_moments(double mean, double variance, const Vec3& gradient,
                          const SymMat3& gradient_covariance, const Vec3& covariance_with_value,
                          const SymMat3& fallback) {
  Jet jet{mean, std::sqrt(std::max(variance, 0.0)), gradient, {}, fallback};
  if (!(jet.sigma > 0)) return jet;
  jet.sigma_gradient = covariance_with_value / jet.sigma;  // ½ ∇σ² = Cov(f, ∇f)
  jet.slopes = (gradient_covariance - square(jet.sigma_gradient)) * (1 / variance);
  return jet;
}

}  // namespace gpis

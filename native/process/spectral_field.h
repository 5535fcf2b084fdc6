// One term of a realisation by random spectral features, for kernels without a lattice, products of
// such ones included (the frequencies of a product are the sums of those of its factors):
//   g(x) = √(weight/N) Σ_k √w_k (a_k cos ω_k·x + b_k sin ω_k·x),  a_k, b_k iid N(0,1),
// with random ω_k of the spectrum (formulas C8), N = 1024. Values and gradients have exactly the
// kernel's covariance, but are Gaussian only for N → ∞: given the ω_k they are, with a covariance
// that differs from one realisation to the next.
//
// Spectra of Matérn 3/2 and Wong have no fourth moment: with w = 1 the variance of the slopes of
// one realisation would itself have no variance. So half of the ω_k are drawn from the spectrum p
// and half from |k|² p / E|k|² (k = ω whitened), weighted by w = 2/(1 + |k|²/E|k|²): then both w
// and w|k|² are bounded. Of a product, |k|² is Σ |kᵢ|²/ℓᵢ², ℓᵢ the shortest length of a factor.
// Excess kurtosis over realisations: values at most .72/N = 7e-4, slopes at most 4.1/N = 4e-3
// (Matérn 3/2; RQ with α = ½ the same, all others less), of products 4.9/N = 5e-3.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>

#include "core/rng.h"
#include "core/sincos.h"
#include "field/field.h"
#include "kernel/kernel.h"

namespace gpis {

class SpectralField {
 public:
  static constexpr int kFeatures = 1024;

  SpectralField(ProductTerm term, int number);
  // A new realisation; `time` in temporal length scales: the amplitudes change with it, the
  // frequencies do not. Returns how many normals it took.
  std::uint64_t draw(std::uint64_t seed, std::optional<double> time);

  void add(const Vec3& x, FieldSample& g);

  // g along o + t d, values and slopes per t.
  void set_line(const Vec3& o, const Vec3& d);
  void add_on_line(double t, double& g, double& dg);
  // Variance of the fourth derivative along the line, given the frequencies; and about what it is
  // before they are drawn (its expectation is infinite for some spectra).
  double fourth_derivative_variance() const;
  double expected_fourth_derivative_variance(const Vec3& d) const;

  // Adds to g[j·count + k] the values at origin + (0, j, k)·spacing, j < rows, k < count.
  void add_slice(const Vec3& origin, double spacing, int rows, int count, float* g);

 private:
  using Array = Eigen::Array<double, Eigen::Dynamic, 1>;
  using Matrix = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

  // A frequency and its weight; `biased`: of |k|² p.
  Vec3 draw_frequency(bool biased, Rng& rng, double& weight) const;
  void turn(const Array& phase) { sincos(phase.data(), kFeatures, sine_.data(), cosine_.data()); }

  ProductTerm term_;
  int number_;
  std::vector<double> squares_;  // E|kᵢ|²/ℓᵢ² of the factors; empty: one has no derivative
  double square_ = 0;            // their sum
  Array omega_[3], a_, b_;       // amplitudes with their weights
  Array along_, at_origin_;      // of the line: ω·d and ω·o
  Array phase_, sine_, cosine_;

  // cos and sin of ω_z·k·spacing below each other, for `add_slice`.
  Matrix basis_;
  double basis_spacing_ = 0;
};

}  // namespace gpis

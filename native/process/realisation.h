// Sampler 6: one sample of g in all of space, with values and gradients at any point in any order
// (math.md §5.6): the ground truth for the samplers of lines, the memory `global`, and grids for
// people to look at. A sum of independent parts, one for each term of the kernel's normal form:
// lattice convolution for squared-exponential and constant terms, random spectral features for the
// others; under a field of length scales lattice convolution for all, as mixtures of squared
// exponentials.
#pragma once

#include <memory>

#include "process/gaussian_process.h"
#include "process/lattice_field.h"
#include "process/posterior.h"
#include "process/spectral_field.h"
#include "process/varying_lattice.h"

namespace gpis {

class Realisation {
 public:
  // Where it will be asked for next: close to the last point, on rays, or on whole rows of a grid.
  enum class Access { rays, rows };
  // Throws std::invalid_argument where the kernel has no normal form, or none under its anisotropy.
  // `posterior`: of the conditions that the process has, null where it has none.
  Realisation(const GaussianProcess& process, Access access, PosteriorPtr posterior);
  // Refuses bounds to be asked for in which length scales are too long for it.
  static void check(const GaussianProcess& process, const Box3& bounds) {
    if (process.anisotropy) VaryingLattice::check(*process.anisotropy, bounds);
  }

  // Another realisation, a pure function of (seed, time). `time` in temporal length scales: the
  // realisations of one seed at two times are correlated as exp(-Δ²/2).
  void draw(std::uint64_t seed, std::optional<double> time);

  // Given the conditions.
  FieldSample sample(const Vec3& x);

  // The restriction to o + t d: values, and slopes per t.
  void set_line(const Vec3& o, const Vec3& d);
  void on_line(double t, double& g, double& dg);
  // Standard deviation of the fourth derivative along the line; and about what it is along any
  // line of direction d, whatever the seed.
  double fourth_derivative() const;
  double expected_fourth_derivative(const Vec3& d) const;

  // Values at origin + (i, j, k)·spacing, 0 <= i, j, k < size; g[(i·J + j)·K + k].
  void fill(const Vec3& origin, double spacing, const std::array<int, 3>& size, float* g);

  // Normals drawn so far.
  std::uint64_t normals() const { return noise_.drawn() + spectral_normals_; }
  // For plans: what it is made of and how Gaussian it is.
  std::string describe() const;
  double correlation_error() const { return kLatticeError + varying_error_; }

  // A part under a field of length scales.
  struct Varying {
    VaryingLattice lattice;
    double scale;
  };

 private:
  static constexpr double kLatticeError = 3e-7;  // formulas C11

  int lattices() const;
  FieldSample free_sample(const Vec3& x);
  void add_lattices(const Vec3& x, FieldSample& g);
  // What the conditions add (Matheron's rule): Σ weight · cov(g, condition), the weights solved in
  // every block from what the conditions say less what the free sample has there.
  void add_conditions(const Vec3& x, FieldSample& g);
  const std::vector<double>& weights(int block);

  PosteriorPtr posterior_;
  std::vector<std::vector<double>> weights_;  // of blocks; empty: not solved yet
  bool near_ = false;                         // conditions are near the line
  double varying_error_ = 0;                  // of the correlation, by what its mixtures leave out
  std::vector<Varying> varying_;
  std::vector<LatticeField> lattices_;
  std::vector<SpectralField> spectra_;
  LatticeNoise noise_;
  SmoothedNoise smoothed_;  // of the lattices in varying_
  std::uint64_t seed_ = 0, spectral_normals_ = 0;
  std::optional<double> time_;
  bool drawn_ = false;
  Vec3 origin_, direction_;
};

}  // namespace gpis

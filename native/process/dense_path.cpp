#include "process/dense_path.h"

#include <Eigen/Eigenvalues>
#include <cmath>
#include <mutex>
#include <stdexcept>

#include "field/check.h"
#include "process/march_sampler.h"

namespace gpis {
namespace {

// Covariance of (g, g') at two points q apart, κ = exp(-q²/2): cov(g,g) = κ, cov(g, g') = -∂κ/∂q…
Eigen::Matrix2d block(double q) {
  const double k = std::exp(-0.5 * q * q);
  Eigen::Matrix2d b;  // rows: (g, g') at x, columns at y, q = x - y
  b << k, q * k, -q * k, (1 - q * q) * k;
  return b;
}

}  // namespace

const DensePath::Factor& DensePath::factor(double reach, Counters& counters) {
  static Factor factors[3];
  static std::once_flag once[3];
  int i = 0;
  while (i < 2 && reach > kReaches[i]) ++i;
  std::call_once(once[i], [i, &counters] {
    const int points = static_cast<int>(std::lround(kReaches[i] / kStep)) + 2;
    Eigen::MatrixXd k(2 * points, 2 * points);
    for (int r = 0; r < points; ++r)
      for (int c = 0; c < points; ++c) k.block<2, 2>(2 * r, 2 * c) = block((r - c) * kStep);
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(k);
    if (eigen.info() != Eigen::Success)
      throw std::runtime_error("The dense sampler could not factorise its covariance matrix.");
    const auto& values = eigen.eigenvalues();  // increasing
    const double floor = 1e-14 * values[values.size() - 1];
    int rank = 0;
    while (rank < values.size() && values[values.size() - 1 - rank] > floor) ++rank;
    factors[i] = eigen.eigenvectors().rightCols(rank) * values.tail(rank).cwiseSqrt().asDiagonal();
    ++counters.factorisations;
  });
  return factors[i];
}

DensePath::Plan::Plan(const GaussianProcess& process, const Box3& bounds)
    : line(single_term(process, "The dense sampler")) {
  if (line.radial.family != Radial::Family::squared_exponential)
    refuse("The dense sampler serves the squared exponential, not ", process.kernel->describe(),
           ".");
  const double diagonal = length(bounds.max - bounds.min);
  const double lengths = diagonal / process.kernel->min_length_scale();
  if (!(lengths <= kMaxReach))
    refuse("The dense sampler serves bounds of up to ", kMaxReach,
           " length scales across, these have ", lengths,
           ": give the process smaller bounds or take the convolution sampler.");
}

void DensePath::reset(const Plan& plan, const LineGeometry& line, double anchor, double t_end,
                      Counters& counters) {
  line_.reset(plan.line, line, anchor);
  step_ = kStep / line_.inverse_length();
  factor_ = &factor(line_.q(t_end), counters);
  conditioned_ = drawn_ = false;
}

// By Matheron's rule, as the convolution does.
double DensePath::start(const PathStart& known, Rng& rng, Counters& counters) {
  prepare(0, rng, counters);
  double g, dg;
  point(0, g, dg);
  const double slope = known.slope_known ? known.slope : dg;
  conditioned_ = true;
  delta_value_ = known.value - g;
  delta_slope_ = line_.per_length(slope - dg);
  if (known.gradient_known) line_.remember(known.gradient);
  pull_ = std::max(0.0, -known.value) + 0.61 * std::max(0.0, -line_.per_length(slope));
  return slope;
}

void DensePath::prepare(long, Rng& rng, Counters& counters) {
  if (drawn_) return;
  drawn_ = true;
  modes_.resize(factor_->cols());
  for (auto& m : modes_) m = rng.normal();
  counters.line_normals += modes_.size();
}

void DensePath::point(long k, double& g, double& dg) const {
  g = factor_->row(2 * k).dot(modes_);
  dg = factor_->row(2 * k + 1).dot(modes_);
  if (conditioned_) {
    const double q = k * kStep, c = std::exp(-0.5 * q * q), x = delta_value_ + q * delta_slope_;
    g += c * x;
    dg += c * (delta_slope_ - q * x);
  }
  dg *= line_.inverse_length();
}

void DensePath::at(long cell, double t, Rng&, double& g, double& dg) const {
  double a, da, b, db;
  point(cell, a, da);
  point(cell + 1, b, db);
  // Bernstein form of the cubic through both ends.
  const double s = line_.q(t) / kStep - cell, r = 1 - s;
  const double c1 = a + da * step_ / 3, c2 = b - db * step_ / 3;
  g = r * r * r * a + 3 * r * r * s * c1 + 3 * r * s * s * c2 + s * s * s * b;
  dg = 3 * (r * r * (c1 - a) + 2 * r * s * (c2 - c1) + s * s * (b - c2)) / step_;
}

std::unique_ptr<LineSampler> make_dense(const GaussianProcess& process, const Box3& bounds) {
  return make_sampler<DensePath>(process, bounds);
}

}  // namespace gpis

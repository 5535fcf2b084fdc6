#include "process/dense_path.h"

#include <Eigen/Eigenvalues>
#include <cmath>
#include <mutex>
#include <stdexcept>

namespace gpis {
namespace {

constexpr double kReaches[] = {8, 24, DensePath::kMaxReach};

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

void DensePath::reset(double reach, Counters& counters) {
  if (reach > kMaxReach)
    throw std::invalid_argument(
        "The dense sampler serves lines of up to 64 length scales inside the uncertain region, "
        "this one has " +
        std::to_string(reach) +
        ": take the convolution sampler, a longer length_scale or smaller bounds.");
  factor_ = &factor(reach, counters);
  drawn_ = false;
}

void DensePath::prepare(long, Rng& rng, Counters& counters) {
  if (drawn_) return;
  drawn_ = true;
  modes_.resize(factor_->cols());
  for (auto& m : modes_) m = rng.normal();
  counters.line_normals += modes_.size();
}

void DensePath::at(long cell, double q, double& g, double& dg) const {
  double a, da, b, db;
  point(cell, a, da);
  point(cell + 1, b, db);
  // Bernstein form of the cubic through both ends.
  const double s = q / kStep - cell, r = 1 - s;
  const double c1 = a + da * kStep / 3, c2 = b - db * kStep / 3;
  g = r * r * r * a + 3 * r * r * s * c1 + 3 * r * s * s * c2 + s * s * s * b;
  dg = 3 * (r * r * (c1 - a) + 2 * r * s * (c2 - c1) + s * s * (b - c2)) / kStep;
}

}  // namespace gpis

#include "process/at_points.h"

#include <Eigen/Eigenvalues>

#include "core/rng.h"
#include "process/covariance.h"

namespace gpis {

Eigen::MatrixXd covariance_matrix(const GaussianProcess& process, const std::vector<Vec3>& x,
                                  const std::vector<Vec3>& y) {
  const Covariance covariance(process);
  std::vector<LocalPoint> at_y;
  std::vector<double> sigma_y;
  for (const Vec3& p : y) {
    at_y.push_back(covariance.at(p));
    sigma_y.push_back(process.sigma->value(p));
  }
  Eigen::MatrixXd k(x.size(), y.size());
  for (std::size_t i = 0; i < x.size(); ++i) {
    const LocalPoint at_x = covariance.at(x[i]);
    const double sigma_x = process.sigma->value(x[i]);
    for (std::size_t j = 0; j < y.size(); ++j)
      k(i, j) = sigma_x * sigma_y[j] * covariance.value(at_x, at_y[j]);
  }
  return k;
}

Eigen::MatrixXd sample_at(const GaussianProcess& process, const std::vector<Vec3>& x,
                          Eigen::Index rows, std::uint64_t seed) {
  Eigen::MatrixXd out(rows, x.size());
  if (x.empty()) return out;  // Eigen's solver takes no empty matrix
  // Eigenvectors, not Cholesky: the matrix is singular to rounding wherever points are near
  // (math.md §5, traps).
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(covariance_matrix(process, x, x));
  const Eigen::MatrixXd factor =
      eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal();
  Eigen::VectorXd mean(x.size()), xi(x.size());
  for (std::size_t i = 0; i < x.size(); ++i) mean[i] = process.mean->value(x[i]);
  for (Eigen::Index row = 0; row < rows; ++row) {
    Rng rng(seed, static_cast<std::uint64_t>(row));
    for (auto& v : xi) v = rng.normal();
    out.row(row) = mean + factor * xi;
  }
  return out;
}

}  // namespace gpis

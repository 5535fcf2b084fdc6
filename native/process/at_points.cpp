#include "process/at_points.h"

#include <tbb/parallel_for.h>

#include "core/rng.h"
#include "core/symmetric_eigen.h"
#include "field/check.h"
#include "process/posterior.h"

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

std::vector<PointLaw> posterior_at(const GaussianProcess& process, const std::vector<Vec3>& x) {
  const PosteriorPtr posterior = posterior_of(process);
  const Covariance covariance(process);
  std::vector<PointLaw> out(x.size());
  tbb::parallel_for(std::size_t{0}, x.size(), [&](std::size_t i) {
    const double sigma = process.sigma->value(x[i]);
    Eigen::Vector4d mean = Eigen::Vector4d::Zero();
    Eigen::Matrix4d law;
    law(0, 0) = covariance.variance();
    if (posterior && posterior->conditions().near({x[i], {}}, 0, 0))
      posterior->law(covariance.at(x[i]), mean, law);
    out[i] = {process.mean->value(x[i]) + sigma * mean[0],
              sigma * sigma * std::max(0.0, law(0, 0))};
  });
  return out;
}

namespace {

// All conditions near any of the points, solved together.
JointRows conditions_near(const Posterior& posterior, const std::vector<Vec3>& x) {
  constexpr int kMostRows = 3000;
  const ConditionRows& conditions = posterior.conditions();
  JointRows rows;
  rows.reset(posterior.covariance());
  Counters counters;
  for (int p = 0; p < conditions.points(); ++p) {
    const auto close = [&](const Vec3& at) {
      return conditions.distance(conditions.point(p), at) <= 1;
    };
    const bool near = static_cast<int>(conditions.rows().size()) <= kMostRows ||
                      std::any_of(x.begin(), x.end(), close);
    for (int r = conditions.first_row(p); near && r < conditions.last_row(p); ++r) {
      const ConditionRows::Row& row = conditions.rows()[r];
      rows.add_known(row.at, row.what, row.value, row.noise, counters);
    }
    if (rows.count() > kMostRows)
      refuse("sample draws jointly with up to ", kMostRows,
             " values and slopes of conditions near the points: ask for fewer points, or for a "
             "realisation.");
  }
  return rows;
}

}  // namespace

Eigen::MatrixXd sample_at(const GaussianProcess& process, const std::vector<Vec3>& x,
                          Eigen::Index rows, std::uint64_t seed) {
  Eigen::MatrixXd out(rows, x.size());
  if (x.empty()) return out;  // Eigen's solver takes no empty matrix
  // Eigenvectors, not Cholesky: the matrix is singular to rounding wherever points are near
  // (math.md §5, traps).
  Eigen::MatrixXd covariance = covariance_matrix(process, x, x);
  Eigen::VectorXd mean(x.size()), xi(x.size());
  for (std::size_t i = 0; i < x.size(); ++i) mean[i] = process.mean->value(x[i]);
  if (const PosteriorPtr posterior = posterior_of(process)) {
    const JointRows rows = conditions_near(*posterior, x);
    Eigen::MatrixXd whitened(rows.count(), x.size());
    for (std::size_t i = 0; i < x.size(); ++i)
      whitened.col(i) = process.sigma->value(x[i]) *
                        rows.whitened(posterior->covariance().at(x[i]), Functional{});
    mean += whitened.transpose() * rows.whitened();
    covariance -= whitened.transpose() * whitened;
  }
  const SymmetricEigen eigen(covariance);
  const Eigen::MatrixXd factor = eigen.vectors * eigen.values.cwiseMax(0).cwiseSqrt().asDiagonal();
  for (Eigen::Index row = 0; row < rows; ++row) {
    Rng rng(seed, static_cast<std::uint64_t>(row));
    for (auto& v : xi) v = rng.normal();
    out.row(row) = mean + factor * xi;
  }
  return out;
}

}  // namespace gpis

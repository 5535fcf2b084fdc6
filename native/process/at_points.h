// The process at given points: exact, for as many points as a dense matrix takes.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "process/gaussian_process.h"

namespace gpis {

// Covariance of f between points x (rows) and y.
Eigen::MatrixXd covariance_matrix(const GaussianProcess& process, const std::vector<Vec3>& x,
                                  const std::vector<Vec3>& y);

// Of f given the conditions, solved in blocks (posterior.h).
struct PointLaw {
  double mean, variance;
};
std::vector<PointLaw> posterior_at(const GaussianProcess& process, const std::vector<Vec3>& x);

// Joint samples of f at the points x given the conditions, one a row; row i uses the random stream
// (seed, i). Throws where too many conditions are near.
Eigen::MatrixXd sample_at(const GaussianProcess& process, const std::vector<Vec3>& x,
                          Eigen::Index rows, std::uint64_t seed);

}  // namespace gpis

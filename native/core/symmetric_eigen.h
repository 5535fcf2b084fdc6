// Eigen's solver, which takes long to compile, in one file.
#pragma once

#include <Eigen/Core>
#include <array>

#include "core/sym_mat3.h"

namespace gpis {

// matrix = vectors diag(values) vectorsᵀ, values in increasing order. Throws std::runtime_error
// where the iteration does not end (a value that is not finite).
struct SymmetricEigen {
  Eigen::VectorXd values;
  Eigen::MatrixXd vectors;

  explicit SymmetricEigen(const Eigen::MatrixXd& matrix);
};

struct SymmetricEigen3 {
  std::array<double, 3> values;  // increasing
  std::array<Vec3, 3> vectors;   // of length 1

  explicit SymmetricEigen3(const SymMat3& matrix);
};

std::array<double, 3> eigenvalues_of(const SymMat3& matrix);  // increasing

// Of a positive semidefinite matrix: eigenvalues below 1e-13 of the largest are zero.
Mat3 pseudo_inverse(const Mat3& symmetric);

}  // namespace gpis

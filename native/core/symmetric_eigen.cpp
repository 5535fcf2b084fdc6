#include "core/symmetric_eigen.h"

#include <Eigen/Eigenvalues>
#include <stdexcept>

namespace gpis {
namespace {

Eigen::Matrix3d eigen_matrix(const SymMat3& a) {
  Eigen::Matrix3d m;
  m << a.xx, a.xy, a.xz, a.xy, a.yy, a.yz, a.xz, a.yz, a.zz;
  return m;
}

}  // namespace

SymmetricEigen::SymmetricEigen(const Eigen::MatrixXd& matrix) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(matrix);
  if (eigen.info() != Eigen::Success)
    throw std::runtime_error("The eigenvalues of a covariance matrix could not be found.");
  values = eigen.eigenvalues();
  vectors = eigen.eigenvectors();
}

SymmetricEigen3::SymmetricEigen3(const SymMat3& matrix) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(eigen_matrix(matrix));
  for (int k = 0; k < 3; ++k) {
    values[k] = eigen.eigenvalues()[k];
    const Eigen::Vector3d v = eigen.eigenvectors().col(k);
    vectors[k] = {v[0], v[1], v[2]};
  }
}

std::array<double, 3> eigenvalues_of(const SymMat3& matrix) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(eigen_matrix(matrix),
                                                             Eigen::EigenvaluesOnly);
  return {eigen.eigenvalues()[0], eigen.eigenvalues()[1], eigen.eigenvalues()[2]};
}

Mat3 pseudo_inverse(const Mat3& symmetric) {
  const SymmetricEigen3 eigen(SymMat3::of(symmetric));
  Mat3 out = Mat3{} * 0;
  for (int k = 0; k < 3; ++k)
    if (eigen.values[k] > 1e-13 * eigen.values[2])
      out = out + outer(eigen.vectors[k], eigen.vectors[k]) * (1 / eigen.values[k]);
  return out;
}

}  // namespace gpis

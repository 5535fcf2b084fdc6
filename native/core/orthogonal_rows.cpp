#include "core/orthogonal_rows.h"

#include <Eigen/SVD>

namespace gpis {

Mat3 orthogonal_rows(const Mat3& a, const Mat3& b) {
  Eigen::Matrix<double, 6, 3> both;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      both(i, j) = a.row[i][j];
      both(i + 3, j) = b.row[i][j];
    }
  const Eigen::JacobiSVD<Eigen::Matrix<double, 6, 3>> svd(both, Eigen::ComputeFullV);
  const Eigen::Vector3d& s = svd.singularValues();
  Mat3 out;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      out.row[i][j] = s[i] > 1e-14 * s[0] ? s[i] * svd.matrixV()(j, i) : 0;
  return out;
}

}  // namespace gpis

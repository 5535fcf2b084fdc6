#include "field/check.h"

#include <Eigen/Dense>

namespace gpis {

Range check_transform(const Affine& matrix) {
  Eigen::Matrix3d m;
  for (int i = 0; i < 3; ++i) {
    check_finite("transformed: a row of the matrix", matrix.linear.row[i]);
    for (int j = 0; j < 3; ++j) m(i, j) = matrix.linear.row[i][j];
  }
  check_finite("transformed: the translation", matrix.translation);
  const Eigen::Vector3d stretch = m.jacobiSvd().singularValues();
  if (!(stretch[2] > 1e-12 * stretch[0]))
    refuse("transformed: the matrix stretches by ", stretch[0], " at most and ", stretch[2],
           " at least; it must not flatten space.");
  return {stretch[2], stretch[0]};
}

}  // namespace gpis

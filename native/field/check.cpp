#include "field/check.h"

#include "core/orthogonal_rows.h"

namespace gpis {

Range check_transform(const Affine& matrix) {
  for (const Vec3& row : matrix.linear.row) check_finite("transformed: a row of the matrix", row);
  check_finite("transformed: the translation", matrix.translation);
  const Mat3 stretched = orthogonal_rows(matrix.linear);
  const double most = length(stretched.row[0]), least = length(stretched.row[2]);
  if (!(least > 1e-12 * most))
    refuse("transformed: the matrix stretches by ", most, " at most and ", least,
           " at least; it must not flatten space.");
  return {least, most};
}

}  // namespace gpis

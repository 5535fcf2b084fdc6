#include "field/transformed_field.h"

#include <Eigen/Dense>

#include "field/check.h"
#include "field/grid_field.h"

namespace gpis {
namespace {

// True if every axis goes to an axis.
bool keeps_axes(const Mat3& m) {
  int entries = 0;
  for (const Vec3& row : m.row)
    for (int i = 0; i < 3; ++i) entries += row[i] != 0;
  return entries == 3;
}

}  // namespace

TransformedField::TransformedField(FieldPtr field, const Affine& matrix)
    : field_(std::move(field)) {
  Eigen::Matrix3d m;
  for (int i = 0; i < 3; ++i) {
    check_finite("transformed: a row of the matrix", matrix.linear.row[i]);
    for (int j = 0; j < 3; ++j) m(i, j) = matrix.linear.row[i][j];
  }
  check_finite("transformed: the translation", matrix.translation);
  const Eigen::Vector3d stretch = m.jacobiSvd().singularValues();
  const double least = stretch[2];
  if (!(least > 1e-12 * stretch[0]))
    refuse("transformed: the matrix stretches by ", stretch[0], " at most and ", least,
           " at least; it must not flatten space.");
  inverse_ = inverse(matrix);
  gradient_map_ = transpose(inverse_.linear);

  const auto grid = std::dynamic_pointer_cast<const GridField>(field_);
  if (grid && !keeps_axes(matrix.linear)) field_ = grid->without_background();
  lipschitz_ = field_->lipschitz() / least;
  smooth_scale_ = field_->smooth_scale() * least;
  if (const auto box = field_->support()) {
    support_.emplace();
    for (int corner = 0; corner < 8; ++corner) {
      const Vec3 p{corner & 1 ? box->max.x : box->min.x, corner & 2 ? box->max.y : box->min.y,
                   corner & 4 ? box->max.z : box->min.z};
      support_->include(matrix.point(p));
    }
  }
}

}  // namespace gpis

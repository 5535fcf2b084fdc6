#include "field/transformed_field.h"

#include <algorithm>
#include <cmath>

#include "core/box_image.h"
#include "field/check.h"
#include "field/constant_field.h"
#include "field/grid_field.h"

namespace gpis {
namespace {

// What is no part of what products of rotations leave of zeros: a few ulp of what else stands in
// the row and in the column.
bool counts(const Mat3& m, int i, int j) {
  double row = 0, column = 0;
  for (int k = 0; k < 3; ++k) {
    row = std::max(row, std::abs(m.row[i][k]));
    column = std::max(column, std::abs(m.row[k][j]));
  }
  return std::abs(m.row[i][j]) > 1e-15 * std::min(row, column);
}

// True if every axis goes to an axis.
bool keeps_axes(const Mat3& m) {
  int entries = 0;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) entries += counts(m, i, j);
  return entries == 3;
}

// To itself, in its own direction.
bool stretches_axes(const Mat3& m) {
  for (int i = 0; i < 3; ++i)
    if (!(counts(m, i, i) && m.row[i][i] > 0)) return false;
  return keeps_axes(m);
}

}  // namespace

TransformedField::TransformedField(FieldPtr field, const Affine& matrix)
    : field_(std::move(field)) {
  const double least = check_transform(matrix).min;
  inverse_ = inverse(matrix);
  gradient_map_ = transpose(inverse_.linear);

  const auto grid = std::dynamic_pointer_cast<const GridField>(field_);
  if (grid && !keeps_axes(matrix.linear)) field_ = grid->without_background();
  lipschitz_ = field_->lipschitz() / least;
  smooth_scale_ = field_->smooth_scale() * least;
  if (const auto box = field_->support()) support_ = image_of(*box, matrix);
}

FieldPtr transformed(FieldPtr field, const Affine& matrix) {
  check_transform(matrix);
  if (dynamic_cast<const ConstantField*>(field.get())) return field;
  const Mat3& m = matrix.linear;
  if (const auto* grid = dynamic_cast<const GridField*>(field.get()); grid && stretches_axes(m))
    return grid->moved({m.row[0].x, m.row[1].y, m.row[2].z}, matrix.translation);
  return std::make_shared<TransformedField>(std::move(field), matrix);
}

}  // namespace gpis

#include "field/transformed_field.h"

#include "core/box_image.h"
#include "field/check.h"
#include "field/constant_field.h"
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

bool stretches_axes(const Mat3& m) {
  return keeps_axes(m) && m.row[0].x > 0 && m.row[1].y > 0 && m.row[2].z > 0;
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

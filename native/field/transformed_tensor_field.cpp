#include "field/transformed_tensor_field.h"

#include "core/box_image.h"
#include "field/check.h"

namespace gpis {

TransformedTensorField::TransformedTensorField(TensorFieldPtr field, const Affine& matrix)
    : field_(std::move(field)), linear_(matrix.linear) {
  stretch_ = check_transform(matrix);
  inverse_ = inverse(matrix);
  for (const Vec3& place : field_->extremes()) extremes_.push_back(matrix.point(place));
}

Range TransformedTensorField::eigenvalues(const Box3& box) const {
  return stretched(field_->eigenvalues(image_of(box, inverse_)));
}

TensorSample TransformedTensorField::sample(const Vec3& p) const {
  const TensorSample inner = field_->sample(inverse_.point(p));
  TensorSample out;
  out.value = congruence(linear_, inner.value);
  for (int i = 0; i < 3; ++i) {
    SymMat3 sum;  // ∂/∂x_i = Σ_j ∂y_j/∂x_i ∂/∂y_j
    for (int j = 0; j < 3; ++j) sum = sum + inner.gradient[j] * inverse_.linear.row[j][i];
    out.gradient[i] = congruence(linear_, sum);
  }
  return out;
}

}  // namespace gpis

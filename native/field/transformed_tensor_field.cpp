#include "field/transformed_tensor_field.h"

#include "field/check.h"

namespace gpis {

TransformedTensorField::TransformedTensorField(TensorFieldPtr field, const Affine& matrix)
    : field_(std::move(field)), linear_(matrix.linear) {
  const Range stretch = check_transform(matrix);
  inverse_ = inverse(matrix);
  const Range of_field = field_->eigenvalues();
  eigenvalues_ = {of_field.min * stretch.min * stretch.min,
                  of_field.max * stretch.max * stretch.max};
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

// A tensor field moved by an affine map M: at x it is M A(M⁻¹x) Mᵀ, the squared length scales of
// the same process moved (definitions B12).
#pragma once

#include "field/tensor_field.h"

namespace gpis {

class TransformedTensorField final : public TensorField {
 public:
  // Refuses a singular matrix.
  TransformedTensorField(TensorFieldPtr field, const Affine& matrix);

  SymMat3 value(const Vec3& p) const override {
    return congruence(linear_, field_->value(inverse_.point(p)));
  }
  TensorSample sample(const Vec3& p) const override;
  Range eigenvalues() const override { return eigenvalues_; }
  // J becomes M J Mᵀ as A does: A⁻¹J keeps its eigenvalues.
  Kinks kinks(const Vec3& d) const override { return field_->kinks(inverse_.vector(d)); }

 private:
  TensorFieldPtr field_;
  Mat3 linear_;
  Affine inverse_;
  Range eigenvalues_;
};

}  // namespace gpis

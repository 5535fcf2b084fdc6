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
  TensorSlope along(const Vec3& o, const Vec3& d, double t, double side) const override {
    const TensorSlope inner = field_->along(inverse_.point(o), inverse_.vector(d), t, side);
    return {congruence(linear_, inner.value), congruence(linear_, inner.slope)};
  }
  Range eigenvalues() const override { return stretched(field_->eigenvalues()); }
  Range eigenvalues(const Box3& box) const override;
  std::optional<SymMat3> constant() const override {
    const std::optional<SymMat3> a = field_->constant();
    return a ? std::optional(congruence(linear_, *a)) : std::nullopt;
  }
  std::vector<Vec3> extremes() const override { return extremes_; }
  // J becomes M J Mᵀ as A does: A⁻¹J keeps its eigenvalues.
  double kinks(const Vec3& o, const Vec3& d, double t_begin, double t_end) const override {
    return field_->kinks(inverse_.point(o), inverse_.vector(d), t_begin, t_end);
  }

 private:
  // Of M A Mᵀ, from those of A.
  Range stretched(const Range& r) const {
    return {r.min * stretch_.min * stretch_.min, r.max * stretch_.max * stretch_.max};
  }

  TensorFieldPtr field_;
  Mat3 linear_;
  Affine inverse_;
  Range stretch_;
  std::vector<Vec3> extremes_;
};

}  // namespace gpis

// Fields of symmetric positive definite matrices: squared length scales A(x) (math.md §2). Points
// are in the field's own (object) space.
#pragma once

#include <array>
#include <memory>

#include "core/sym_mat3.h"
#include "field/field.h"

namespace gpis {

struct TensorSample {
  SymMat3 value;
  std::array<SymMat3, 3> gradient;  // ∂A/∂x_i, exact for the interpolant
};

class TensorField {
 public:
  virtual ~TensorField() = default;
  virtual SymMat3 value(const Vec3& p) const = 0;
  virtual TensorSample sample(const Vec3& p) const = 0;
  // Certified bounds of the eigenvalues over all space.
  virtual Range eigenvalues() const = 0;
  // Along a line of direction d, ∂_d A may jump (at the faces of cells). A bound of the sum of
  // √(⅛ tr((A⁻¹ J)²)) over the jumps J on a stretch of length h: rate · h + once. A process with
  // the covariance of Paciorek and Schervish has slopes that jump with these deviations.
  struct Kinks {
    double once = 0, rate = 0;
  };
  virtual Kinks kinks(const Vec3& d) const = 0;
};
using TensorFieldPtr = std::shared_ptr<const TensorField>;

}  // namespace gpis

// Fields of symmetric positive definite matrices: squared length scales A(x) (math.md §2). Points
// are in the field's own (object) space.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <vector>

#include "core/sym_mat3.h"
#include "field/field.h"

namespace gpis {

struct TensorSample {
  SymMat3 value;
  std::array<SymMat3, 3> gradient;  // ∂A/∂x_i, exact for the interpolant
};

// On a line: A and ∂_d A.
struct TensorSlope {
  SymMat3 value, slope;
};

class TensorField {
 public:
  virtual ~TensorField() = default;
  virtual SymMat3 value(const Vec3& p) const = 0;
  virtual TensorSample sample(const Vec3& p) const = 0;
  // At o + t d, with the derivative that holds at o + side d, where t lies at the end of a piece
  // that `side` lies in.
  virtual TensorSlope along(const Vec3& o, const Vec3& d, double t, double side) const = 0;
  // Certified bounds of the eigenvalues over all space, and over a box (looked up: not for hot
  // loops).
  virtual Range eigenvalues() const = 0;
  virtual Range eigenvalues(const Box3& box) const = 0;
  // The matrix that the field is everywhere, where it is known to be one.
  virtual std::optional<SymMat3> constant() const { return std::nullopt; }
  // Places where lengths are shortest and where they change most, where any are known.
  virtual std::vector<Vec3> extremes() const { return {}; }
  // On the line o + t d, ∂_d A may jump (at the faces of cells). A bound of the sum of
  // √(⅛ tr((A⁻¹ J)²)) over the jumps J between two t. A process with the covariance of Paciorek and
  // Schervish has slopes that jump with these deviations.
  virtual double kinks(const Vec3& o, const Vec3& d, double t_begin, double t_end) const = 0;
};
using TensorFieldPtr = std::shared_ptr<const TensorField>;

}  // namespace gpis

// Scalar fields over space: means, deviations and textures. Points are in the field's own (object)
// space.
#pragma once

#include <memory>
#include <optional>

#include "core/vec.h"

namespace gpis {

struct FieldSample {
  double value = 0;
  Vec3 gradient;  // exact gradient of the interpolant
};

struct Range {
  double min = -kInfinity, max = kInfinity;
};

// A field restricted to the ray o + t d, smooth on pieces. A march visits the pieces in order:
// `enter` selects the piece that holds (a, b); `evaluate` is then one-sided at its ends, so value
// and derivative belong to ONE smooth function on the closed piece (definitions E8: the gradient
// must be that of the same interpolant, on the arriving side).
class FieldLine {
 public:
  virtual ~FieldLine() = default;
  // The first t' > t where the derivative may jump (a cell face); infinity if there is none.
  virtual double next_break(double t) const = 0;
  virtual void enter(double a, double b) = 0;
  // Value and derivative along the ray, by the piece selected last.
  virtual void evaluate(double t, double& value, double& derivative) const = 0;
  // A certified t' >= t such that the field exceeds `threshold` on (t, t'); t itself if nothing can
  // be said.
  virtual double above_until(double t, double t_end, double threshold) const = 0;
  // Value and full gradient at t, by the piece selected last.
  virtual FieldSample sample(double t) const = 0;
};

class Field {
 public:
  virtual ~Field() = default;
  virtual double value(const Vec3& p) const = 0;
  virtual FieldSample sample(const Vec3& p) const = 0;
  // Certified bounds of the value over all space (conservative, infinite if unbounded).
  virtual Range range() const = 0;
  // An upper bound of |gradient|; infinity if none is known.
  virtual double lipschitz() const = 0;
  // The length below which the field is smooth enough for cubic interpolation between two points
  // (radius of a sphere, …); infinity where every smooth piece is at most cubic along a line
  // (constant, plane, trilinear cell).
  virtual double smooth_scale() const = 0;
  // The region outside of which the field is constant (a grid's nodes); nothing for analytic
  // fields.
  virtual std::optional<Box3> support() const { return std::nullopt; }
  virtual std::unique_ptr<FieldLine> line(const Vec3& o, const Vec3& d) const = 0;
};
using FieldPtr = std::shared_ptr<const Field>;

}  // namespace gpis

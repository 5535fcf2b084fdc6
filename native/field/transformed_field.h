// A field moved by an affine map: its value at x is that of the field at matrix⁻¹ x, not rescaled.
#pragma once

#include "field/field.h"

namespace gpis {

class TransformedField final : public Field {
 public:
  // Refuses a singular matrix. A grid that the matrix does not keep along the axes is continued by
  // its nearest value: its own box is then no longer support(), and a jump to the background inside
  // support() would be a surface of its own.
  TransformedField(FieldPtr field, const Affine& matrix);

  const Field& field() const { return *field_; }
  const Affine& to_field() const { return inverse_; }
  double value(const Vec3& p) const override { return field_->value(inverse_.point(p)); }
  FieldSample sample(const Vec3& p) const override {
    return pull_back(field_->sample(inverse_.point(p)));
  }
  Range range() const override { return field_->range(); }
  double lipschitz() const override { return lipschitz_; }
  double smooth_scale() const override { return smooth_scale_; }
  std::optional<Box3> support() const override { return support_; }
  std::unique_ptr<FieldLine> line(const Vec3& o, const Vec3& d) const override {
    return std::make_unique<Line>(*this, o, d);
  }

  // The ray in the space of the field: t stays the same.
  class Line final : public FieldLine {
   public:
    Line(const TransformedField& field, const Vec3& o, const Vec3& d)
        : field_(&field),
          line_(field.field_->line(field.inverse_.point(o), field.inverse_.vector(d))) {}

    double next_break(double t) const override { return line_->next_break(t); }
    void enter(double a, double b) override { line_->enter(a, b); }
    void evaluate(double t, double& value, double& derivative) const override {
      line_->evaluate(t, value, derivative);
    }
    double above_until(double t, double t_end, double threshold) const override {
      return line_->above_until(t, t_end, threshold);
    }
    FieldSample sample(double t) const override { return field_->pull_back(line_->sample(t)); }

   private:
    const TransformedField* field_;
    std::unique_ptr<FieldLine> line_;
  };

 private:
  FieldSample pull_back(const FieldSample& s) const {
    return {s.value, gradient_map_ * s.gradient};
  }

  FieldPtr field_;
  Affine inverse_;
  Mat3 gradient_map_;  // inverse transposed
  double lipschitz_, smooth_scale_;
  std::optional<Box3> support_;
};

// A field moved by an affine map, as the simplest field that is that: constants stay what they are,
// grids that are moved and stretched along their axes are grids, whose lines marches know.
FieldPtr transformed(FieldPtr field, const Affine& matrix);

}  // namespace gpis

// A field times a number.
#pragma once

#include "field/above.h"
#include "field/check.h"
#include "field/constant_field.h"
#include "field/grid_field.h"

namespace gpis {

class ScaledField final : public Field {
 public:
  ScaledField(FieldPtr field, double factor) : field_(std::move(field)), factor_(factor) {
    check_finite("Field * number: the number", factor);
  }

  double value(const Vec3& p) const override { return factor_ * field_->value(p); }
  FieldSample sample(const Vec3& p) const override { return scale(field_->sample(p)); }
  Range range() const override {
    if (factor_ == 0) return {0, 0};  // not 0·inf
    const Range r = field_->range();
    return factor_ > 0 ? Range{factor_ * r.min, factor_ * r.max}
                       : Range{factor_ * r.max, factor_ * r.min};
  }
  double lipschitz() const override {
    return factor_ == 0 ? 0.0 : std::abs(factor_) * field_->lipschitz();
  }
  double smooth_scale() const override { return field_->smooth_scale(); }
  std::optional<Box3> support() const override { return field_->support(); }
  std::unique_ptr<FieldLine> line(const Vec3& o, const Vec3& d) const override {
    return std::make_unique<Line>(*this, o, d);
  }

  class Line final : public FieldLine {
   public:
    Line(const ScaledField& field, const Vec3& o, const Vec3& d)
        : field_(&field), origin_(o), direction_(d), line_(field.field_->line(o, d)) {}

    double next_break(double t) const override { return line_->next_break(t); }
    void enter(double a, double b) override { line_->enter(a, b); }
    void evaluate(double t, double& value, double& derivative) const override {
      line_->evaluate(t, value, derivative);
      value *= field_->factor_;
      derivative *= field_->factor_;
    }
    // A negative factor asks where the field is below something, which lines do not say: range and
    // Lipschitz bound do.
    double above_until(double t, double t_end, double threshold) const override {
      if (field_->range().min > threshold) return t_end;
      if (field_->factor_ > 0) return line_->above_until(t, t_end, threshold / field_->factor_);
      const auto value = [&](double s) { return field_->value(origin_ + direction_ * s); };
      return above_by_lipschitz(value, field_->lipschitz() * length(direction_), t, t_end,
                                threshold);
    }
    FieldSample sample(double t) const override { return field_->scale(line_->sample(t)); }

   private:
    const ScaledField* field_;
    Vec3 origin_, direction_;
    std::unique_ptr<FieldLine> line_;
  };

 private:
  FieldSample scale(const FieldSample& s) const {
    return {factor_ * s.value, s.gradient * factor_};
  }

  FieldPtr field_;
  double factor_;
};

// A field times a number, as the simplest field that is that: lines of constants and grids keep
// their own type and bounds.
inline FieldPtr scaled(FieldPtr field, double factor) {
  check_finite("Field * number: the number", factor);
  if (const auto* constant = dynamic_cast<const ConstantField*>(field.get()))
    return std::make_shared<ConstantField>(factor * constant->value({}));
  if (const auto* grid = dynamic_cast<const GridField*>(field.get()); grid && factor != 0)
    return grid->scaled(factor);
  return std::make_shared<ScaledField>(std::move(field), factor);
}

}  // namespace gpis

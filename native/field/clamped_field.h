// A field kept between two values.
#pragma once

#include "field/check.h"
#include "field/field.h"

namespace gpis {

class ClampedField final : public Field {
 public:
  ClampedField(FieldPtr field, double low, double high)
      : field_(std::move(field)), low_(low), high_(high) {
    if (!(low <= high))
      refuse("clamped: low is ", low, " and high is ", high, "; low must not exceed high.");
  }

  double value(const Vec3& p) const override { return clamp(field_->value(p)); }
  FieldSample sample(const Vec3& p) const override {
    const FieldSample s = field_->sample(p);
    return s.value > low_ && s.value < high_ ? s : FieldSample{clamp(s.value), {}};
  }
  Range range() const override {
    const Range r = field_->range();
    return {clamp(r.min), clamp(r.max)};
  }
  double lipschitz() const override { return field_->lipschitz(); }
  double smooth_scale() const override { return field_->smooth_scale(); }
  std::optional<Box3> support() const override { return field_->support(); }

  class Line;
  std::unique_ptr<FieldLine> line(const Vec3& o, const Vec3& d) const override;

 private:
  double clamp(double v) const { return std::clamp(v, low_, high_); }

  FieldPtr field_;
  double low_, high_;
};

// A piece of the ray is low, high, or the field itself.
class ClampedField::Line final : public FieldLine {
 public:
  Line(const ClampedField& field, const Vec3& o, const Vec3& d);

  // Breaks of the field, and where it crosses low or high.
  double next_break(double t) const override;
  void enter(double a, double b) override;
  void evaluate(double t, double& value, double& derivative) const override {
    if (level_) {
      value = *level_;
      derivative = 0;
    } else {
      line_->evaluate(t, value, derivative);
    }
  }
  double above_until(double t, double t_end, double threshold) const override {
    if (threshold < field_->low_) return t_end;
    return threshold < field_->high_ ? line_->above_until(t, t_end, threshold) : t;
  }
  FieldSample sample(double t) const override {
    return level_ ? FieldSample{*level_, {}} : line_->sample(t);
  }

 private:
  const ClampedField* field_;
  double speed_;
  std::unique_ptr<FieldLine> line_;
  std::unique_ptr<FieldLine> ahead_;  // looks for crossings while line_ stays in its piece
  std::optional<double> level_;
};

}  // namespace gpis

// Signed distance from a torus about an axis.
#pragma once

#include "field/above.h"
#include "field/check.h"
#include "field/field.h"

namespace gpis {

class TorusField final : public Field {
 public:
  // major_radius: from the centre to the middle of the tube; minor_radius: of the tube.
  TorusField(const Vec3& center, const Vec3& axis, double major_radius, double minor_radius)
      : center_(center), axis_(normalize(axis)), major_(major_radius), minor_(minor_radius) {
    check_finite("TorusField: center", center);
    check_direction("TorusField: axis", axis);
    check_positive("TorusField: minor_radius", minor_radius);
    if (!(std::isfinite(major_) && major_ > minor_))
      refuse("TorusField: major_radius is ", major_, " and minor_radius ", minor_,
             "; major_radius must be the greater one.");
  }

  double value(const Vec3& p) const override { return sample(p).value; }
  FieldSample sample(const Vec3& p) const override {
    const Vec3 q = p - center_;
    const double height = dot(q, axis_);
    const Vec3 across = q - axis_ * height;
    const double from_axis = length(across), ring = from_axis - major_;
    const double distance = std::hypot(ring, height);
    Vec3 gradient = axis_;  // on the middle of the tube, where there is none
    if (distance > 0) {
      gradient = axis_ * (height / distance);
      if (from_axis > 0) gradient += across * (ring / (distance * from_axis));
    }
    return {distance - minor_, gradient};
  }
  Range range() const override { return {-minor_, kInfinity}; }
  double lipschitz() const override { return 1; }
  double smooth_scale() const override { return std::min(minor_, major_ - minor_) / 4; }

  class Line final : public FieldLine {
   public:
    Line(const TorusField& field, const Vec3& o, const Vec3& d)
        : field_(&field), origin_(o), direction_(d) {
      const Vec3 q = o - field.center_;
      const Vec3 across = q - field.axis_ * dot(q, field.axis_);
      const Vec3 speed = d - field.axis_ * dot(d, field.axis_);
      nearest_axis_ = -dot(across, speed) / dot(speed, speed);
      if (!(length(across + speed * nearest_axis_) < field.smooth_scale()))
        nearest_axis_ = -kInfinity;
    }

    // Rays that pass near the axis turn sharply there.
    double next_break(double t) const override {
      return t < nearest_axis_ ? nearest_axis_ : kInfinity;
    }
    // Nothing to select but the side of the axis, for rays that cross it exactly.
    void enter(double a, double b) override {
      middle_ = std::isfinite(b) ? (a + b) / 2 : a + std::max(1.0, std::abs(a));
    }
    void evaluate(double t, double& value, double& derivative) const override {
      const FieldSample s = sample(t);
      value = s.value;
      derivative = dot(s.gradient, direction_);
    }
    double above_until(double t, double t_end, double threshold) const override {
      const auto value = [&](double s) { return field_->value(origin_ + direction_ * s); };
      return above_by_lipschitz(value, length(direction_), t, t_end, threshold);
    }
    FieldSample sample(double t) const override {
      FieldSample s = at(t);
      if (t == nearest_axis_) s.gradient = at(t + (middle_ - t) * 1e-9).gradient;
      return s;
    }

   private:
    FieldSample at(double t) const { return field_->sample(origin_ + direction_ * t); }

    const TorusField* field_;
    Vec3 origin_, direction_;
    double nearest_axis_, middle_ = 0;
  };
  std::unique_ptr<FieldLine> line(const Vec3& o, const Vec3& d) const override {
    return std::make_unique<Line>(*this, o, d);
  }

 private:
  Vec3 center_, axis_;
  double major_, minor_;
};

}  // namespace gpis

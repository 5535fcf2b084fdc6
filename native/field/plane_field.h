// slope · signed distance from a plane, positive on the side its normal points to.
#pragma once

#include "field/check.h"
#include "field/field.h"

namespace gpis {

class PlaneField final : public Field {
 public:
  // The normal need not have unit length.
  PlaneField(const Vec3& point, const Vec3& normal, double slope = 1)
      : point_(point), gradient_(normalize(normal) * slope) {
    check_finite("PlaneField: point", point);
    check_finite("PlaneField: slope", slope);
    check_direction("PlaneField: normal", normal);
  }

  const Vec3& point() const { return point_; }
  const Vec3& gradient() const { return gradient_; }
  double value(const Vec3& p) const override { return dot(gradient_, p - point_); }
  FieldSample sample(const Vec3& p) const override { return {value(p), gradient_}; }
  Range range() const override { return lipschitz() > 0 ? Range{} : Range{0, 0}; }
  double lipschitz() const override { return length(gradient_); }
  double smooth_scale() const override { return kInfinity; }

  class Line final : public FieldLine {
   public:
    Line(const PlaneField& field, const Vec3& o, const Vec3& d)
        : gradient_(field.gradient_), at_origin_(field.value(o)), slope_(dot(gradient_, d)) {}

    double next_break(double) const override { return kInfinity; }
    void enter(double, double) override {}
    void evaluate(double t, double& value, double& derivative) const override {
      value = at_origin_ + slope_ * t;
      derivative = slope_;
    }
    double above_until(double t, double t_end, double threshold) const override {
      if (!(at_origin_ + slope_ * t > threshold)) return t;
      if (slope_ >= 0) return t_end;
      return std::clamp((threshold - at_origin_) / slope_, t, t_end);
    }
    FieldSample sample(double t) const override { return {at_origin_ + slope_ * t, gradient_}; }

   private:
    Vec3 gradient_;
    double at_origin_, slope_;
  };
  std::unique_ptr<FieldLine> line(const Vec3& o, const Vec3& d) const override {
    return std::make_unique<Line>(*this, o, d);
  }

 private:
  Vec3 point_, gradient_;
};

}  // namespace gpis

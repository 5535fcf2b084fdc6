// The same value everywhere.
#pragma once

#include "field/check.h"
#include "field/field.h"

namespace gpis {

class ConstantField final : public Field {
 public:
  explicit ConstantField(double value) : value_(value) {
    check_finite("ConstantField: value", value);
  }

  double value(const Vec3&) const override { return value_; }
  FieldSample sample(const Vec3&) const override { return {value_, {}}; }
  Range range() const override { return {value_, value_}; }
  double lipschitz() const override { return 0; }
  double smooth_scale() const override { return kInfinity; }

  class Line final : public FieldLine {
   public:
    Line(const ConstantField& field, const Vec3&, const Vec3&) : value_(field.value_) {}

    double next_break(double) const override { return kInfinity; }
    void enter(double, double) override {}
    void evaluate(double, double& value, double& derivative) const override {
      value = value_;
      derivative = 0;
    }
    double above_until(double t, double t_end, double threshold) const override {
      return value_ > threshold ? t_end : t;
    }
    FieldSample sample(double) const override { return {value_, {}}; }

   private:
    double value_;
  };
  std::unique_ptr<FieldLine> line(const Vec3& o, const Vec3& d) const override {
    return std::make_unique<Line>(*this, o, d);
  }

 private:
  double value_;
};

}  // namespace gpis

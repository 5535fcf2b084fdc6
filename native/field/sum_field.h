// The sum of two fields.
#pragma once

#include "field/above.h"
#include "field/field.h"

namespace gpis {

class SumField final : public Field {
 public:
  SumField(FieldPtr a, FieldPtr b) : a_(std::move(a)), b_(std::move(b)) {}

  double value(const Vec3& p) const override { return a_->value(p) + b_->value(p); }
  FieldSample sample(const Vec3& p) const override { return add(a_->sample(p), b_->sample(p)); }
  Range range() const override {
    const Range a = a_->range(), b = b_->range();
    return {a.min + b.min, a.max + b.max};
  }
  double lipschitz() const override { return a_->lipschitz() + b_->lipschitz(); }
  double smooth_scale() const override { return std::min(a_->smooth_scale(), b_->smooth_scale()); }
  // Where both are inside theirs.
  std::optional<Box3> support() const override {
    const auto a = a_->support(), b = b_->support();
    if (!a || !b) return a ? a : b;
    Box3 both;
    for (int i = 0; i < 3; ++i) {
      both.min[i] = std::max(a->min[i], b->min[i]);
      both.max[i] = std::min(a->max[i], b->max[i]);
    }
    return both;
  }
  std::unique_ptr<FieldLine> line(const Vec3& o, const Vec3& d) const override {
    return std::make_unique<Line>(*this, o, d);
  }

  class Line final : public FieldLine {
   public:
    Line(const SumField& field, const Vec3& o, const Vec3& d)
        : field_(&field),
          origin_(o),
          direction_(d),
          a_(field.a_->line(o, d)),
          b_(field.b_->line(o, d)) {}

    double next_break(double t) const override {
      return std::min(a_->next_break(t), b_->next_break(t));
    }
    void enter(double a, double b) override {
      a_->enter(a, b);
      b_->enter(a, b);
    }
    void evaluate(double t, double& value, double& derivative) const override {
      double v, d;
      a_->evaluate(t, value, derivative);
      b_->evaluate(t, v, d);
      value += v;
      derivative += d;
    }
    // One of the two by its line, the other by its least value anywhere; or both by their Lipschitz
    // bound.
    double above_until(double t, double t_end, double threshold) const override {
      const auto value = [&](double s) { return field_->value(origin_ + direction_ * s); };
      const double rate = field_->lipschitz() * length(direction_);
      return std::max({a_->above_until(t, t_end, threshold - field_->b_->range().min),
                       b_->above_until(t, t_end, threshold - field_->a_->range().min),
                       above_by_lipschitz(value, rate, t, t_end, threshold)});
    }
    FieldSample sample(double t) const override { return add(a_->sample(t), b_->sample(t)); }

   private:
    const SumField* field_;
    Vec3 origin_, direction_;
    std::unique_ptr<FieldLine> a_, b_;
  };

 private:
  static FieldSample add(const FieldSample& a, const FieldSample& b) {
    return {a.value + b.value, a.gradient + b.gradient};
  }

  FieldPtr a_, b_;
};

}  // namespace gpis

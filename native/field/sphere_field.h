// Signed distance from a sphere.
#pragma once

#include "field/check.h"
#include "field/field.h"

namespace gpis {

class SphereField final : public Field {
 public:
  SphereField(const Vec3& center, double radius) : center_(center), radius_(radius) {
    check_finite("SphereField: center", center);
    check_positive("SphereField: radius", radius);
  }

  const Vec3& center() const { return center_; }
  double radius() const { return radius_; }
  double value(const Vec3& p) const override { return length(p - center_) - radius_; }
  FieldSample sample(const Vec3& p) const override {
    const Vec3 q = p - center_;
    const double r = length(q);
    return {r - radius_, r > 0 ? q / r : Vec3{0, 0, 1}};
  }
  Range range() const override { return {-radius_, kInfinity}; }
  double lipschitz() const override { return 1; }
  // Half the radius: where the curvature 1/|p| along a ray is greater, the ray has a break (Line).
  double smooth_scale() const override { return radius_ / 2; }

  // On a ray the distance is sqrt(miss² + |d|² (t - nearest)²) - radius.
  class Line final : public FieldLine {
   public:
    Line(const SphereField& field, const Vec3& o, const Vec3& d)
        : direction_(d), radius_(field.radius_), speed2_(dot(d, d)) {
      const Vec3 from_center = o - field.center_;
      nearest_ = -dot(from_center, d) / speed2_;
      miss_ = from_center + d * nearest_;
      miss2_ = dot(miss_, miss_);
      has_break_ = miss2_ < radius_ * radius_ / 4;
    }

    // Rays that pass near the centre turn sharply there.
    double next_break(double t) const override {
      return has_break_ && t < nearest_ ? nearest_ : kInfinity;
    }
    void enter(double a, double b) override { after_ = (a + b) / 2 >= nearest_; }
    void evaluate(double t, double& value, double& derivative) const override {
      const double s = t - nearest_, r = std::sqrt(miss2_ + speed2_ * s * s);
      value = r - radius_;
      derivative = r > 0 ? speed2_ * s / r : (after_ ? 1 : -1) * std::sqrt(speed2_);
    }
    double above_until(double t, double t_end, double threshold) const override {
      const double r = radius_ + threshold;
      if (r < 0) return t_end;
      const double s = t - nearest_;
      if (miss2_ + speed2_ * s * s <= r * r) return t;
      if (s >= 0 || miss2_ > r * r) return t_end;
      return std::clamp(nearest_ - std::sqrt((r * r - miss2_) / speed2_), t, t_end);
    }
    FieldSample sample(double t) const override {
      const Vec3 q = miss_ + direction_ * (t - nearest_);
      const double r = length(q);
      if (r > 0) return {r - radius_, q / r};
      return {-radius_, normalize(direction_) * (after_ ? 1 : -1)};
    }

   private:
    Vec3 direction_, miss_;
    double radius_, speed2_, nearest_, miss2_;
    bool has_break_, after_ = false;
  };
  std::unique_ptr<FieldLine> line(const Vec3& o, const Vec3& d) const override {
    return std::make_unique<Line>(*this, o, d);
  }

 private:
  Vec3 center_;
  double radius_;
};

}  // namespace gpis

// Exact signed distance from a box with its sides along the axes.
#pragma once

#include <array>

#include "field/above.h"
#include "field/check.h"
#include "field/field.h"

namespace gpis {

class BoxField final : public Field {
 public:
  // `size`: the three side lengths.
  BoxField(const Vec3& center, const Vec3& size) : center_(center), half_(size / 2) {
    check_finite("BoxField: center", center);
    check_positive("BoxField: size", size);
  }

  const Vec3& center() const { return center_; }
  const Vec3& half() const { return half_; }
  double value(const Vec3& p) const override { return sample(p).value; }
  FieldSample sample(const Vec3& p) const override;
  Range range() const override { return {-smallest_half(), kInfinity}; }
  double lipschitz() const override { return 1; }
  // Near an edge the ray has its own breaks (Line).
  double smooth_scale() const override { return smallest_half(); }

  class Line;
  std::unique_ptr<FieldLine> line(const Vec3& o, const Vec3& d) const override;

 private:
  // One smooth piece of the distance: past a face, an edge or a corner (side: ±1 for the axes that
  // are past a face), or inside, nearest to the face of `axis`.
  struct Piece {
    std::array<int, 3> side{};
    int outside_axes = 0, axis = 0;

    // q: position relative to the centre; v: a direction into the piece, for the gradient on the
    // edge itself.
    FieldSample sample(const Vec3& q, const Vec3& half, const Vec3& v) const;
  };
  Piece piece_at(const Vec3& q) const;
  double smallest_half() const { return std::min({half_.x, half_.y, half_.z}); }

  Vec3 center_, half_;
};

class BoxField::Line final : public FieldLine {
 public:
  Line(const BoxField& field, const Vec3& o, const Vec3& d);

  double next_break(double t) const override;
  void enter(double a, double b) override {
    middle_ = std::isfinite(b) ? (a + b) / 2 : a + std::max(1.0, std::abs(a));
    piece_ = field_->piece_at(at(middle_));
  }
  void evaluate(double t, double& value, double& derivative) const override {
    const FieldSample s = sample(t);
    value = s.value;
    derivative = dot(s.gradient, direction_);
  }
  double above_until(double t, double t_end, double threshold) const override {
    return above_by_lipschitz([&](double s) { return field_->value(field_->center_ + at(s)); },
                              length(direction_), t, t_end, threshold);
  }
  FieldSample sample(double t) const override {
    return piece_.sample(at(t), field_->half_, t < middle_ ? direction_ : -direction_);
  }

 private:
  Vec3 at(double t) const { return start_ + direction_ * t; }

  const BoxField* field_;
  Vec3 start_, direction_;  // relative to the centre
  std::array<double, 21> breaks_;
  int count_ = 0;
  Piece piece_;
  double middle_ = 0;
};

}  // namespace gpis

// Lines of mean and deviation as the march takes them: under their concrete type, so that nothing
// virtual is called per step, or through their virtual line.
#pragma once

#include "field/constant_field.h"
#include "field/grid_field.h"
#include "field/sphere_field.h"

namespace gpis {

// A field's line held by value under its concrete type. `breaks`: whether its derivative may jump
// somewhere.
template <class F, bool breaks>
class DirectLine {
 public:
  static constexpr bool kBreaks = breaks;
  static constexpr int kLookups = std::is_same_v<F, ConstantField> ? 0 : 1;
  DirectLine(const Field& field, const Vec3& o, const Vec3& d)
      : line_(static_cast<const F&>(field), o, d) {}
  double next_break(double t) const { return line_.next_break(t); }
  void enter(double a, double b) { line_.enter(a, b); }
  void evaluate(double t, double& v, double& dv) const { line_.evaluate(t, v, dv); }
  double above_until(double t, double t_end, double threshold) const {
    return line_.above_until(t, t_end, threshold);
  }
  FieldSample sample(double t) const { return line_.sample(t); }
  // Of another grid with the same nodes: where it is on the ray is where this one is.
  bool can_follow(const DirectLine& other) const requires requires(const typename F::Line& l) {
    l.can_follow(l);
  }
  { return line_.can_follow(other.line_); }
  void follow(const DirectLine& other) requires requires(typename F::Line& l) { l.follow(l); }
  { line_.follow(other.line_); }

 private:
  typename F::Line line_;
};
using ConstantLine = DirectLine<ConstantField, false>;
using SphereLine = DirectLine<SphereField, true>;
using GridLine = DirectLine<GridField, true>;

// Any field.
class AnyLine {
 public:
  static constexpr bool kBreaks = true;
  static constexpr int kLookups = 1;
  AnyLine(const Field& field, const Vec3& o, const Vec3& d) : line_(field.line(o, d)) {}
  double next_break(double t) const { return line_->next_break(t); }
  void enter(double a, double b) { line_->enter(a, b); }
  void evaluate(double t, double& v, double& dv) const { line_->evaluate(t, v, dv); }
  double above_until(double t, double t_end, double threshold) const {
    return line_->above_until(t, t_end, threshold);
  }
  FieldSample sample(double t) const { return line_->sample(t); }

 private:
  std::unique_ptr<FieldLine> line_;
};

}  // namespace gpis

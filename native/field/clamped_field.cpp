#include "field/clamped_field.h"

namespace gpis {
namespace {

struct Cubic {
  double c0, c1, c2, c3;

  double operator()(double u) const { return c0 + u * (c1 + u * (c2 + u * c3)); }
};

// The first root in (0, limit), away from 0 itself; infinity if there is none. Between its turning
// points a cubic is monotone.
double first_root(const Cubic& c, double limit) {
  double stops[3];
  int count = 0;
  const double a = 3 * c.c3, b = 2 * c.c2, discriminant = b * b - 4 * a * c.c1;
  if (a != 0 && discriminant > 0) {
    const double q = -(b + std::copysign(std::sqrt(discriminant), b)) / 2;
    stops[count++] = q / a;
    if (q != 0) stops[count++] = c.c1 / q;
  } else if (a == 0 && b != 0) {
    stops[count++] = -c.c1 / b;
  }
  std::sort(stops, stops + count);
  if (!std::isfinite(limit)) {  // Cauchy's bound on roots
    const double lead = c.c3 != 0 ? c.c3 : c.c2 != 0 ? c.c2 : c.c1;
    if (lead == 0) return kInfinity;
    limit = 1 + std::max({std::abs(c.c0), std::abs(c.c1), std::abs(c.c2)}) / std::abs(lead);
  }
  stops[count++] = limit;
  double left = 1e-9 * std::min(1.0, limit);
  bool positive = c(left) > 0;
  for (int i = 0; i < count; ++i) {
    double right = std::min(stops[i], limit);
    if (right <= left) continue;
    if ((c(right) > 0) != positive) {
      for (int k = 0; k < 60; ++k) {
        const double m = (left + right) / 2;
        ((c(m) > 0) == positive ? left : right) = m;
      }
      return right;
    }
    left = right;
  }
  return kInfinity;
}

}  // namespace

std::unique_ptr<FieldLine> ClampedField::line(const Vec3& o, const Vec3& d) const {
  return std::make_unique<Line>(*this, o, d);
}

ClampedField::Line::Line(const ClampedField& field, const Vec3& o, const Vec3& d)
    : field_(&field),
      speed_(length(d)),
      line_(field.field_->line(o, d)),
      ahead_(field.field_->line(o, d)) {
  enter(0, 0);
}

double ClampedField::Line::next_break(double t) const {
  // Within smooth_scale the field is a cubic along the ray, to start a root search from; where
  // smooth_scale is infinite it is one exactly, however long the piece.
  const double step = field_->field_->smooth_scale() / speed_;
  const double stop = std::min(ahead_->next_break(t), t + step);
  ahead_->enter(t, stop);
  const double h = std::isfinite(stop) ? stop - t : 1 / speed_;
  double v0, d0, v1, d1;
  ahead_->evaluate(t, v0, d0);
  ahead_->evaluate(t + h, v1, d1);
  const Cubic cubic{v0, h * d0, 3 * (v1 - v0) - h * (2 * d0 + d1), 2 * (v0 - v1) + h * (d0 + d1)};

  double first = stop;
  for (const double level : {field_->low_, field_->high_}) {
    if (!std::isfinite(level)) continue;
    Cubic above = cubic;
    above.c0 -= level;
    double root = t + h * first_root(above, std::isfinite(stop) ? 1 : kInfinity);
    for (int i = 0; i < 4 && root < stop; ++i) {  // Newton, on the field itself
      double v, d;
      ahead_->evaluate(root, v, d);
      const double next = root - (v - level) / d;
      if (!(next > t && next < stop)) break;
      root = next;
    }
    first = std::min(first, root);
  }
  return first;
}

void ClampedField::Line::enter(double a, double b) {
  line_->enter(a, b);
  double value, derivative;
  const double middle = std::isfinite(b) ? (a + b) / 2 : a + std::max(1 / speed_, std::abs(a));
  line_->evaluate(middle, value, derivative);
  level_.reset();
  if (value <= field_->low_) level_ = field_->low_;
  if (value >= field_->high_) level_ = field_->high_;
}

}  // namespace gpis

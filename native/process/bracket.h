// Where a function known by values and slopes at two points can have a root between them.
#pragma once

#include <cmath>

namespace gpis {

enum class Verdict { none, single, unclear };

// Bernstein coefficients of the cubic through both ends; the function differs from it by less than
// margin · (B₁ + B₂). P holds t, f and df per t.
template <class P>
Verdict classify(const P& a, const P& b, double margin) {
  // Inside (after a skip, or a certain start), or where mean and σ are both 0: wait until the path
  // is out.
  if (a.f < 0 || (a.f == 0 && !(a.df > 0))) return Verdict::none;
  const double h = b.t - a.t, c1 = a.f + h / 3 * a.df, c2 = b.f - h / 3 * b.df;
  if (b.f > 0) return c1 > margin && c2 > margin ? Verdict::none : Verdict::unclear;
  // Descartes' rule of signs. A start that rises less than the margin may be back at once: the
  // cubic has one root, and a rough path many around it.
  return c1 < margin && (c2 > -margin || a.df > 0) ? Verdict::unclear : Verdict::single;
}

// A ray leaves a face that it stands on but for rounding, and a piece of the field ends within that
// rounding (`step` is the path's): f rises from 0, there is no root.
template <class P>
bool rises_through_rounding(const P& a, const P& b, double step) {
  return a.f == 0 && a.df > 0 && b.f <= 0 && b.df > 0 && std::isfinite(step) &&
         b.t - a.t < 1e-9 * step;
}

// The cubic through the values and slopes at two points, by its Bernstein coefficients.
class Cubic {
 public:
  Cubic(double t0, double f0, double df0, double t1, double f1, double df1)
      : t_(t0), h_(t1 - t0), c0_(f0), c1_(f0 + h_ / 3 * df0), c2_(f1 - h_ / 3 * df1), c3_(f1) {}

  double value(double t) const { return value_at((t - t_) / h_); }
  double slope(double t) const { return slope_at((t - t_) / h_) / h_; }

  // c₀ > 0 >= c₃: where it is 0.
  double root() const {
    double a = 0, b = 1, s = c0_ > 0 ? c0_ / (c0_ - c3_) : 0.5;
    for (int i = 0; i < 8; ++i) {
      const double f = value_at(s), df = slope_at(s);
      (f > 0 ? a : b) = s;
      double next = s - f / df;
      if (!(df < 0 && next > a && next < b)) next = 0.5 * (a + b);
      const bool near = std::abs(next - s) < 1e-4;
      s = next;
      if (near) break;  // what follows is far below the cubic's own deviation
    }
    return t_ + s * h_;
  }

 private:
  double value_at(double s) const {
    const double r = 1 - s;
    return r * r * (r * c0_ + 3 * s * c1_) + s * s * (3 * r * c2_ + s * c3_);
  }
  double slope_at(double s) const {  // per s
    const double r = 1 - s;
    return 3 * (r * r * (c1_ - c0_) + 2 * r * s * (c2_ - c1_) + s * s * (c3_ - c2_));
  }

  double t_, h_, c0_, c1_, c2_, c3_;
};

template <class P>
double cubic_root(const P& lo, const P& hi) {
  return Cubic(lo.t, lo.f, lo.df, hi.t, hi.f, hi.df).root();
}

// Newton inside a bracket lo.f > 0 >= hi.f, first guess from the cubic; `evaluate` gives points of
// the function itself, so the root is its own. Steps of at most `last_step` are taken without
// another evaluation: Newton's error is their square.
template <class P, class Evaluate>
P refine_root(const P& lo, const P& hi, double tolerance, double last_step,
              const Evaluate& evaluate) {
  double a = lo.t, b = hi.t, x = cubic_root(lo, hi);
  P p = hi;
  for (int i = 0; i < 80; ++i) {
    if (!(x > a && x < b)) x = 0.5 * (a + b);
    p = evaluate(x);
    (p.f > 0 ? a : b) = x;
    const double step = -p.f / p.df;
    if (b - a <= tolerance) break;
    if (p.df < 0 && std::abs(step) <= last_step + tolerance) {
      p.t += step;
      p.g += step * p.dg;
      break;
    }
    x = i < 40 && p.df < 0 ? x + step : 0.5 * (a + b);
  }
  return p;
}

}  // namespace gpis

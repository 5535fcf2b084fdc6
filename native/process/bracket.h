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
  return c1 < margin && c2 > -margin ? Verdict::unclear
                                     : Verdict::single;  // Descartes' rule of signs
}

// Root of the cubic through both ends, lo.f > 0 >= hi.f.
template <class P>
double cubic_root(const P& lo, const P& hi) {
  const double h = hi.t - lo.t;
  const double c0 = lo.f, c1 = c0 + h / 3 * lo.df, c3 = hi.f, c2 = c3 - h / 3 * hi.df;
  double a = 0, b = 1, s = c0 > 0 ? c0 / (c0 - c3) : 0.5;
  for (int i = 0; i < 8; ++i) {
    const double r = 1 - s;
    const double f = r * r * r * c0 + 3 * r * r * s * c1 + 3 * r * s * s * c2 + s * s * s * c3;
    const double df = 3 * (r * r * (c1 - c0) + 2 * r * s * (c2 - c1) + s * s * (c3 - c2));
    (f > 0 ? a : b) = s;
    double next = s - f / df;
    if (!(df < 0 && next > a && next < b)) next = 0.5 * (a + b);
    const bool near = std::abs(next - s) < 1e-4;
    s = next;
    if (near) break;  // what follows is far below the cubic's own deviation
  }
  return lo.t + s * h;
}

}  // namespace gpis

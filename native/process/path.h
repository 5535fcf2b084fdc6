// The sample path of g along one line o + t d, in the ray parameter t: what a line sampler must do.
// It knows nothing of mean and deviation; derivatives are per t (|d| is arbitrary in object space),
// gradients are of g in object space. One file per path; plan.cpp chooses one per object, as a
// template argument of March.
//
// Order of calls on one line:
//   reset(plan, line, anchor, t_end, …)   a new path; `anchor` is the first uncertain t, nothing is
//                                         asked before it or behind t_end
//   start_free(…)                         draws g at the anchor, nothing known
//   start(known, …)                       g at the anchor is as remembered; also after start_free,
//                                         which it then overrules (a draw that was not outside)
//   prepare(cell, …)                      draws what the cell needs; increasing order, gaps allowed
//   at_right, at                          g and its slope at the end of the last prepared cell,
//                                         and anywhere in a prepared one
//   gradient(t, g, dg, …)                 law of ∇g at t, given the path and g, g' there
// Cell k is [anchor + k step, anchor + (k+1) step]. Paths that bridge draw in `at`, so it takes the
// generator; whatever was drawn is kept, the same t gives the same g until the next reset.
#pragma once

#include <concepts>

#include "core/counters.h"
#include "core/rng.h"
#include "core/vec.h"

namespace gpis {

struct GaussianProcess;

// Object space.
struct LineGeometry {
  Vec3 origin, direction;
};

// What is known of g at the anchor; a known gradient brings its slope along the line with it.
struct PathStart {
  double value = 0;
  bool slope_known = false;
  double slope = 0;
  bool gradient_known = false;
  Vec3 gradient;
};

// ∇g = mean + ξ₁b₁ + ξ₂b₂, ξ iid N(0,1), b·d = 0: every draw has the slope of the path.
struct PathGradient {
  Vec3 mean, b1, b2;
  // How much of the transverse variance is still unknown: 1 where nothing is remembered.
  double free_variance = 1;
};

// What LinePath says of deviation, for paths that know more of one place than of others too.
template <class Path>
double deviation_over(const Path& path, double a, double h) {
  if constexpr (requires { path.deviation(a, h); })
    return path.deviation(a, h);
  else
    return path.deviation(h);
}

// Plan: what a path needs once per object, immutable and shared by threads. Its constructor throws
// a sentence where the path cannot serve the process; `correlation_error` bounds |implied - exact
// correlation|.
template <class Path>
concept LinePath =
    std::constructible_from<typename Path::Plan, const GaussianProcess&, const Box3&> &&
    requires(Path path, const Path& drawn, const typename Path::Plan& plan,
             const LineGeometry& line, const PathStart& known, double t, long cell, Rng& rng,
             Counters& counters, double& out) {
  { plan.correlation_error } -> std::convertible_to<double>;
  path.reset(plan, line, t, t, counters);
  // Cells that one step of the march may cover, 1 or 2: where evaluations at the ends of cells are
  // cheap, not more than the surface's distance asks for.
  { Path::kStride } -> std::convertible_to<int>;
  // The last Newton step towards a root that is not worth another evaluation, in cells: the square
  // of it is left where g has two derivatives; 0 where it has not.
  { drawn.last_step() } -> std::same_as<double>;
  // Length of a cell in t; infinite where g is constant on the line.
  { drawn.step() } -> std::same_as<double>;
  // Laws at the anchor, before the start: mean and standard deviation of g, and mean (first out)
  // and standard deviation (second) of its slope given the value.
  { drawn.value_mean() } -> std::same_as<double>;
  { drawn.value_deviation() } -> std::same_as<double>;
  drawn.slope_law(t, out, out);
  path.start_free(rng, counters, out, out);                      // g, g' at the anchor
  { path.start(known, rng, counters) } -> std::same_as<double>;  // g' at the anchor
  // For all t' >= t: how far below 0 the start may hold the mean of g (definitions B13).
  { drawn.pull(t) } -> std::same_as<double>;
  path.prepare(cell, rng, counters);
  path.at_right(cell, out, out);
  path.at(cell, t, rng, out, out);
  // c: between two evaluated points a and a + h, g differs from the cubic through both values
  // and slopes by less than c (B₁ + B₂), B Bernstein's polynomials 3s(1-s)² and 3s²(1-s), but
  // for 4.5 standard deviations.
  { deviation_over(drawn, t, t) } -> std::same_as<double>;
  { path.gradient(t, t, t, rng) } -> std::same_as<PathGradient>;
};

}  // namespace gpis

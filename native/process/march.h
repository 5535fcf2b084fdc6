// First hit along a line (math.md §6): march in steps over which the sample path is a cubic up to a
// known deviation, divide a step while a root could hide in it, refine the root on the same sample
// path. Templated on the lines of mean and deviation and on the path, so that nothing virtual is
// called per step in the common cases.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "process/line_impl.h"
#include "process/plan.h"

namespace gpis {

template <class MeanLine, class SigmaLine, class Path>
class March {
 public:
  March(Line::Impl& line, Path& path, MeanLine mean, SigmaLine sigma, const PlannedLine& plan,
        Rng& rng, Counters& counters)
      : line_(line),
        path_(path),
        mean_(std::move(mean)),
        sigma_(std::move(sigma)),
        plan_(plan),
        rng_(rng),
        counters_(counters) {
    const double speed = length(line.direction);
    smooth_step_ = 0.25 * plan.smooth_scale / speed;
    // |∂⁴ mean| <= 12 / scale³ along a unit-speed line (a sphere's distance); a cubic through both
    // ends is off by h⁴/384 of it.
    mean_deviation_ = std::isinf(plan.smooth_scale)
                          ? 0
                          : 0.05 * std::pow(speed, 4) / std::pow(plan.smooth_scale, 3);
    mean_slope_ = plan.mean_lipschitz * speed;
    sigma_slope_ = plan.sigma_lipschitz * speed;
  }

  // Fills line.hit_* and returns the hit's t, or infinity.
  double run(double t_begin, double t_end, const Start& start) {
    double a = t_begin;
    double threshold = plan_.skip_threshold;
    if (start.kind == Start::Kind::outside) {
      a = mean_.above_until(a, t_end, threshold);
      if (!(a < t_end)) {
        ++counters_.line_skipped;
        return kInfinity;
      }
    }
    ++counters_.line_segments;
    line_.anchor = a;
    path_.reset((t_end - a) * line_.inverse_length, counters_);
    cell_ = 0;
    path_.prepare(0, rng_, counters_);
    double b = step_end(a, t_end);
    enter(a, b);
    Point from = begin(a, start);
    line_.stretches.push_back({a, a, 0});

    bool new_piece = false;
    for (int steps = 0; steps < kMaxSteps; ++steps) {
      b = step_end(a, t_end);
      const double whole = std::min(cell_end(), t_end);
      Point to;
      if (kBreaks && piece_end_ < whole && tried_cell_ != cell_ &&
          certainly_clear(from, whole, to)) {
        b = whole;
        new_piece = true;
      } else {
        enter(a, b);
        if (new_piece) from = combine(a, from.g, from.dg);  // same path, fields of the new piece
        to = evaluate_end(b);
        if (find_root(from, to)) return line_.hit_t;
        new_piece = kBreaks && b == piece_end_;
      }
      line_.stretches.back().end = b;
      line_.stretches.back().last_cell = cell_;
      if (b >= t_end) return kInfinity;

      from = to;
      a = b;
      if (b == cell_end()) ++cell_;
      if (to.mean > threshold_at(a)) {
        const double clear = mean_.above_until(a, t_end, threshold_at(a));
        if (clear >= t_end) return kInfinity;
        if ((clear - a) * line_.inverse_length > Path::kStep) {
          a = clear;
          cell_ = static_cast<long>(std::floor(line_.q_of(a) / Path::kStep));
          path_.prepare(cell_, rng_, counters_);
          enter(a, step_end(a, t_end));
          from = evaluate(a);
          new_piece = false;
          if (!(from.f > 0)) ++counters_.line_entry_inside;
          line_.stretches.push_back({a, a, cell_});
          continue;
        }
      }
      path_.prepare(cell_, rng_, counters_);
    }
    ++counters_.line_step_limit;
    return kInfinity;
  }

 private:
  static constexpr int kMaxSteps = 1 << 20;
  static constexpr double kDeviation = 0.16;  // of a path from its cubic, see classify
  static constexpr bool kBreaks = MeanLine::kBreaks || SigmaLine::kBreaks;

  struct Point {
    double t, f, df;             // df per t
    double g, dg;                // per q
    double mean, sigma, dsigma;  // of the fields
  };

  double cell_end() const {
    return line_.anchor + (cell_ + 1) * Path::kStep / line_.inverse_length;
  }

  double step_end(double a, double t_end) {
    piece_end_ = kInfinity;
    if constexpr (MeanLine::kBreaks) piece_end_ = mean_.next_break(a);
    if constexpr (SigmaLine::kBreaks) piece_end_ = std::min(piece_end_, sigma_.next_break(a));
    return std::min({cell_end(), a + smooth_step_, t_end, piece_end_});
  }

  void enter(double a, double b) {
    if constexpr (MeanLine::kBreaks) mean_.enter(a, b);
    if constexpr (SigmaLine::kBreaks) sigma_.enter(a, b);
  }

  // Right after the start the remembered value and slope may hold f lower than the prior's
  // threshold says (B13).
  double threshold_at(double t) const {
    return line_.conditioned && line_.q_of(t) < 6 ? plan_.skip_threshold + extra_threshold_
                                                  : plan_.skip_threshold;
  }

  // f = μ + σ g, f' = μ' + gσ' + σ g' (math.md §2).
  Point combine(double t, double g, double dg) {
    Point p;
    double dmean;
    mean_.evaluate(t, p.mean, dmean);
    sigma_.evaluate(t, p.sigma, p.dsigma);
    p.t = t;
    p.g = g;
    p.dg = dg;
    p.f = p.mean + p.sigma * g;
    p.df = dmean + p.dsigma * g + p.sigma * dg * line_.inverse_length;
    ++counters_.line_evaluations;
    counters_.mean_lookups += MeanLine::kLookups;
    counters_.sigma_lookups += SigmaLine::kLookups;
    return p;
  }

  Point evaluate(double t) {
    const double q = line_.q_of(t);
    double g, dg;
    path_.at(cell_, q, g, dg);
    line_.condition(q, g, dg);
    return combine(t, g, dg);
  }

  Point evaluate_end(double b) {
    if (b != cell_end()) return evaluate(b);
    double g, dg;
    path_.at_right(cell_, g, dg);
    line_.condition((cell_ + 1) * Path::kStep, g, dg);
    return combine(b, g, dg);
  }

  // A cell of the path that holds many pieces of the fields (voxels), crossed at once where bounds
  // show that it holds no root: the mean and the deviation by their steepest slopes, g by its cubic
  // (see classify). `to` is its far end.
  bool certainly_clear(const Point& from, double whole, Point& to) {
    tried_cell_ = cell_;
    if (!(from.f > 0)) return false;
    enter(whole, whole);
    to = evaluate_end(whole);
    const double h = whole - from.t, hq = h * line_.inverse_length;
    const double mean = 0.5 * (from.mean + to.mean - mean_slope_ * h);
    const double g = std::min({from.g, to.g, from.g + hq * from.dg / 3, to.g - hq * to.dg / 3}) -
                     kDeviation * (hq * hq) * (hq * hq);
    const double middle = 0.5 * (from.sigma + to.sigma), spread = 0.5 * sigma_slope_ * h;
    const double sigma = g < 0 ? middle + spread : std::max(0.0, middle - spread);
    if (!(mean + sigma * g > 0)) return false;
    ++counters_.line_cells_clear;
    return true;
  }

  // The state at the start (definitions B1-B4), as corrections of the path at q = 0.
  Point begin(double a, const Start& start) {
    double g, dg;
    path_.at(0, 0, g, dg);
    const Point prior = combine(a, g, dg);
    const double s = prior.sigma;
    if (s == 0) return begin_certain(prior, start);
    double want_g = g, want_dg = dg;
    const double dmean = prior.df - prior.dsigma * g - s * dg * line_.inverse_length;
    if (start.kind == Start::Kind::outside) {
      // f > 0. A draw that is outside already follows the truncated law; another one is replaced by
      // it.
      if (prior.f > 0) return prior;
      want_g = truncated_normal(-prior.mean / s, rng_);
      ++counters_.truncated_normals;
    } else {
      want_g = (start.state.value - prior.mean) / s;
      const double m = dmean + want_g * prior.dsigma, s1 = s * line_.inverse_length;
      if (start.kind == Start::Kind::value_slope) {
        want_dg = (dot(line_.direction, start.state.gradient) - m) / s1;
      } else if (start.state.value == 0) {
        want_dg = flux_weighted_normal(m / s1, rng_) - m / s1;  // B3
      }
    }
    line_.conditioned = true;
    line_.delta_value = want_g - g;
    const bool slope_known = start.kind == Start::Kind::value_slope ||
                             (start.kind == Start::Kind::value && start.state.value == 0);
    // Conditioned on the value alone, g - ĝ = κ(q)(g₀ - ĝ(0)) has no slope at q = 0.
    line_.delta_slope = slope_known ? want_dg - dg : 0;
    extra_threshold_ = plan_.sigma_max * (std::max(0.0, -want_g) + 0.61 * std::max(0.0, -want_dg));
    Point p = combine(a, want_g, want_dg);
    if (start.kind != Start::Kind::outside) p.f = start.state.value;
    return start.kind != Start::Kind::outside && start.state.value == 0 ? leaving(p) : p;
  }

  Point begin_certain(Point p, const Start& start) {
    if (start.kind == Start::Kind::outside) return p;
    p.f = start.state.value;
    return start.state.value == 0 ? leaving(p) : p;
  }

  // A ray that leaves the surface has a positive slope; only rounding at grazing directions can say
  // otherwise.
  Point leaving(Point p) {
    const double floor = 1e-14 * (std::abs(p.mean) + p.sigma) * line_.inverse_length;
    if (!(p.df > floor)) {
      p.df = floor;
      ++counters_.line_slope_floor;
    }
    return p;
  }

  enum class Verdict { none, single, unclear };

  // Bernstein coefficients of the cubic through both ends, less the deviation of the true path from
  // it: u²(h-u)² |g''''| / 24 <= (4/3)(B₁+B₂) · 4.5 √105 (h/2)⁴/24, 4.5 standard deviations of
  // g'''' (√105 per length scale⁴).
  Verdict classify(const Point& a, const Point& b) const {
    // Inside (after a skip, or a certain start), or where mean and σ are both 0: wait until the
    // path is out.
    if (a.f < 0 || (a.f == 0 && !(a.df > 0))) return Verdict::none;
    const double h = b.t - a.t, hq = h * line_.inverse_length;
    const double sigma = std::max(a.sigma, b.sigma) + std::abs(b.dsigma - a.dsigma) * h;
    const double margin =
        kDeviation * sigma * (hq * hq) * (hq * hq) + mean_deviation_ * (h * h) * (h * h);
    const double c1 = a.f + h * a.df / 3, c2 = b.f - h * b.df / 3;
    if (b.f > 0) return c1 > margin && c2 > margin ? Verdict::none : Verdict::unclear;
    return c1 < margin && c2 > -margin ? Verdict::unclear
                                       : Verdict::single;  // Descartes' rule of signs
  }

  bool find_root(const Point& from, const Point& to) {
    std::array<Point, 64> pending;
    int count = 0;
    pending[count++] = to;
    Point a = from;
    while (count > 0) {
      const Point& b = pending[count - 1];
      Verdict verdict = classify(a, b);
      if (verdict == Verdict::unclear) {
        const double h = b.t - a.t;
        if (count < 64 && h * line_.inverse_length > 1e-10 && h > 1e-14 * std::abs(b.t)) {
          ++counters_.line_splits;
          pending[count] = evaluate(a.t + 0.5 * h);
          ++count;
          continue;
        }
        ++counters_.line_split_limit;
        verdict = b.f > 0 ? Verdict::none : Verdict::single;
      }
      if (verdict == Verdict::single) {
        refine(a, b);
        return true;
      }
      a = b;
      --count;
    }
    return false;
  }

  // Newton inside a bracket f(lo) > 0 >= f(hi), first guess from the cubic; evaluates the path
  // itself, so the root is the path's.
  void refine(const Point& lo, const Point& hi) {
    double a = lo.t, b = hi.t;
    const double tolerance = 1e-11 / line_.inverse_length + 4e-16 * std::abs(b);
    double x = cubic_root(lo, hi);
    Point p = hi;
    for (int i = 0; i < 80; ++i) {
      if (!(x > a && x < b)) x = 0.5 * (a + b);
      p = evaluate(x);
      (p.f > 0 ? a : b) = x;
      const double step = -p.f / p.df;
      if (b - a <= tolerance || (p.df < 0 && std::abs(step) <= tolerance)) break;
      x = i < 40 && p.df < 0 ? x + step : 0.5 * (a + b);
    }
    line_.hit_t = p.t;
    line_.hit_g = p.g;
    line_.hit_dg = p.dg;
    line_.hit_mean = mean_.sample(p.t);
    line_.hit_sigma = sigma_.sample(p.t);
    line_.stretches.back().end = p.t;
    line_.stretches.back().last_cell = cell_;
    if (!(p.df < 0)) ++counters_.line_slope_floor;
  }

  static double cubic_root(const Point& lo, const Point& hi) {
    const double h = hi.t - lo.t;
    const double c0 = lo.f, c1 = c0 + h * lo.df / 3, c3 = hi.f, c2 = c3 - h * hi.df / 3;
    double a = 0, b = 1, s = c0 > 0 ? c0 / (c0 - c3) : 0.5;
    for (int i = 0; i < 8; ++i) {
      const double r = 1 - s;
      const double f = r * r * r * c0 + 3 * r * r * s * c1 + 3 * r * s * s * c2 + s * s * s * c3;
      const double df = 3 * (r * r * (c1 - c0) + 2 * r * s * (c2 - c1) + s * s * (c3 - c2));
      (f > 0 ? a : b) = s;
      double next = s - f / df;
      if (!(df < 0 && next > a && next < b)) next = 0.5 * (a + b);
      if (std::abs(next - s) < 1e-7) break;
      s = next;
    }
    return lo.t + s * h;
  }

  Line::Impl& line_;
  Path& path_;
  MeanLine mean_;
  SigmaLine sigma_;
  const PlannedLine& plan_;
  Rng& rng_;
  Counters& counters_;
  long cell_ = 0, tried_cell_ = -1;
  double mean_slope_, sigma_slope_;  // upper bounds per t
  double piece_end_ = kInfinity;     // where the smooth piece of the fields ends
  double smooth_step_, mean_deviation_, extra_threshold_ = 0;
};

}  // namespace gpis

// First hit along a line (math.md §6): march in steps over which the sample path is a cubic up to a
// known deviation, divide a step while a root could hide in it, refine the root on the same sample
// path. Templated on the lines of mean and deviation and on the path (process/path.h), so that
// nothing virtual is called per step in the common cases.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "process/bracket.h"
#include "process/gaussian_process.h"
#include "process/line_impl.h"
#include "process/path_start.h"
#include "process/plan.h"

namespace gpis {

template <class MeanLine, class SigmaLine, LinePath Path>
class March {
 public:
  March(Line::Impl& line, Path& path, const typename Path::Plan& path_plan, MeanLine mean,
        SigmaLine sigma, const PlannedLine& plan, Rng& rng, Counters& counters)
      : line_(line),
        path_(path),
        path_plan_(path_plan),
        mean_(std::move(mean)),
        sigma_(std::move(sigma)),
        plan_(plan),
        rng_(rng),
        counters_(counters) {
    const double speed = length(line.geometry.direction);
    smooth_step_ = 0.25 * plan.smooth_scale / speed;
    // |∂⁴ mean| <= 12 / scale³ along a unit-speed line (a sphere's distance); a cubic through both
    // ends is off by h⁴/384 of it.
    const double curvature = speed / plan.smooth_scale;
    mean_deviation_ = 0.05 * speed * curvature * curvature * curvature;
    mean_slope_ = plan.mean_lipschitz * speed;
    sigma_slope_ = plan.sigma_lipschitz * speed;
    if constexpr (kSameFields)
      if (sigma_.can_follow(mean_)) sigma_.follow(mean_);
  }

  // Fills line.hit_* and returns the hit's t, or infinity.
  double run(double t_begin, double t_end, const Start& start) {
    double a = t_begin;
    double threshold = plan_.skip_threshold;
    if constexpr (requires { path_plan_.pull(); }) threshold += plan_.sigma_max * path_plan_.pull();
    if (start.kind == Start::Kind::outside) {
      a = mean_.above_until(a, t_end, threshold);
      if (!(a < t_end)) {
        ++counters_.line_skipped;
        return kInfinity;
      }
    }
    ++counters_.line_segments;
    line_.anchor = a;
    path_.reset(path_plan_, line_.geometry, a, t_end, counters_);
    step_ = path_.step();
    resolution_ = std::isinf(step_) ? 0 : 2e-11 * step_;
    cell_ = 0;
    double b = step_end(a, t_end);
    enter(a, b);
    // Steps hand on their end by name: copies would wait for what was just written.
    Point points[2] = {begin(a, start), {}};
    Point *from = &points[0], *to = &points[1];
    path_.prepare(0, rng_, counters_);
    line_.stretches.push_back({a, a, 0});

    bool new_piece = false;
    for (int steps = 0; steps < kMaxSteps; ++steps) {
      if (steps % kStepsToStop == kStepsToStop - 1 && line_.stop && *line_.stop) return kInfinity;
      b = step_end(a, t_end);
      last_cell_ = cell_;
      const double whole = std::min(cell_end(), t_end);
      if (kBreaks && piece_end_ < whole && crossed(*from, whole, *to)) {
        b = whole;
        new_piece = true;
      } else {
        if (from->t != a) {  // some way into the cell
          a = from->t;
          b = step_end(a, t_end);
          new_piece = false;
        }
        if (Path::kStride > 1 && b == cell_end()) b = stride_end(*from, b, t_end);
        enter(a, b);
        if (new_piece) *from = combine(a, from->g, from->dg);  // same path, fields of the new piece
        *to = evaluate_end(b);
        const Verdict verdict = classify_step(*from, *to);
        if (verdict != Verdict::none && find_root(*from, *to, verdict)) return line_.hit_t;
        new_piece = kBreaks && b == piece_end_;
      }
      line_.stretches.back().end = b;
      line_.stretches.back().last_cell = last_cell_;
      if (b >= t_end) return kInfinity;

      std::swap(from, to);
      a = b;
      if (b == cell_end(last_cell_)) cell_ = last_cell_ + 1;
      if (from->mean > threshold_at(a)) {
        const double clear = mean_.above_until(a, t_end, threshold_at(a));
        if (clear >= t_end) return kInfinity;
        if (clear - a > step_) {
          a = clear;
          cell_ = static_cast<long>(std::floor((a - line_.anchor) / step_));
          last_cell_ = cell_;
          path_.prepare(cell_, rng_, counters_);
          enter(a, step_end(a, t_end));
          *from = evaluate(a);
          new_piece = false;
          if (!(from->f > 0)) ++counters_.line_entry_inside;
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
  static constexpr int kMaxSteps = 1 << 20, kStepsToStop = 1 << 12;
  static constexpr bool kBreaks = MeanLine::kBreaks || SigmaLine::kBreaks;
  static constexpr bool kSameFields = std::same_as<MeanLine, SigmaLine> && requires(MeanLine & l) {
    l.follow(l);
  };

  // Derivatives per t.
  struct Point {
    double t, f, df;
    double g, dg;
    double mean, sigma, dsigma;  // of the fields
  };

  double cell_end(long cell) const { return line_.anchor + (cell + 1) * step_; }
  double cell_end() const { return cell_end(cell_); }

  double step_end(double a, double t_end) {
    piece_end_ = kInfinity;
    if constexpr (MeanLine::kBreaks) piece_end_ = mean_.next_break(a);
    if constexpr (SigmaLine::kBreaks) piece_end_ = std::min(piece_end_, sigma_.next_break(a));
    const double b = std::min({cell_end(), a + smooth_step_, t_end, piece_end_});
    // Nothing ends the step: a constant path over a mean without curvature. Steps that double end
    // it.
    return b < kInfinity ? b : a + 1 + (a - line_.anchor);
  }

  // Where the surface is far enough for the test to have a chance, the step goes on to the end of
  // the next cell.
  double stride_end(const Point& from, double b, double t_end) {
    const double far = cell_end(cell_ + 1), h = far - from.t;
    if (!(far <= std::min({from.t + smooth_step_, t_end, piece_end_}))) return b;
    if (!(from.f > off_cubic(from.t, h) * from.sigma && from.f + h / 3 * from.df > 0)) return b;
    last_cell_ = cell_ + 1;
    path_.prepare(last_cell_, rng_, counters_);
    return far;
  }

  void enter(double a, double b) {
    if constexpr (MeanLine::kBreaks) mean_.enter(a, b);
    if constexpr (SigmaLine::kBreaks) sigma_.enter(a, b);
    if constexpr (requires { path_.enter(a, b); }) path_.enter(a, b);
  }

  // Right after the start the remembered value and slope may hold f lower than the prior's
  // threshold says (B13).
  double threshold_at(double t) const {
    return plan_.skip_threshold + plan_.sigma_max * path_.pull(t);
  }

  // f = μ + σ g, f' = μ' + gσ' + σ g' (math.md §2), on the path.
  Point combine(double t, double g, double dg) {
    ++counters_.line_evaluations;
    return fields(t, g, dg);
  }

  Point fields(double t, double g, double dg) {
    Point p;
    double dmean;
    mean_.evaluate(t, p.mean, dmean);
    sigma_.evaluate(t, p.sigma, p.dsigma);
    p.t = t;
    p.g = g;
    p.dg = dg;
    p.f = p.mean + p.sigma * g;
    p.df = dmean + p.dsigma * g + p.sigma * dg;
    counters_.mean_lookups += MeanLine::kLookups;
    counters_.sigma_lookups += SigmaLine::kLookups;
    return p;
  }

  Point evaluate(double t) {
    double g, dg;
    path_.at(t < cell_end() ? cell_ : last_cell_, t, rng_, g, dg);
    return combine(t, g, dg);
  }

  Point evaluate_end(double b) {
    if (b != cell_end(last_cell_)) return evaluate(b);
    double g, dg;
    path_.at_right(last_cell_, g, dg);
    return combine(b, g, dg);
  }

  // The middle of a step: of two cells it is where they meet.
  Point evaluate_middle(const Point& a, const Point& b) {
    if (last_cell_ == cell_ || b.t - a.t < 1.5 * step_) return evaluate(a.t + 0.5 * (b.t - a.t));
    double g, dg;
    path_.at_right(cell_, g, dg);
    return combine(cell_end(), g, dg);
  }

  // A cell of the path that holds many pieces of the fields (voxels): crossed at once where bounds
  // show that it holds no root, else piece by piece as long as each is seen to hold none. `to` is
  // then its far end; false: `from` is the point where a step has to be taken.
  bool crossed(Point& from, double whole, Point& to) {
    if (!(from.f > 0)) return false;
    if (tried_cell_ != cell_) {
      tried_cell_ = cell_;
      enter(whole, whole);
      to = evaluate_end(whole);
      far_g_ = to.g;
      far_dg_ = to.dg;
      if (certainly_clear(from, to)) return true;
    }
    return from.t + smooth_step_ >= whole && cross_pieces(from, whole, to);
  }

  // How far g may differ from its cubic, in units of (B₁ + B₂).
  double off_cubic(double a, double h) const { return plan_.caution * deviation_over(path_, a, h); }

  // The mean and the deviation by their steepest slopes, g by its cubic (see classify).
  bool certainly_clear(const Point& from, const Point& to) {
    const double h = to.t - from.t;
    const double mean = 0.5 * (from.mean + to.mean - mean_slope_ * h);
    const double g = std::min({from.g, to.g, from.g + h / 3 * from.dg, to.g - h / 3 * to.dg}) -
                     off_cubic(from.t, h);
    const double middle = 0.5 * (from.sigma + to.sigma), spread = 0.5 * sigma_slope_ * h;
    const double sigma = g < 0 ? middle + spread : std::max(0.0, middle - spread);
    if (!(mean + sigma * g > 0)) return false;
    ++counters_.line_cells_clear;
    return true;
  }

  // From `from` to the end of the cell g is the cubic through both, up to its deviation: a piece in
  // which f is positive for all that is crossed without asking the path.
  bool cross_pieces(Point& from, double whole, Point& to) {
    const double deviation = off_cubic(from.t, whole - from.t);
    const Cubic path(from.t, from.g, from.dg, whole, far_g_, far_dg_);
    double a = from.t, g = from.g, dg = from.dg;
    for (;;) {
      const double b = std::min(piece_end_, whole);
      enter(a, b);
      Point p = fields(a, g, dg);
      g = b < whole ? path.value(b) : far_g_;
      dg = b < whole ? path.slope(b) : far_dg_;
      to = fields(b, g, dg);
      // B₁ + B₂ <= ¾ over the cell.
      const double sigma = std::max(p.sigma, to.sigma) + std::abs(to.dsigma - p.dsigma) * (b - a);
      Point low = to;
      p.f -= 0.75 * deviation * sigma;
      low.f -= 0.75 * deviation * sigma;
      if (!(p.f > 0) || classify(p, low, 0) != Verdict::none) break;
      ++counters_.line_pieces_clear;
      if (b >= whole) return true;
      a = b;
      step_end(a, whole);
      if (to.mean > threshold_at(a)) break;
    }
    if (a > from.t) {
      enter(a, std::min(piece_end_, whole));
      from = evaluate(a);
      if (!(from.f > 0)) ++counters_.line_entry_inside;
    }
    return false;
  }

  // The state at the start (definitions B1-B4).
  Point begin(double a, const Start& start) {
    if (start.kind == Start::Kind::outside) {
      double g, dg;
      path_.start_free(rng_, counters_, g, dg);
      const Point p = combine(a, g, dg);
      if (p.f > 0 || p.sigma == 0) return p;
      // A draw that is outside already follows the truncated law; another one is replaced by it.
      const double mean = path_.value_mean(), deviation = path_.value_deviation();
      if (!(deviation > 0)) {  // known to lie inside
        ++counters_.line_entry_inside;
        return p;
      }
      PathStart known;
      known.value =
          mean + deviation * truncated_normal((-p.mean / p.sigma - mean) / deviation, rng_);
      ++counters_.truncated_normals;
      return combine(a, known.value, path_.start(known, rng_, counters_));
    }
    Point p = combine(a, 0, 0);
    if (p.sigma > 0) {
      const PathStart known =
          path_start(start, a, p, p.df, 1, line_.geometry.direction, path_, mean_, sigma_, rng_);
      p = combine(a, known.value, path_.start(known, rng_, counters_));
    } else {
      path_.start_free(rng_, counters_, p.g, p.dg);
    }
    p.f = start.state.value;
    if (p.f < 0) ++counters_.line_entry_inside;
    return p.f == 0 ? leaving(p) : p;
  }

  // A ray that leaves the surface has a positive slope; only rounding at grazing directions can say
  // otherwise.
  Point leaving(Point p) {
    const double floor = 1e-14 * (std::abs(p.mean) + p.sigma) / step_;
    if (!(p.df > floor)) {
      p.df = floor;
      ++counters_.line_slope_floor;
    }
    return p;
  }

  Verdict classify_step(const Point& a, const Point& b) const {
    if (rises_through_rounding(a, b, step_)) return Verdict::none;
    const double h = b.t - a.t;
    const double sigma = std::max(a.sigma, b.sigma) + std::abs(b.dsigma - a.dsigma) * h;
    return classify(a, b, off_cubic(a.t, h) * sigma + mean_deviation_ * (h * h) * (h * h));
  }

  // `verdict` is that of the whole step: none is left to the caller.
  bool find_root(const Point& from, const Point& to, Verdict verdict) {
    std::array<Point, 64> pending;
    int count = 0;
    pending[count++] = to;
    Point a = from;
    for (;;) {
      const Point& b = pending[count - 1];
      if (verdict == Verdict::unclear) {
        const double h = b.t - a.t;
        if (count < 64 && h > 10 * resolution_ && h > 1e-14 * std::abs(b.t)) {
          ++counters_.line_splits;
          pending[count] = evaluate_middle(a, b);
          ++count;
          verdict = classify_step(a, pending[count - 1]);
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
      if (--count == 0) return false;
      verdict = classify_step(a, pending[count - 1]);
    }
  }

  void refine(const Point& lo, const Point& hi) {
    Point p = refine_root(lo, hi, resolution_ + 4e-16 * std::abs(hi.t), path_.last_step() * step_,
                          [&](double t) { return evaluate(t); });
    // By rounding, where a start leads into the surface.
    p.t = std::max(p.t, 0.0);
    line_.hit_t = p.t;
    line_.hit_g = p.g;
    line_.hit_dg = p.dg;
    line_.hit_mean = mean_.sample(p.t);
    line_.hit_sigma = sigma_.sample(p.t);
    line_.stretches.back().end = p.t;
    line_.stretches.back().last_cell = last_cell_;
    if (!(p.df < 0)) ++counters_.line_slope_floor;
  }

  Line::Impl& line_;
  Path& path_;
  const typename Path::Plan& path_plan_;
  MeanLine mean_;
  SigmaLine sigma_;
  const PlannedLine& plan_;
  Rng& rng_;
  Counters& counters_;
  long cell_ = 0, last_cell_ = 0, tried_cell_ = -1;  // the step's first and last cell
  double mean_slope_, sigma_slope_;                  // upper bounds per t
  double piece_end_ = kInfinity;                     // where the smooth piece of the fields ends
  double smooth_step_, mean_deviation_;
  double far_g_ = 0, far_dg_ = 0;     // at the end of the cell that was tried
  double step_ = 1, resolution_ = 0;  // of the path's cells, of a root
};

}  // namespace gpis

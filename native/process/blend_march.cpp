#include "process/blend_march.h"

#include "process/bracket.h"

namespace gpis {

TreeHit BlendMarch::first_hit(const ProcessTree& tree, const ProcessTree* beyond,
                              std::span<const PlannedLine* const> plans,
                              const LineGeometry& geometry, std::span<Line> lines, double t_max,
                              std::span<const Start> starts, Rng& rng, Counters& counters) {
  tree_ = &tree;
  beyond_ = beyond;
  rng_ = &rng;
  counters_ = &counters;
  hit_ = {};
  lines_.reset(tree, plans, geometry, lines, t_max, rng, counters);
  values_.resize(lines_.leaves.size());
  weights_.resize(lines_.leaves.size());
  leaf_.resize(lines_.leaves.size());
  from_.reset(0, lines_.noises.size(), lines_.leaves.size());
  outside_ = true;
  leaving_ = false;
  start(starts);
  march(t_max);
  lines_.finish();
  return hit_;
}

bool BlendMarch::march(double t_end) {
  double a = 0;
  const std::atomic<bool>* stop = lines_.leaves[0].line->stop;
  for (int steps = 0; steps < kMaxSteps; ++steps) {
    if (steps % kStepsToStop == kStepsToStop - 1 && stop && *stop) return false;
    const bool leaving = leaving_by_bounds(a);
    const double here = a;
    if (lines_.skip_certain(*tree_, from_, a, outside_, leaving)) {
      if (leaving && !outside_) leave_by_bounds(here);
      if (!(a < t_end)) return false;
      continue;
    }
    step_over(a, t_end);
    if (outside_) {
      if (search(from_, to_, 0)) return true;
    } else {
      outside_ = at(to_).f > 0;
    }
    if (!(b_ < t_end)) return false;
    advance();
    a = b_;
  }
  ++counters_->line_step_limit;
  return false;
}

// Evaluates all leaves that are not certain at both ends of the step from a to b_.
void BlendMarch::step_over(double a, double t_end) {
  engage(a);
  b_ = t_end;
  for (Leaf& l : lines_.leaves) {
    if (l.certain != 0) {
      b_ = std::min(b_, l.until);
      continue;
    }
    Noise& n = lines_.noises[l.noise];
    if (!n.prepared) n.path->prepare(n.cell, *rng_, *counters_);
    n.prepared = true;
    b_ = std::min(b_, lines_.step_end(l, a));
  }
  if (!(b_ < kInfinity)) b_ = a + 1 + a;  // as in TreeMarch
  to_.reset(b_, lines_.noises.size(), lines_.leaves.size());
  for (std::size_t i = 0; i < lines_.leaves.size(); ++i) {
    Leaf& l = lines_.leaves[i];
    if (l.certain != 0) continue;
    l.mean->enter(a, b_);
    l.sigma->enter(a, b_);
    LeafPoint& p = from_.leaf[i];
    if (l.new_piece && p.known) p = lines_.combine(l, a, p.g, p.dg);
    l.new_piece = false;
    lines_.point(to_, static_cast<int>(i));
  }
}

// As TreeMarch's.
void BlendMarch::leave_by_bounds(double a) {
  hit_.left = a;
  outside_ = true;
  tree_ = beyond_;
  beyond_ = nullptr;
  lines_.turn_inside_out(from_, to_);
}

void BlendMarch::advance() {
  leaving_ = false;
  for (Leaf& l : lines_.leaves) l.new_piece = l.certain == 0 && b_ == l.piece_end;
  for (std::size_t i = 0; i < lines_.noises.size(); ++i) {
    Noise& n = lines_.noises[i];
    if (!to_.noise[i].known) continue;
    n.line->stretches.back().end = b_;
    n.line->stretches.back().last_cell = n.cell;
    if (b_ == n.cell_end()) {
      ++n.cell;
      n.prepared = false;
    }
  }
  std::swap(from_, to_);
}

BlendMarch::Point BlendMarch::at(TreeSample& sample) {
  for (std::size_t i = 0; i < values_.size(); ++i) {
    const int sure = lines_.leaves[i].certain;
    values_[i] = sure != 0 ? sure * kInfinity : lines_.point(sample, static_cast<int>(i)).f;
  }
  Point p{sample.t, tree_->compose(values_.data(), weights_.data()), 0};
  for (std::size_t i = 0; i < values_.size(); ++i)
    if (weights_[i] > 0) p.df += weights_[i] * sample.leaf[i].df;
  return p;
}

BlendMarch::Enclosure BlendMarch::enclose(TreeSample& a, TreeSample& b) {
  const double h = b.t - a.t;
  for (std::size_t i = 0; i < leaf_.size(); ++i) {
    if (const int sure = lines_.leaves[i].certain; sure != 0) {
      leaf_[i] = {sure * kInfinity, sure * kInfinity, 0, 0};
      continue;
    }
    const LeafPoint &p = lines_.point(a, static_cast<int>(i)),
                    &q = lines_.point(b, static_cast<int>(i));
    // The cubic by Bernstein's coefficients. The leaf differs from it by less than
    // margin (B₁ + B₂), which is at most 3/4 and has a slope of at most 3/h; twice that for what
    // is no parabola.
    const double margin = lines_.margin(static_cast<int>(i), p, q);
    const double c1 = p.f + h * p.df / 3, c2 = q.f - h * q.df / 3, middle = 3 * (c2 - c1) / h;
    const auto [low, high] = std::minmax({p.f, c1, c2, q.f});
    const auto [slope_low, slope_high] = std::minmax({p.df, middle, q.df});
    leaf_[i] = {low - 0.75 * margin, high + 0.75 * margin, slope_low - 6 * margin / h,
                slope_high + 6 * margin / h};
  }
  return enclose(tree_->root());
}

BlendMarch::Enclosure BlendMarch::enclose(int node) const {
  const ProcessTree::Node& n = tree_->nodes()[node];
  if (n.kind == ProcessTree::Kind::leaf) return leaf_[n.leaf];
  // The greatest is the least of the negated.
  const double sign = n.kind == ProcessTree::Kind::least ? 1 : -1;
  const auto turned = [&](const Enclosure& e) {
    return sign > 0 ? e : Enclosure{-e.high, -e.low, -e.slope_high, -e.slope_low};
  };
  const double blend = n.blend;
  const auto least = [blend](double x, double y) {
    const double overlap = blend > 0 ? std::max(blend - std::abs(x - y), 0.0) : 0.0;
    return std::min(x, y) - (overlap > 0 ? overlap * overlap / (4 * blend) : 0);
  };
  // ∂/∂x of that, of d = x - y.
  const auto weight = [blend](double d) {
    return blend > 0 ? std::clamp(0.5 - d / (2 * blend), 0.0, 1.0) : d < 0 ? 1.0 : 0.0;
  };
  Enclosure x = turned(enclose(n.children[0]));
  for (std::size_t k = 1; k < n.children.size(); ++k) {
    const Enclosure y = turned(enclose(n.children[k]));
    if (x.high == -kInfinity || y.low == kInfinity) continue;
    if (y.high == -kInfinity || x.low == kInfinity) {
      x = y;
      continue;
    }
    const double most = weight(x.low - y.high), fewest = weight(x.high - y.low);
    const auto mixed = [](double w, double s, double t) { return w * s + (1 - w) * t; };
    x = {least(x.low, y.low), least(x.high, y.high),
         std::min(mixed(most, x.slope_low, y.slope_low), mixed(fewest, x.slope_low, y.slope_low)),
         std::max(mixed(most, x.slope_high, y.slope_high),
                  mixed(fewest, x.slope_high, y.slope_high))};
  }
  return turned(x);
}

// The first root of F in (a, b]; F >= 0 at a.
bool BlendMarch::search(TreeSample& a, TreeSample& b, int depth) {
  const double h = b.t - a.t;
  const bool leaves = leaving_ && a.t == 0;
  Point p = at(a);
  const Point q = at(b);
  if (leaves) p.f = 0;
  const Enclosure e = enclose(a, b);
  if (p.f <= 0) {
    if (e.slope_low > 0) return false;  // it rises from 0
    if (!leaves && e.slope_high < 0) {
      hit(a);
      return true;
    }
  } else {
    const double low = std::max(
        {e.low, p.f + h * std::min(e.slope_low, 0.0), q.f - h * std::max(e.slope_high, 0.0)});
    if (low > 0) return false;
    if (e.slope_high < 0) {
      if (q.f > 0) return false;
      refine(p, q);
      return true;
    }
  }
  double resolution = 1e-14 * std::abs(b.t);
  for (const Noise& n : lines_.noises)
    if (n.current && std::isfinite(n.step)) resolution = std::max(resolution, 2e-10 * n.step);
  if (depth >= kMaxDepth || !(h > resolution)) {
    ++counters_->line_split_limit;
    if (!(q.f < 0)) return false;
    hit(b);
    return true;
  }
  ++counters_->line_splits;
  TreeSample& middle = middles_[depth];
  middle.reset(a.t + 0.5 * h, lines_.noises.size(), lines_.leaves.size());
  return search(a, middle, depth + 1) || search(middle, b, depth + 1);
}

// Newton inside a bracket where F falls.
void BlendMarch::refine(Point lo, Point hi) {
  double resolution = 4e-16 * std::abs(hi.t);
  for (const Noise& n : lines_.noises)
    if (n.current && std::isfinite(n.step)) resolution = std::max(resolution, 2e-11 * n.step);
  double x = cubic_root(lo, hi);
  for (int i = 0; i < 80; ++i) {
    if (!(x > lo.t && x < hi.t)) x = 0.5 * (lo.t + hi.t);
    here_.reset(x, lines_.noises.size(), lines_.leaves.size());
    const Point p = at(here_);
    (p.f > 0 ? lo : hi) = p;
    const double step = -p.f / p.df;
    if (hi.t - lo.t <= resolution || (p.df < 0 && std::abs(step) <= resolution)) break;
    x = i < 40 && p.df < 0 ? x + step : 0.5 * (lo.t + hi.t);
  }
  hit(here_);
}

// The leaf that was hit is the one that F is most of.
void BlendMarch::hit(TreeSample& sample) {
  const Point p = at(sample);
  std::size_t leaf = 0;
  for (std::size_t i = 1; i < weights_.size(); ++i)
    if (weights_[i] > weights_[leaf]) leaf = i;
  hit_.t = p.t;
  hit_.leaf = static_cast<int>(leaf);
  const LeafPoint& found = lines_.point(sample, hit_.leaf);
  const Leaf& l = lines_.leaves[leaf];
  l.line->hit_t = found.t;
  l.line->hit_value = l.sign * found.f;
  l.line->hit_g = found.g;
  l.line->hit_dg = found.dg;
  l.line->hit_mean = l.mean->sample(found.t);
  l.line->hit_sigma = l.sigma->sample(found.t);
  for (std::size_t i = 0; i < lines_.noises.size(); ++i) {
    const Noise& n = lines_.noises[i];
    if (!to_.noise[i].known) continue;
    n.line->stretches.back().end = b_;
    n.line->stretches.back().last_cell = n.cell;
  }
  if (!(p.df < 0)) ++counters_->line_slope_floor;
}

}  // namespace gpis

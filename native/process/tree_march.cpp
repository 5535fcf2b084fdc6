#include "process/tree_march.h"

#include "process/bracket.h"

namespace gpis {

TreeHit TreeMarch::first_hit(const ProcessTree& tree, const ProcessTree* beyond,
                             std::span<const PlannedLine* const> plans,
                             const LineGeometry& geometry, std::span<Line> lines, double t_max,
                             std::span<const Start> starts, Rng& rng, Counters& counters) {
  tree_ = &tree;
  beyond_ = beyond;
  rng_ = &rng;
  counters_ = &counters;
  hit_ = {};
  lines_.reset(tree, plans, geometry, lines, t_max, rng, counters);
  for (Level& level : levels_) level.sign.resize(lines_.leaves.size());
  from_.reset(0, lines_.noises.size(), lines_.leaves.size());
  outside_ = true;
  start(starts);
  march(t_max);
  lines_.finish();
  return hit_;
}

bool TreeMarch::march(double t_end) {
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
    const int sign = step_over(a, t_end);
    if (outside_) {
      if (sign <= 0 && search(from_, to_, 0)) return true;
    } else {
      // Inside (definitions E8 has only changes from outside): wait until the ray is out.
      outside_ = sign > 0 || (sign == 0 && sign_here(to_) > 0);
    }
    if (!(b_ < t_end)) return false;
    advance();
    a = b_;
  }
  ++counters_->line_step_limit;
  return false;
}

// Evaluates the step from a to b_ as far as it takes to know the sign of F over it.
int TreeMarch::step_over(double a, double t_end) {
  for (Noise& n : lines_.noises) n.current = false;
  for (Leaf& l : lines_.leaves)
    if (l.engaged) lines_.noises[l.noise].current = true;
  bool engaged = false;
  for (;;) {
    grew_ = false;
    b_ = t_end;
    for (Leaf& l : lines_.leaves) {
      if (l.certain != 0) b_ = std::min(b_, l.until);
      if (!l.engaged) continue;
      Noise& n = lines_.noises[l.noise];
      if (!n.prepared) n.path->prepare(n.cell, *rng_, *counters_);
      n.prepared = true;
      b_ = std::min(b_, lines_.step_end(l, a));
    }
    // Nothing ends the step: steps that double end it.
    if (!(b_ < kInfinity)) b_ = a + 1 + a;
    for (std::size_t i = 0; i < lines_.leaves.size(); ++i) {
      Leaf& l = lines_.leaves[i];
      if (!l.engaged) continue;
      l.mean->enter(a, b_);
      l.sigma->enter(a, b_);
      LeafPoint& p = from_.leaf[i];
      if (l.new_piece && p.known) p = lines_.combine(l, a, p.g, p.dg);
      l.new_piece = false;
    }
    to_.reset(b_, lines_.noises.size(), lines_.leaves.size());
    std::vector<int>& signs = levels_[0].sign;
    for (std::size_t i = 0; i < signs.size(); ++i) signs[i] = lines_.leaves[i].certain;
    const int sign = tree_->sign(tree_->root(), [&](int i) {
      if (signs[i] != 0 || grew_) return signs[i];
      if (!lines_.leaves[i].engaged) {
        // Drawn before it matters, it would not be drawn jointly with what it matters with (C7).
        if (!lines_.matters(*tree_, tree_->root(), i)) return signs[i] = 1;
        engage(i, a);
        engaged = grew_ = true;
        return 0;
      }
      return sign_over(i, signs, from_, to_);
    });
    if (grew_) continue;
    const bool leaving = leaving_by_bounds(a);
    if ((engaged || leaving) && outside_ && sign_here(from_) < 0) {
      if (leaving) {
        leave_by_bounds(a);
        for (int& s : signs) s = -s;
        return -sign;
      }
      outside_ = false;
      ++counters_->line_entry_inside;
    }
    return sign;
  }
}

// Where a ray from inside is at the end of the bounds of what it was in there is no surface
// (definitions B4): it goes on outside of the body, along the same paths.
void TreeMarch::leave_by_bounds(double a) {
  hit_.left = a;
  outside_ = true;
  tree_ = beyond_;
  beyond_ = nullptr;
  lines_.turn_inside_out(from_, to_);
}

// On to the end of the step; leaves that it did not take are left behind.
void TreeMarch::advance() {
  for (std::size_t i = 0; i < lines_.leaves.size(); ++i) {
    Leaf& l = lines_.leaves[i];
    l.engaged = to_.leaf[i].known;
    l.new_piece = b_ == l.piece_end;
  }
  for (std::size_t i = 0; i < lines_.noises.size(); ++i) {
    Noise& n = lines_.noises[i];
    if (!n.current || !to_.noise[i].known) continue;
    n.line->stretches.back().end = b_;
    n.line->stretches.back().last_cell = n.cell;
    if (b_ == n.cell_end()) {
      ++n.cell;
      n.prepared = false;
    }
  }
  std::swap(from_, to_);
}

int TreeMarch::sign_over(int leaf, std::vector<int>& signs, TreeSample& a, TreeSample& b) {
  if (signs[leaf] == 0) signs[leaf] = certify(leaf, lines_.point(a, leaf), lines_.point(b, leaf));
  return signs[leaf];
}

// The sign that the leaf keeps on (a, b], by the Bernstein coefficients of its cubic.
int TreeMarch::certify(int leaf, const LeafPoint& a, const LeafPoint& b) const {
  const double h = b.t - a.t, margin = lines_.margin(leaf, a, b);
  const double c1 = a.f + h * a.df / 3, c2 = b.f - h * b.df / 3;
  if ((a.f > 0 || (a.f == 0 && a.df > 0)) && c1 > margin && c2 > margin && b.f > 0) return 1;
  if ((a.f < 0 || (a.f == 0 && a.df < 0)) && c1 < -margin && c2 < -margin && b.f < 0) return -1;
  return 0;
}

// Of F at a point, 0 where it is not known from what was evaluated; a root counts as where it
// leads.
int TreeMarch::sign_here(TreeSample& sample) const {
  return tree_->sign(tree_->root(), [&](int i) {
    if (lines_.leaves[i].certain != 0) return lines_.leaves[i].certain;
    const LeafPoint& p = sample.leaf[i];
    if (!p.known) return 0;
    const double s = p.f != 0 ? p.f : p.df;
    return s > 0 ? 1 : s < 0 ? -1 : 0;
  });
}

// The first root of F in (a, b]. A leaf with a certified sign keeps it in parts of the stretch, so
// no leaf is asked for in a part that the step has not evaluated.
bool TreeMarch::search(TreeSample& a, TreeSample& b, int depth) {
  std::vector<int>& signs = levels_[depth].sign;
  const int sign = tree_->sign(tree_->root(), [&](int i) { return sign_over(i, signs, a, b); });
  if (sign > 0) return false;
  if (sign < 0) return take(a);  // F is 0 at a and falls
  // Where the sign of F is that of one leaf, its own test serves.
  int only = -1;
  bool several = false;
  tree_->undecided(
      tree_->root(), [&](int i) { return signs[i]; },
      [&](int i) {
        if (only < 0) only = i;
        several = several || lines_.leaves[i].twin != lines_.leaves[only].twin;
      });
  Verdict verdict = Verdict::unclear;
  if (!several) {
    const LeafPoint &p = a.leaf[only], &q = b.leaf[only];
    if (p.f == 0 && p.df < 0) return take(a);
    if (rises_through_rounding(p, q, lines_.noises[lines_.leaves[only].noise].step)) return false;
    verdict = classify(p, q, lines_.margin(only, p, q));
  }
  if (verdict == Verdict::unclear) {
    const double h = b.t - a.t;
    const Noise& n = lines_.noises[lines_.leaves[only].noise];
    const double resolution = std::isinf(n.step) ? 0 : 2e-11 * n.step;
    if (depth + 1 < kMaxDepth && h > 10 * resolution && h > 1e-14 * std::abs(b.t)) {
      ++counters_->line_splits;
      TreeSample& middle = levels_[depth].middle;
      middle.reset(a.t + 0.5 * h, lines_.noises.size(), lines_.leaves.size());
      levels_[depth + 1].sign = signs;
      if (search(a, middle, depth + 1)) return true;
      levels_[depth + 1].sign = signs;
      return search(middle, b, depth + 1);
    }
    ++counters_->line_split_limit;
    // Leaves that change sign together: F has changed its own only if it is below 0 now; touching 0
    // is no hit.
    if (several) return sign_here(b) < 0 && take(b);
    verdict = b.leaf[only].f > 0 ? Verdict::none : Verdict::single;
  }
  if (verdict == Verdict::none) return false;
  refine(only, a.leaf[only], b.leaf[only]);
  return true;
}

// A root at a point that was evaluated.
bool TreeMarch::take(TreeSample& sample) {
  const int leaf = tree_
                       ->winner(tree_->root(),
                                [&](int i) {
                                  const LeafPoint& p = sample.leaf[i];
                                  const int sure = lines_.leaves[i].certain;
                                  return sure != 0 ? sure * kInfinity : p.known ? p.f : 0.0;
                                })
                       .leaf;
  hit(leaf, lines_.point(sample, leaf));
  return true;
}

// Newton inside a bracket, as March does it: on the leaf's own path.
void TreeMarch::refine(int leaf, const LeafPoint& lo, const LeafPoint& hi) {
  const Noise& n = lines_.noises[lines_.leaves[leaf].noise];
  double a = lo.t, b = hi.t;
  const double tolerance = (std::isinf(n.step) ? 0 : 2e-11 * n.step) + 4e-16 * std::abs(b);
  double x = cubic_root(lo, hi);
  LeafPoint p = hi;
  for (int i = 0; i < 80; ++i) {
    if (!(x > a && x < b)) x = 0.5 * (a + b);
    p = lines_.evaluate(leaf, x);
    (p.f > 0 ? a : b) = x;
    const double step = -p.f / p.df;
    if (b - a <= tolerance || (p.df < 0 && std::abs(step) <= tolerance)) break;
    x = i < 40 && p.df < 0 ? x + step : 0.5 * (a + b);
  }
  hit(leaf, p);
}

void TreeMarch::hit(int leaf, const LeafPoint& p) {
  hit_.t = std::max(p.t, 0.0);  // by rounding, where a start leads into the surface
  hit_.leaf = leaf;
  const Leaf& l = lines_.leaves[leaf];
  l.line->hit_t = hit_.t;
  l.line->hit_g = p.g;
  l.line->hit_dg = p.dg;
  l.line->hit_mean = l.mean->sample(p.t);
  l.line->hit_sigma = l.sigma->sample(p.t);
  for (std::size_t i = 0; i < lines_.noises.size(); ++i) {
    const Noise& n = lines_.noises[i];
    if (!n.current || !to_.noise[i].known) continue;
    n.line->stretches.back().end = b_;
    n.line->stretches.back().last_cell = n.cell;
  }
  if (!(p.df < 0)) ++counters_->line_slope_floor;
}

}  // namespace gpis

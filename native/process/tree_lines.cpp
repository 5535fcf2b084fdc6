#include "process/tree_lines.h"

#include <algorithm>

#include "field/above.h"
#include "field/constant_field.h"

namespace gpis {

void TreeLines::reset(const ProcessTree& tree, std::span<const PlannedLine* const> plans,
                      const LineGeometry& geometry, std::span<Line> lines, double t_max, Rng& rng,
                      Counters& counters) {
  geometry_ = geometry;
  rng_ = &rng;
  counters_ = &counters;
  const auto& [origin, direction] = geometry;
  const double speed = length(direction);
  leaves.resize(tree.leaves().size());
  noises.clear();
  noises.resize(tree.noises());
  for (std::size_t i = 0; i < leaves.size(); ++i) {
    const PlannedLine& plan = *plans[i];
    const GaussianProcess& process = *plan.process;
    Leaf& l = leaves[i] = {};
    l.plan = &plan;
    l.line = &lines[i].impl();
    l.sign = tree.leaves()[i].sign;
    l.noise = tree.leaves()[i].noise;
    l.lift = tree.leaves()[i].lift;
    l.twin = static_cast<int>(i);
    for (int j = l.twin - 1; j >= 0; --j) {
      const ProcessTree::Leaf &a = tree.leaves()[i], &b = tree.leaves()[j];
      if (a.process == b.process && a.sign == b.sign && (a.noise == b.noise || plan.sigma_max == 0))
        l.twin = j;
    }
    l.mean = process.mean->line(origin, direction);
    l.sigma = process.sigma->line(origin, direction);
    l.mean_varies = !dynamic_cast<const ConstantField*>(process.mean.get());
    l.sigma_varies = !dynamic_cast<const ConstantField*>(process.sigma.get());
    std::tie(l.t_begin, l.t_end) = clip(plan.bounds, origin, direction, 0, t_max);
    // As March has it.
    l.smooth_step = 0.25 * plan.smooth_scale / speed;
    l.mean_deviation = std::isinf(plan.smooth_scale)
                           ? 0
                           : 0.05 * std::pow(speed, 4) / std::pow(plan.smooth_scale, 3);
    l.mean_slope = plan.mean_lipschitz * speed;
    l.line->stretches.clear();
    l.line->hit_t = kInfinity;
    l.line->hit_value = 0;
    l.line->shared = nullptr;
    l.line->geometry = geometry;
    l.line->plan = &plan;
    l.line->inside = false;

    // A certain leaf sees nothing of a noise that it shares.
    if (plan.sigma_max == 0) {
      l.noise = static_cast<int>(noises.size());
      noises.emplace_back();
    }
    Noise& n = noises[l.noise];
    n.t_end = std::max(n.t_end, l.t_end);
    if (n.path) continue;
    n.line = l.line;
    n.path = plan.line_sampler->noise(*l.line);
  }
}

void TreeLines::finish() {
  bool drawn = false;
  for (const Noise& n : noises) drawn = drawn || n.begun;
  ++(drawn ? counters_->line_segments : counters_->line_skipped);
  for (Leaf& l : leaves) {
    const Noise& n = noises[l.noise];
    if (n.line == l.line) continue;
    l.line->shared = n.line;
  }
}

void TreeLines::reset_noise(Noise& n, double anchor) {
  n.line->anchor = anchor;
  n.path->reset(geometry_, anchor, n.t_end, *counters_);
  n.step = n.path->step();
  n.cell = 0;
  n.prepared = false;
}

void TreeLines::resume(Noise& n, double a) {
  n.cell = std::isinf(n.step) ? 0 : static_cast<long>(std::floor((a - n.line->anchor) / n.step));
  if (!(n.cell_end() > a)) ++n.cell;
  n.path->prepare(n.cell, *rng_, *counters_);
  n.prepared = n.current = true;
  n.line->stretches.push_back({a, a, n.cell});
}

void TreeLines::enter(Leaf& l, double a) {
  l.piece_end = std::min(l.mean->next_break(a), l.sigma->next_break(a));
  const double b = l.piece_end < kInfinity ? l.piece_end : a + 1;
  l.mean->enter(a, b);
  l.sigma->enter(a, b);
}

double TreeLines::step_end(Leaf& l, double a) const {
  l.piece_end = std::min(l.mean->next_break(a), l.sigma->next_break(a));
  return std::min({noises[l.noise].cell_end(), a + l.smooth_step, l.t_end, l.piece_end});
}

void TreeLines::look_ahead(Leaf& l, double a, const LeafPoint& here) {
  if (a < l.until) return;
  const int positive = l.sign > 0 ? 1 : -1;
  l.certain = 0;
  const auto certainly = [&](int sign, double until) {
    l.certain = sign;
    l.until = until;
    l.engaged = false;
  };
  if (a < l.t_begin) return certainly(positive, l.t_begin < l.t_end ? l.t_begin : kInfinity);
  if (!(a < l.t_end)) return certainly(positive, kInfinity);
  const Noise& n = noises[l.noise];
  // What is gained must be worth a gap: a step of the path, or about what that would be.
  double least = n.begun ? n.step : 0;
  if (!n.begun && l.looked)
    least = 0.25 * l.plan->process->kernel->min_length_scale() / length(geometry_.direction);
  l.looked = true;
  // Right after a start the value and slope it was told may hold f off where the prior alone says
  // (B13).
  const double pull = n.begun ? n.path->pull(a) : l.plan->condition_pull;
  const double threshold = l.plan->skip_threshold + l.plan->sigma_max * pull + l.lift;
  if (!here.known || here.mean > threshold) {
    const double clear = l.mean->above_until(a, l.t_end, threshold);
    if (clear >= l.t_end) return certainly(positive, kInfinity);
    if (clear > a + least) return certainly(positive, clear);
  }
  // Certainly inside: of use where the leaf is subtracted or intersected. Behind its bounds it is
  // absent. `pull` tells nothing of values held up: only without a start of its own.
  if (n.conditioned || l.plan->condition_pull > 0 || !(l.mean_slope < kInfinity) ||
      (here.known && here.mean > -threshold))
    return;
  const Field& mean = *l.plan->process->mean;
  const double inside = above_by_lipschitz(
      [&](double t) { return -mean.value(geometry_.origin + geometry_.direction * t); },
      l.mean_slope, a, l.t_end, threshold);
  if (inside > a + least) certainly(-positive, inside);
}

TreeLines::Stretch TreeLines::certain(const ProcessTree& tree, int node) const {
  const ProcessTree::Node& n = tree.nodes()[node];
  if (n.kind == ProcessTree::Kind::leaf) return {leaves[n.leaf].certain, leaves[n.leaf].until};
  const int dominant = n.kind == ProcessTree::Kind::least ? -1 : 1;
  Stretch dominated{0, 0}, all{-dominant, kInfinity};
  for (const int child : n.children) {
    const Stretch s = certain(tree, child);
    if (s.sign == dominant) dominated = {dominant, std::max(dominated.until, s.until)};
    if (s.sign != -dominant) all.sign = 0;
    all.until = std::min(all.until, s.until);
  }
  return dominated.sign != 0 ? dominated : all;
}

// Bounds let a ray into the certain inside of random leaves, by their face or at a camera between
// them. Where f is drawn first it is drawn outside (definitions B4), in a tree as alone: what is
// certain of as many leaves as F > 0 takes, the least deep first, is taken back, and of those that
// are about as likely.
void TreeLines::enter_outside(const ProcessTree& tree, double a, Stretch& sure) {
  struct Inside {
    double depth;  // squared, in deviations: P(f > 0) ~ exp(-depth / 2)
    Leaf* leaf;
  };
  std::vector<Inside> all;
  for (Leaf& l : leaves) {
    const bool inside = l.certain == (l.sign > 0 ? -1 : 1);
    if (!inside || noises[l.noise].begun || l.plan->sigma_max == 0) continue;
    enter(l, a);
    const LeafPoint p = combine(l, a, 0, 0);
    if (p.sigma > 0) all.push_back({(p.mean / p.sigma) * (p.mean / p.sigma), &l});
  }
  std::sort(all.begin(), all.end(), [](auto& x, auto& y) { return x.depth < y.depth; });
  double taken = 0;
  for (const auto& [depth, l] : all) {
    const double skip = l->plan->skip_threshold / l->plan->sigma_max;
    if (sure.sign >= 0 && depth > taken + skip * skip) break;
    l->certain = 0;
    l->until = -kInfinity;
    taken += depth;
    if (sure.sign < 0) sure = certain(tree, tree.root());
  }
}

bool TreeLines::matters(const ProcessTree& tree, int node, int leaf) const {
  const ProcessTree::Node& n = tree.nodes()[node];
  if (n.kind == ProcessTree::Kind::leaf) return n.leaf == leaf;
  const int dominant = n.kind == ProcessTree::Kind::least ? -1 : 1;
  const auto above = [&](int child) { return matters(tree, child, leaf); };
  const auto decides = [&](int child) { return certain(tree, child).sign == dominant; };
  return std::any_of(n.children.begin(), n.children.end(), above) &&
         std::none_of(n.children.begin(), n.children.end(), decides);
}

bool TreeLines::complement_ends(double a) const {
  return std::any_of(leaves.begin(), leaves.end(), [a](const Leaf& l) {
    return l.sign < 0 && l.t_begin < l.t_end && l.t_end == a;
  });
}

void TreeLines::turn_inside_out(TreeSample& sample, TreeSample& other) {
  for (Leaf& l : leaves) {
    l.sign = -l.sign;
    l.certain = -l.certain;
  }
  for (TreeSample* s : {&sample, &other})
    for (LeafPoint& p : s->leaf) {
      p.f = -p.f;
      p.df = -p.df;
    }
}

bool TreeLines::skip_certain(const ProcessTree& tree, TreeSample& from, double& a, bool& outside,
                             bool leaving) {
  for (std::size_t i = 0; i < leaves.size(); ++i) look_ahead(leaves[i], a, from.leaf[i]);
  Stretch sure = certain(tree, tree.root());
  if (sure.sign < 0 && outside && !leaving) enter_outside(tree, a, sure);
  if (sure.sign == 0) return false;
  // Inside of what has no deviation: the camera is, or bounds cut it or a subtracted leaf off.
  // Where a ray inside a body leaves its bounds, there is no surface to count (B4).
  const bool solid = std::any_of(leaves.begin(), leaves.end(),
                                 [](const Leaf& l) { return l.sign > 0 && l.certain < 0; });
  if (sure.sign < 0 && outside && solid) ++counters_->line_entry_inside;
  outside = sure.sign > 0;
  a = sure.until;
  for (Leaf& l : leaves) l.engaged = false;
  for (Noise& n : noises) n.current = false;
  from.reset(a, noises.size(), leaves.size());
  return true;
}

LeafPoint TreeLines::combine(const Leaf& l, double t, double g, double dg) {
  LeafPoint p;
  double dmean;
  l.mean->evaluate(t, p.mean, dmean);
  l.sigma->evaluate(t, p.sigma, p.dsigma);
  p.known = true;
  p.t = t;
  p.g = g;
  p.dg = dg;
  p.f = l.sign * (p.mean + p.sigma * g);
  p.df = l.sign * (dmean + p.dsigma * g + p.sigma * dg);
  ++counters_->line_evaluations;
  counters_->mean_lookups += l.mean_varies;
  counters_->sigma_lookups += l.sigma_varies;
  return p;
}

void TreeLines::noise_at(Noise& n, double t, double& g, double& dg) {
  if (t == n.cell_end()) {
    n.path->at_right(n.cell, g, dg);
  } else {
    n.path->at(n.cell, t, *rng_, g, dg);
  }
}

LeafPoint TreeLines::evaluate(int leaf, double t) {
  double g, dg;
  noise_at(noises[leaves[leaf].noise], t, g, dg);
  return combine(leaves[leaf], t, g, dg);
}

const LeafPoint& TreeLines::point(TreeSample& sample, int leaf) {
  LeafPoint& p = sample.leaf[leaf];
  if (p.known) return p;
  const Leaf& l = leaves[leaf];
  TreeSample::NoisePoint& n = sample.noise[l.noise];
  if (!n.known) {
    noise_at(noises[l.noise], sample.t, n.g, n.dg);
    n.known = true;
  }
  return p = combine(l, sample.t, n.g, n.dg);
}

double TreeLines::margin(int leaf, const LeafPoint& a, const LeafPoint& b) const {
  const Leaf& l = leaves[leaf];
  const double h = b.t - a.t;
  const double sigma = std::max(a.sigma, b.sigma) + std::abs(b.dsigma - a.dsigma) * h;
  return l.plan->caution * noises[l.noise].path->deviation(a.t, h) * sigma +
         l.mean_deviation * (h * h) * (h * h);
}

}  // namespace gpis

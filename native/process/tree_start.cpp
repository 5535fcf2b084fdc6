// What the leaves of a tree start with: what the path remembers of them (definitions B1-B3), or
// fresh draws on condition that F > 0 where they are drawn (B2, B4, formulas C7).
#include "process/path_start.h"
#include "process/tree_march.h"

namespace gpis {
namespace {

// ln(e^x + e^y).
double log_sum(double x, double y) {
  const double high = std::max(x, y), low = std::min(x, y);
  return low == -kInfinity ? high : high + std::log1p(std::exp(low - high));
}

// A root counts as where it leads.
int sign_of(const LeafPoint& p) {
  return (p.f != 0 ? p.f : p.df) > 0 ? 1 : -1;
}

// ln P(low < Z < high).
double log_normal_between(double low, double high) {
  if (!(low < high)) return -kInfinity;
  if (high <= 0) return log_normal_between(-high, -low);
  if (low >= 0) {
    const double tail = log_normal_tail(low);
    return tail + std::log1p(-std::exp(log_normal_tail(high) - tail));
  }
  return std::log1p(-std::exp(log_normal_tail(-low)) - std::exp(log_normal_tail(high)));
}

// ln P(low < g < high) at the anchor of a path.
double log_mass(const LineNoise& path, double low, double high) {
  const double mean = path.value_mean(), deviation = path.value_deviation();
  if (!(deviation > 0)) return low < mean && mean < high ? 0 : -kInfinity;
  return log_normal_between((low - mean) / deviation, (high - mean) / deviation);
}

}  // namespace

void TreeMarch::start(std::span<const Start> starts) {
  for (std::size_t k = 0; k < lines_.noises.size(); ++k) {
    // Leaves of one noise remember the same g: the one that was hit tells it.
    int told = -1;
    for (std::size_t i = 0; i < lines_.leaves.size(); ++i) {
      Leaf& l = lines_.leaves[i];
      if (l.noise != static_cast<int>(k) || starts[i].kind == Start::Kind::outside) continue;
      if (!(l.t_begin < l.t_end)) continue;
      l.t_begin = 0;  // a start lies inside the bounds, whatever rounding says
      if (told < 0 || starts[i].state.value == 0) told = static_cast<int>(i);
    }
    if (told < 0) continue;
    start_noise(lines_.noises[k], told, starts[told]);
    for (std::size_t i = 0; i < lines_.leaves.size(); ++i) {
      Leaf& l = lines_.leaves[i];
      if (l.noise != static_cast<int>(k) || starts[i].kind == Start::Kind::outside) continue;
      if (!(l.t_begin < l.t_end)) continue;
      lines_.enter(l, 0);
      LeafPoint& p = from_.leaf[i];
      p = lines_.combine(l, 0, from_.noise[k].g, from_.noise[k].dg);
      p.f = l.sign * starts[i].state.value;
      if (static_cast<int>(i) == told && p.f == 0) leaving(p, l);
      l.engaged = true;
    }
  }
  if (sign_here(from_) < 0) {
    outside_ = false;
    ++counters_->line_entry_inside;
  }
}

void TreeMarch::start_noise(Noise& n, int leaf, const Start& start) {
  const Leaf& l = lines_.leaves[leaf];
  lines_.reset_noise(n, 0);
  lines_.enter(lines_.leaves[leaf], 0);
  const LeafPoint fields = lines_.combine(l, 0, 0, 0);
  TreeSample::NoisePoint& p = from_.noise[l.noise];
  p.known = true;
  if (fields.sigma > 0) {
    const PathStart known =
        path_start(start, 0, fields, l.sign * fields.df, l.sign, l.line->geometry.direction,
                   *n.path, *l.mean, *l.sigma, *rng_);
    p.g = known.value;
    p.dg = n.path->start(known, *rng_, *counters_);
    n.conditioned = true;
  } else {
    n.path->start_free(*rng_, *counters_, p.g, p.dg);
  }
  n.begun = n.current = true;
  n.line->stretches.push_back({0, 0, 0});
}

// As March::leaving.
void TreeMarch::leaving(LeafPoint& p, const Leaf& l) {
  const double floor = 1e-14 * (std::abs(p.mean) + p.sigma) / lines_.noises[l.noise].step;
  if (p.df > floor) return;
  p.df = floor;
  ++counters_->line_slope_floor;
}

// The leaf is to be evaluated from a on.
void TreeMarch::engage(int leaf, double a) {
  Leaf& l = lines_.leaves[leaf];
  Noise& n = lines_.noises[l.noise];
  l.engaged = true;
  l.new_piece = false;
  lines_.enter(l, a);
  if (!n.begun) {
    begin(l.noise, a);
  } else if (!n.current) {
    lines_.resume(n, a);
  }
}

// Draws g at a. The parts of its range are told apart by the signs of its leaves; one is chosen by
// its probability given F > 0 and all that is known, and g follows the truncated law in it. Noises
// that are drawn at one point after the other come out jointly. Where a ray inside is at the end of
// bounds it may be outside already (B4): there the draw is free, as that of a leaf was which came
// to be drawn before.
void TreeMarch::begin(int noise, double a) {
  Noise& n = lines_.noises[noise];
  lines_.reset_noise(n, a);
  const double mean = n.path->value_mean(), deviation = n.path->value_deviation();
  TreeSample::NoisePoint& p = from_.noise[noise];
  p.known = true;
  n.path->start_free(*rng_, *counters_, p.g, p.dg);
  n.line->stretches.push_back({a, a, 0});
  std::vector<Cut> cuts = std::move(cuts_);
  find_cuts(noise, a, cuts);
  const bool given = outside_ && !leaving_by_bounds(a);
  const int part = given && !cuts.empty() ? choose_part(noise, a, p.g, cuts) : -1;
  if (part >= 0 && deviation > 0) {
    const double low = part > 0 ? cuts[part - 1].g : -kInfinity;
    const double high = part < static_cast<int>(cuts.size()) ? cuts[part].g : kInfinity;
    // A draw that is in the part already follows its law.
    if (!(p.g > low && p.g < high)) {
      PathStart known;
      known.value = mean + deviation * truncated_normal((low - mean) / deviation,
                                                        (high - mean) / deviation, *rng_);
      ++counters_->truncated_normals;
      p.g = known.value;
      p.dg = n.path->start(known, *rng_, *counters_);
      n.conditioned = true;
    }
  }
  cuts_ = std::move(cuts);
  n.begun = n.current = true;  // only now is g what it will be
}

// Also settles in known_ the signs of all leaves that need no draw.
void TreeMarch::find_cuts(int noise, double a, std::vector<Cut>& cuts) {
  cuts.clear();
  known_.assign(lines_.leaves.size(), 0);
  for (std::size_t i = 0; i < lines_.leaves.size(); ++i) {
    Leaf& l = lines_.leaves[i];
    const Noise& n = lines_.noises[l.noise];
    if ((known_[i] = l.certain) != 0) continue;
    const bool random = l.plan->sigma_max > 0;
    // A path that was left behind: odds() brings it here if it matters.
    if (l.noise != noise && random && !n.current) continue;
    if (!l.engaged) lines_.enter(l, a);
    if (from_.leaf[i].known || (l.noise != noise && random)) {
      known_[i] = sign_of(lines_.point(from_, static_cast<int>(i)));
      continue;
    }
    const LeafPoint p = lines_.combine(l, a, 0, 0);
    if (p.sigma > 0) {
      cuts.push_back({-p.mean / p.sigma, static_cast<int>(i)});
    } else {
      known_[i] = p.f > 0 ? 1 : -1;
    }
  }
  std::sort(cuts.begin(), cuts.end(), [](const Cut& x, const Cut& y) { return x.g < y.g; });
}

// Of a leaf of the cuts where g lies between the cuts part - 1 and part; 0 for other leaves.
int TreeMarch::sign_in(const std::vector<Cut>& cuts, int part, int leaf) const {
  for (int k = 0; k < static_cast<int>(cuts.size()); ++k)
    if (cuts[k].leaf == leaf) return (part > k) == (lines_.leaves[leaf].sign > 0) ? 1 : -1;
  return 0;
}

// -1: F > 0 says nothing of g, or cannot be had.
int TreeMarch::choose_part(int noise, double a, double g, const std::vector<Cut>& cuts) {
  const int parts = static_cast<int>(cuts.size()) + 1;
  const bool met = lines_.noises[noise].path->met_before();
  int possible = 0, last = -1, sure = 0;
  for (int part = 0; part < parts; ++part) {
    const int s = tree_->sign(
        tree_->root(), [&](int i) { return known_[i] != 0 ? known_[i] : sign_in(cuts, part, i); });
    if (s < 0) continue;
    // A realisation that the path knows is moved only where it cannot be.
    if (met && (part == 0 || cuts[part - 1].g < g) && (part + 1 == parts || g < cuts[part].g))
      return part;
    ++possible;
    sure += s > 0;
    last = part;
  }
  if (possible == 0 || sure == parts) return -1;
  if (possible == 1) return last;

  const LineNoise& path = *lines_.noises[noise].path;
  std::vector<double> weight(parts);
  double best = -kInfinity;
  const std::vector<int> known = known_;
  for (int part = 0; part < parts; ++part) {
    known_ = known;
    for (const Cut& cut : cuts) known_[cut.leaf] = sign_in(cuts, part, cut.leaf);
    const double low = part > 0 ? cuts[part - 1].g : -kInfinity;
    const double high = part + 1 < parts ? cuts[part].g : kInfinity;
    weight[part] = log_mass(path, low, high) + odds(tree_->root(), a).above;
    best = std::max(best, weight[part]);
  }
  known_ = known;
  if (best == -kInfinity) return -1;
  double sum = 0;
  for (double& w : weight) sum += w = std::exp(w - best);
  double u = rng_->uniform() * sum;
  int part = 0;
  while (part + 1 < parts && u >= weight[part]) u -= weight[part++];
  return part;
}

// C7, in logarithms: bounds may be entered a thousand deviations inside.
TreeMarch::Odds TreeMarch::odds(int node, double a) {
  const ProcessTree::Node& n = tree_->nodes()[node];
  const auto sign_of_leaf = [&](int i) { return known_[i]; };
  const int sure = tree_->sign(node, sign_of_leaf);
  if (sure != 0) return sure > 0 ? Odds{0, -kInfinity} : Odds{-kInfinity, 0};
  if (n.noise < 0) {
    const bool least = n.kind == ProcessTree::Kind::least;
    Odds all{0, 0};  // `all` above (least) or below: the product of the children
    double& product = least ? all.above : all.below;
    double& rest = least ? all.below : all.above;
    rest = -kInfinity;
    for (const int child : n.children) {
      Odds o = odds(child, a);
      if (!least) std::swap(o.above, o.below);
      rest = log_sum(rest, product + o.below);
      product += o.above;
    }
    return all;
  }
  // One noise below. A path that was left behind: where it is now.
  Noise& noise = lines_.noises[n.noise];
  if (noise.begun) {
    for (std::size_t i = 0; i < lines_.leaves.size(); ++i) {
      if (lines_.leaves[i].noise != n.noise || known_[i] != 0) continue;
      if (!lines_.leaves[i].engaged) engage(static_cast<int>(i), a);
      known_[i] = sign_of(lines_.point(from_, static_cast<int>(i)));
    }
    return odds(node, a);
  }
  lines_.reset_noise(noise, a);
  std::vector<Cut> cuts;
  const std::vector<int> known = known_;
  find_cuts(n.noise, a, cuts);
  Odds sum{-kInfinity, -kInfinity};
  for (int part = 0; part <= static_cast<int>(cuts.size()); ++part) {
    const double low = part > 0 ? cuts[part - 1].g : -kInfinity;
    const double high = part < static_cast<int>(cuts.size()) ? cuts[part].g : kInfinity;
    const double mass = log_mass(*noise.path, low, high);
    const int s = tree_->sign(
        node, [&](int i) { return known_[i] != 0 ? known_[i] : sign_in(cuts, part, i); });
    double& side = s > 0 ? sum.above : sum.below;
    side = log_sum(side, mass);
  }
  known_ = known;
  return sum;
}

}  // namespace gpis

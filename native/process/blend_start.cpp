// What the leaves under a smooth union start with: what the path remembers of them (definitions
// B1-B3), or draws of all of them at once on condition that F > 0 (B2, B4).
#include "process/blend_march.h"
#include "process/path_start.h"

namespace gpis {

void BlendMarch::start(std::span<const Start> starts) {
  bool any = false;
  forgotten_.clear();
  for (std::size_t i = 0; i < lines_.leaves.size(); ++i) {
    Leaf& l = lines_.leaves[i];
    const bool known = starts[i].kind != Start::Kind::outside && l.t_begin < l.t_end;
    if (known) l.t_begin = 0;  // a start lies inside the bounds, whatever rounding says
    any |= known;
    if (!(l.t_begin <= 0 && l.t_end > 0)) {
      values_[i] = l.sign * kInfinity;
    } else if (known) {
      values_[i] = l.sign * starts[i].state.value;
    } else {  // what was not drawn at the start is far from the surface there, or forgotten
      lines_.enter(l, 0);
      const double mean = lines_.combine(l, 0, 0, 0).f;
      values_[i] = mean > 0 ? kInfinity : -kInfinity;
      if (std::abs(mean) <= l.plan->skip_threshold + l.lift) forgotten_.push_back(i);
    }
  }
  if (!any) return;
  // Values of f, whose rounding is that of the means; at a hit they are what its root leaves.
  double size = 0;
  for (std::size_t i = 0; i < values_.size(); ++i) {
    if (std::isfinite(values_[i])) size += std::abs(values_[i]);
    if (std::isfinite(lines_.leaves[i].plan->sigma_max)) size += lines_.leaves[i].plan->sigma_max;
  }
  for (const ProcessTree::Node& n : tree_->nodes()) size += n.blend;
  double f = tree_->compose(values_.data(), weights_.data());
  // A forgotten leaf (B2) that would decide F was on the side on which it did not.
  for (std::size_t turned = 0; turned < forgotten_.size() && std::isinf(f); ++turned)
    for (std::size_t& i : forgotten_) {
      if (!(weights_[i] > 0) || !std::isinf(values_[i])) continue;
      values_[i] = -values_[i];
      f = tree_->compose(values_.data(), weights_.data());
      break;
    }
  leaving_ = std::abs(f) <= 1e-9 * size;
  slope_mean_.assign(lines_.noises.size(), 0);
  slope_deviation_.assign(lines_.noises.size(), 0);
  slope_weight_.assign(lines_.noises.size(), 0);
  for (std::size_t k = 0; k < lines_.noises.size(); ++k) tell(starts, static_cast<int>(k));
  if (leaving_) weigh_slopes(starts);
  for (std::size_t k = 0; k < lines_.noises.size(); ++k) {
    Noise& n = lines_.noises[k];
    TreeSample::NoisePoint& p = from_.noise[k];
    if (p.known && slope_deviation_[k] > 0) {
      PathStart known;
      known.value = p.g;
      known.slope = p.dg;
      known.slope_known = true;
      p.dg = n.path->start(known, *rng_, *counters_);
    }
  }
  for (std::size_t i = 0; i < lines_.leaves.size(); ++i) {
    Leaf& l = lines_.leaves[i];
    if (!from_.noise[l.noise].known || starts[i].kind == Start::Kind::outside ||
        !(l.t_begin < l.t_end))
      continue;
    from_.leaf[i] = lines_.combine(l, 0, from_.noise[l.noise].g, from_.noise[l.noise].dg);
    from_.leaf[i].f = l.sign * starts[i].state.value;
  }
  if (!leaving_ && f < 0) {
    outside_ = false;
    ++counters_->line_entry_inside;
  }
}

// A noise from what is remembered of a leaf that was hit, whose gradient the path follows, and of
// those of the one that sees most of it. Where the value alone is remembered, its slope is left
// open (slope_deviation_ > 0) for weigh_slopes.
void BlendMarch::tell(std::span<const Start> starts, int noise) {
  int told = -1;
  double most = -1;
  bool of_hit = false;
  LeafPoint fields;
  for (std::size_t i = 0; i < lines_.leaves.size(); ++i) {
    Leaf& l = lines_.leaves[i];
    if (l.noise != noise || starts[i].kind == Start::Kind::outside || !(l.t_begin < l.t_end))
      continue;
    lines_.enter(l, 0);
    const LeafPoint p = lines_.combine(l, 0, 0, 0);
    const bool hit = leaving_ && weights_[i] > 0 && p.sigma > 0;
    if (hit < of_hit || (hit == of_hit && !(p.sigma > most))) continue;
    most = p.sigma;
    of_hit = hit;
    told = static_cast<int>(i);
    fields = p;
  }
  if (told < 0) return;
  Noise& n = lines_.noises[noise];
  const Leaf& l = lines_.leaves[told];
  const Start& start = starts[told];
  lines_.reset_noise(n, 0);
  TreeSample::NoisePoint& p = from_.noise[noise];
  p.known = true;
  n.begun = n.current = true;
  n.line->stretches.push_back({0, 0, 0});
  if (!(fields.sigma > 0)) {
    n.path->start_free(*rng_, *counters_, p.g, p.dg);
    return;
  }
  n.conditioned = true;
  if (start.kind == Start::Kind::value_slope) {
    const PathStart known =
        path_start(start, 0, fields, l.sign * fields.df, l.sign, l.line->geometry.direction,
                   *n.path, *l.mean, *l.sigma, *rng_);
    p.g = known.value;
    p.dg = n.path->start(known, *rng_, *counters_);
    return;
  }
  p.g = (start.state.value - fields.mean) / fields.sigma;
  n.path->slope_law(p.g, slope_mean_[noise], slope_deviation_[noise]);
  p.dg = slope_mean_[noise] + slope_deviation_[noise] * rng_->normal();
  if (slope_deviation_[noise] > 0) return;
  PathStart known;
  known.value = p.g;
  p.dg = n.path->start(known, *rng_, *counters_);
}

// B3 for F = 0: its slope Σ wᵢ sᵢ fᵢ' follows the flux-weighted normal law, and given it the slopes
// of the noises are normal again.
void BlendMarch::weigh_slopes(std::span<const Start> starts) {
  double mean = 0, variance = 0, drawn = 0;
  for (std::size_t i = 0; i < lines_.leaves.size(); ++i) {
    Leaf& l = lines_.leaves[i];
    if (!(weights_[i] > 0) || starts[i].kind == Start::Kind::outside) continue;
    const TreeSample::NoisePoint& n = from_.noise[l.noise];
    const LeafPoint fixed = lines_.combine(l, 0, n.g, 0);
    const double by_noise = weights_[i] * l.sign * fixed.sigma;
    mean += weights_[i] * fixed.df;
    if (slope_deviation_[l.noise] > 0) {
      slope_weight_[l.noise] += by_noise;
    } else {
      mean += by_noise * n.dg;
    }
  }
  for (std::size_t k = 0; k < slope_weight_.size(); ++k) {
    const double s = slope_weight_[k] * slope_deviation_[k];
    mean += slope_weight_[k] * slope_mean_[k];
    drawn += slope_weight_[k] * (from_.noise[k].dg - slope_mean_[k]);
    variance += s * s;
  }
  if (!(variance > 0)) return;
  const double deviation = std::sqrt(variance);
  const double slope = deviation * flux_weighted_normal(mean / deviation, *rng_);
  const double by = (slope - mean - drawn) / variance;
  for (std::size_t k = 0; k < slope_weight_.size(); ++k)
    from_.noise[k].dg += slope_weight_[k] * slope_deviation_[k] * slope_deviation_[k] * by;
}

// All leaves that are not certain at a are evaluated from there on.
void BlendMarch::engage(double a) {
  for (std::size_t k = 0; k < lines_.noises.size(); ++k)
    lines_.noises[k].current = from_.noise[k].known;
  fresh_.clear();
  bool grew = false;
  for (Leaf& l : lines_.leaves) {
    if (l.certain != 0) continue;
    Noise& n = lines_.noises[l.noise];
    if (n.begun && !n.current) lines_.resume(n, a);
    if (!l.engaged) {
      lines_.enter(l, a);
      grew = true;
    }
    l.engaged = true;
    if (n.begun) continue;
    lines_.reset_noise(n, a);
    TreeSample::NoisePoint& p = from_.noise[l.noise];
    n.path->start_free(*rng_, *counters_, p.g, p.dg);
    n.line->stretches.push_back({a, a, 0});
    p.known = n.begun = n.current = true;
    fresh_.push_back(l.noise);
  }
  const bool by_bounds = leaving_by_bounds(a);
  if (!fresh_.empty() && !by_bounds) draw_outside();
  if ((grew || by_bounds) && outside_ && !(leaving_ && a == 0) && at(from_).f < 0) {
    if (by_bounds) return leave_by_bounds(a);
    outside_ = false;
    ++counters_->line_entry_inside;
  }
}

// Whether the leaves of the fresh noises may be as values_ has them: F > 0. At a start F is known
// already, and they are drawn on condition that they are no part of it.
bool BlendMarch::acceptable() {
  const double f = tree_->compose(values_.data(), weights_.data());
  if (!(leaving_ && from_.t == 0)) return f > 0;
  for (std::size_t i = 0; i < weights_.size(); ++i)
    if (weights_[i] > 0 && is_fresh(lines_.leaves[i].noise)) return false;
  return true;
}

bool BlendMarch::is_fresh(int noise) const {
  return std::find(fresh_.begin(), fresh_.end(), noise) != fresh_.end();
}

// Where g of a fresh noise may lie at all, the leaves of all other fresh noises being as far
// outside as can be: F grows with every leaf, so it is a half-line that bisection finds. False: it
// is empty. Leaves of one noise that grow and fall with it leave it unbounded.
bool BlendMarch::find_range(int noise, Range& range) {
  const LineNoise& path = *lines_.noises[noise].path;
  const double mean = path.value_mean(), deviation = path.value_deviation();
  double sense = 0;
  for (const Leaf& l : lines_.leaves) {
    if (l.noise != noise || l.certain != 0) continue;
    if (sense * l.sign < 0) return true;
    sense = l.sign > 0 ? 1 : -1;
  }
  if (sense == 0 || !(deviation > 0)) return true;
  const auto possible = [&](double g) {
    for (std::size_t i = 0; i < values_.size(); ++i) {
      const Leaf& l = lines_.leaves[i];
      values_[i] = l.certain != 0      ? l.certain * kInfinity
                   : l.noise == noise  ? lines_.combine(l, from_.t, g, 0).f
                   : is_fresh(l.noise) ? kInfinity
                                       : lines_.point(from_, static_cast<int>(i)).f;
    }
    return acceptable();
  };
  double best = mean + sense * kFarthest * deviation, worst = mean - sense * kFarthest * deviation;
  if (!possible(best)) return false;
  if (possible(worst)) return true;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (best + worst);
    (possible(middle) ? best : worst) = middle;
  }
  (sense > 0 ? range.low : range.high) = worst;
  return true;
}

// The fresh noises given that they are acceptable, by rejection of whole draws: their values were
// drawn freely. Where that is rare, each is drawn in the range in which it can be accepted at all.
void BlendMarch::draw_outside() {
  bool moved = false;
  std::vector<Range>& ranges = ranges_;
  ranges.assign(fresh_.size(), {});
  for (int draw = 0; outside_ && draw < kMostDraws; ++draw) {
    at(from_);  // fills values_
    if (acceptable()) break;
    moved = true;
    if (draw == kFreeDraws) {
      bool possible = true;
      for (std::size_t j = 0; j < fresh_.size(); ++j)
        possible = possible && find_range(fresh_[j], ranges[j]);
      if (!possible) break;
    }
    for (std::size_t j = 0; j < fresh_.size(); ++j) {
      const LineNoise& path = *lines_.noises[fresh_[j]].path;
      const double mean = path.value_mean(), deviation = path.value_deviation();
      if (!(deviation > 0)) continue;
      from_.noise[fresh_[j]].g =
          mean + deviation * truncated_normal((ranges[j].low - mean) / deviation,
                                              (ranges[j].high - mean) / deviation, *rng_);
    }
    for (std::size_t i = 0; i < lines_.leaves.size(); ++i)
      if (is_fresh(lines_.leaves[i].noise)) from_.leaf[i].known = false;
  }
  if (!moved) return;
  ++counters_->truncated_normals;
  for (const int k : fresh_) {
    Noise& n = lines_.noises[k];
    if (!(n.path->value_deviation() > 0)) continue;
    PathStart known;
    known.value = from_.noise[k].g;
    from_.noise[k].dg = n.path->start(known, *rng_, *counters_);
    n.conditioned = true;
  }
  for (std::size_t i = 0; i < lines_.leaves.size(); ++i)
    if (is_fresh(lines_.leaves[i].noise)) from_.leaf[i].known = false;
}

}  // namespace gpis

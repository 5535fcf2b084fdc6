#include "process/certain_cut.h"

#include <algorithm>
#include <cmath>

#include "process/path_start.h"

namespace gpis {
namespace {

// The leaves of a tree whose inner nodes are all `greatest`.
bool collect(const ProcessTree& tree, int node, std::vector<int>& leaves) {
  const ProcessTree::Node& n = tree.nodes()[node];
  if (n.kind == ProcessTree::Kind::leaf) {
    leaves.push_back(n.leaf);
    return true;
  }
  return n.kind == ProcessTree::Kind::greatest && n.blend == 0 &&
         std::all_of(n.children.begin(), n.children.end(),
                     [&](int child) { return collect(tree, child, leaves); });
}

// A new ray through the leaf, nothing of it drawn or hit.
Line::Impl& begin_ray(Line& line, const PlannedLine& plan, const LineGeometry& geometry) {
  Line::Impl& l = line.impl();
  l.stretches.clear();
  l.hit_t = kInfinity;
  l.hit_value = 0;
  l.inside = false;
  l.plan = &plan;
  l.shared = nullptr;
  l.geometry = geometry;
  return l;
}

}  // namespace

std::optional<CertainCut> CertainCut::of(const ProcessTree& tree,
                                         const std::vector<ProcessSurface>& leaves, Memory memory,
                                         Sampler sampler, std::string& why) {
  const auto is_certain = [&](int k) { return leaves[k].planned().sigma_max == 0; };
  std::vector<int> all;
  const bool greatest = collect(tree, tree.root(), all);
  why.clear();
  CertainCut cut;
  int random = 0;
  for (std::size_t k = 0; k < leaves.size(); ++k) {
    if (is_certain(static_cast<int>(k))) continue;
    cut.random_ = static_cast<int>(k);
    ++random;
  }
  if (random == static_cast<int>(leaves.size())) return {};
  if (!greatest || random != 1 || tree.leaves()[cut.random_].sign < 0) {
    why = "a cut takes one random process, intersected with certain ones or less them";
    return {};
  }
  const GaussianProcess& process = *leaves[cut.random_].planned().process;
  if (memory == Memory::global || memory == Memory::segments || sampler == Sampler::realisation) {
    why = "a cut takes paths that are drawn anew for every ray";
  } else if (tree.noises() < static_cast<int>(leaves.size())) {
    why = "a cut takes operands without shared noise";
  } else if (process.conditions || !(process.sigma->range().min > 0)) {
    why = "a cut takes a process without conditions whose deviation is nowhere 0";
  }
  for (const double sign : {1, -1})
    for (const int k : all) {
      if (k == cut.random_ || tree.leaves()[k].sign != sign) continue;
      const auto body = ConvexBody::of(*leaves[k].planned().process->mean);
      if (!body) {
        why = "a cut takes planes, boxes and spheres";
        return {};
      }
      cut.certain_.push_back({k, sign, *body});
    }
  if (!why.empty()) return {};
  return cut;
}

std::string CertainCut::describe() const {
  std::string list;
  for (const Certain& c : certain_) list += (list.empty() ? "" : ", ") + std::to_string(c.leaf);
  return "cut by certain operands (" + list + "), operand " + std::to_string(random_) +
         (alone_ ? " by a table (cut)" : " marched alone") + "; together on rays that see it twice";
}

std::vector<std::pair<std::string, std::string>> CertainCut::plan() const {
  if (!alone_) return {};
  const std::string operand = "operand " + std::to_string(random_);
  return {{"cut", operand + " by " + alone_->planned().sampler_reason + "; leaf[" +
                      std::to_string(random_) + "].sampler serves all other rays"}};
}

std::optional<CertainCut::Stretch> CertainCut::seen(const std::vector<ProcessSurface>& leaves,
                                                    const LineGeometry& geometry, double t_max,
                                                    std::span<const Start> starts) const {
  const auto& [o, d] = geometry;
  const Stretch nothing{0, 0};
  const bool known = starts[random_].kind != Start::Kind::outside;
  Stretch s{0, 0};
  std::tie(s.begin, s.end) = clip(leaves[random_].planned().bounds, o, d, 0, t_max);
  if (!(s.begin < s.end)) return nothing;
  if (known) s.begin = 0;  // a start lies inside the bounds, whatever rounding says

  bool by_bounds = false;
  const auto begin_at = [&](double t, int leaf, bool face) {
    s.begin = t;
    s.face = face ? leaf : kNoFace;
    by_bounds = !face;
  };
  for (const Certain& c : certain_) {
    auto [enter, leave] = c.body.inside(o, d);
    auto [present, absent] = clip(leaves[c.leaf].planned().bounds, o, d, 0, kInfinity);
    const Start& start = starts[c.leaf];
    if (start.kind != Start::Kind::outside && start.state.value == 0) {
      // The ray leaves its face, and a convex body: it does not come back, or leaves it behind
      // where it has crossed it.
      if (!(c.sign * dot(start.state.gradient, d) > 0)) return {};
      if (c.sign > 0) return nothing;
      if (!(leave > 0)) return {};
      enter = present = 0;
    }
    const double begin = std::max(enter, present), end = std::min(leave, absent);
    if (c.sign > 0) {
      if (!(begin < end)) return nothing;
      if (begin > s.begin) begin_at(begin, c.leaf, enter >= present);
      s.end = std::min(s.end, end);
    } else if (begin < end && begin < s.end && end > s.begin) {
      if (begin <= s.begin) {
        begin_at(end, c.leaf, leave <= absent);
      } else if (end < s.end) {
        return {};
      } else {
        s.end = begin;
      }
    }
    if (!(s.begin < s.end)) return nothing;
  }
  if (by_bounds || (known && s.begin > 0)) return {};
  return s;
}

// Behind a certain face nothing is known of the random leaf: it is inside there already with
// P(f <= 0) = Φ(-μ/σ), and F falls to 0 on the face itself. What was drawn of f is kept.
bool CertainCut::enters_inside(const std::vector<ProcessSurface>& leaves,
                               const LineGeometry& geometry, std::span<Line> lines,
                               const Stretch& seen, double t_max, Rng& rng,
                               Counters& counters) const {
  const PlannedLine& plan = leaves[random_].planned();
  const GaussianProcess& process = *plan.process;
  const auto& [o, d] = geometry;
  const Vec3 at = o + d * seen.begin;
  const double mean = process.mean->value(at);
  if (mean > plan.skip_threshold) return false;
  const double level = mean / process.sigma->value(at);
  if (!(rng.uniform() < 0.5 * std::erfc(level / std::sqrt(2)))) return false;

  Line::Impl& face = begin_ray(lines[seen.face], leaves[seen.face].planned(), geometry);
  face.hit_t = seen.begin;
  face.hit_g = face.hit_dg = 0;
  face.hit_mean = face.plan->process->mean->sample(at);
  face.hit_sigma = {};
  ++counters.line_segments;
  if (leaves[random_].memory() == Memory::none) return true;
  Line::Impl& l = begin_ray(lines[random_], plan, geometry);
  const std::unique_ptr<LineNoise> path = plan.line_sampler->noise(l);
  l.anchor = seen.begin;
  path->reset(geometry, seen.begin, clip(plan.bounds, o, d, 0, t_max).second, counters);
  PathStart known;
  known.value = -truncated_normal(level, rng);
  path->start(known, rng, counters);
  path->prepare(0, rng, counters);
  l.stretches.push_back({seen.begin, seen.begin, 0});
  return true;
}

std::optional<TreeHit> CertainCut::first_hit(const std::vector<ProcessSurface>& leaves,
                                             const LineGeometry& geometry, std::span<Line> lines,
                                             double t_max, std::span<const Start> starts, Rng& rng,
                                             Counters& counters) const {
  const Start& start = starts[random_];
  const std::optional<Stretch> seen = this->seen(leaves, geometry, t_max, starts);
  if (!seen) return {};
  // A table knows rays that start on the surface or know nothing.
  const bool tabulated = alone_ && (start.kind == Start::Kind::outside || start.state.value == 0);
  for (const Certain& c : certain_) begin_ray(lines[c.leaf], leaves[c.leaf].planned(), geometry);
  const PlannedLine& plan = tabulated ? alone_->planned() : leaves[random_].planned();
  Line::Impl& line = begin_ray(lines[random_], plan, geometry);
  if (!(seen->begin < seen->end)) {
    ++counters.line_skipped;
    return TreeHit{};
  }
  if (seen->face != kNoFace && enters_inside(leaves, geometry, lines, *seen, t_max, rng, counters))
    return TreeHit{seen->begin, seen->face};
  const double t =
      plan.line_sampler->first_hit(plan, line, seen->begin, seen->end, start, rng, counters);
  return t < kInfinity ? TreeHit{t, random_} : TreeHit{};
}

}  // namespace gpis

#include "process/certain_cut.h"

#include <algorithm>
#include <cmath>

#include "field/box_field.h"
#include "field/plane_field.h"
#include "field/sphere_field.h"
#include "field/transformed_field.h"
#include "process/plan.h"

namespace gpis {
namespace {

// A function whose values below 0 lie in a convex set, and which is convex along every line.
bool is_convex(const Field& field) {
  if (const auto* moved = dynamic_cast<const TransformedField*>(&field))
    return is_convex(moved->field());
  return dynamic_cast<const PlaneField*>(&field) || dynamic_cast<const BoxField*>(&field) ||
         dynamic_cast<const SphereField*>(&field);
}

enum class Root { found, none, unclear };

// The first root in `direction` of a convex function on a line from t, where it is above 0.
// Newton's steps on a convex function stay on this side of the root.
Root convex_root(const Field& field, const LineGeometry& line, double direction, double end,
                 double& t) {
  constexpr int kMostSteps = 50;  // a graze halves its distance a step
  for (int i = 0; i < kMostSteps; ++i) {
    const FieldSample s = field.sample(line.origin + line.direction * t);
    if (!(s.value > 0)) return Root::found;
    const double slope = direction * dot(s.gradient, line.direction);
    if (!(slope < 0)) return Root::none;
    const double step = -s.value / slope;
    t += direction * step;
    if (direction * (t - end) > 0) return Root::none;
    if (step <= 4e-16 * std::abs(t)) return Root::found;
  }
  return Root::unclear;
}

// A new ray through the leaf, nothing of it drawn or hit.
void begin_ray(Line::Impl& l, const ProcessSurface& leaf, const LineGeometry& geometry) {
  l.stretches.clear();
  l.hit_t = kInfinity;
  l.hit_value = 0;
  l.inside = false;
  l.plan = &leaf.planned();
  l.shared = nullptr;
  l.geometry = geometry;
}

// Every leaf of the tree is either certain and cuts the others, or one of these: a random leaf or
// a union of them, however it was put together.
bool split(const ProcessTree& tree, int node, std::vector<int>& certain, std::vector<int>& random,
           int& others, const std::vector<ProcessSurface>& leaves) {
  const ProcessTree::Node& n = tree.nodes()[node];
  if (n.blend > 0) return false;
  if (n.kind == ProcessTree::Kind::greatest)
    return std::all_of(n.children.begin(), n.children.end(), [&](int child) {
      return split(tree, child, certain, random, others, leaves);
    });
  if (n.kind == ProcessTree::Kind::leaf && leaves[n.leaf].planned().sigma_max == 0) {
    certain.push_back(n.leaf);
    return true;
  }
  if (++others > 1) return false;
  std::vector<int> open{node};
  while (!open.empty()) {
    const ProcessTree::Node& below = tree.nodes()[open.back()];
    open.pop_back();
    if (below.blend > 0 || below.kind == ProcessTree::Kind::greatest) return false;
    if (below.kind == ProcessTree::Kind::least) {
      open.insert(open.end(), below.children.begin(), below.children.end());
      continue;
    }
    if (tree.leaves()[below.leaf].sign < 0 || leaves[below.leaf].planned().sigma_max == 0)
      return false;
    random.push_back(below.leaf);
  }
  std::sort(random.begin(), random.end());
  return true;
}

}  // namespace

std::optional<CertainCut> CertainCut::of(const ProcessTree& tree,
                                         const std::vector<ProcessSurface>& leaves, Memory memory,
                                         Sampler sampler, std::string& why) {
  why.clear();
  if (std::none_of(leaves.begin(), leaves.end(),
                   [](const ProcessSurface& leaf) { return leaf.planned().sigma_max == 0; }))
    return {};
  CertainCut cut;
  int others = 0;
  if (!split(tree, tree.root(), cut.certain_, cut.random_, others, leaves) || cut.random_.empty() ||
      cut.certain_.empty()) {
    why = "certain leaves do not cut one random leaf or a union of them";
  } else if (tree.noises() < static_cast<int>(leaves.size())) {
    why = "a certain cut takes leaves of independent noise";
  } else if (memory == Memory::global || memory == Memory::segments ||
             sampler == Sampler::realisation) {
    why = "a certain cut takes paths that are drawn anew for every ray";
  } else if (std::any_of(leaves.begin(), leaves.end(), [](const ProcessSurface& leaf) {
               return leaf.planned().process->conditions != nullptr;
             })) {
    why = "a certain cut takes leaves without conditions";
  } else if (!std::all_of(cut.certain_.begin(), cut.certain_.end(),
                          [&](int k) { return is_convex(*leaves[k].planned().process->mean); })) {
    why = "a certain cut takes planes, boxes and spheres";
  } else {
    return cut;
  }
  return {};
}

std::string CertainCut::describe() const {
  const auto list = [](const std::vector<int>& all) {
    std::string text;
    for (const int k : all) text += (text.empty() ? "" : ", ") + std::to_string(k);
    return text;
  };
  return "every random leaf (" + list(random_) + ") marched for itself where the certain ones (" +
         list(certain_) +
         ") let it be seen; together on rays that these let see it twice, and inside";
}

std::optional<CertainCut::Stretch> CertainCut::stretch(const ProcessTree& tree,
                                                       const std::vector<ProcessSurface>& leaves,
                                                       const LineGeometry& geometry, double t_end,
                                                       std::span<const Start> starts) const {
  const auto& [origin, direction] = geometry;
  // Random leaves are seen nowhere else.
  Stretch s{t_end, 0};
  for (const int k : random_) {
    const auto [begin, end] = clip(leaves[k].planned().bounds, origin, direction, 0, t_end);
    if (!(begin < end)) continue;
    s.begin = std::min(s.begin, begin);
    s.end = std::max(s.end, end);
  }
  if (!(s.begin < s.end)) return s;
  const Stretch nothing{0, 0};
  for (const int k : certain_) {
    const PlannedLine& plan = leaves[k].planned();
    const Field& mean = *plan.process->mean;
    const double sign = tree.leaves()[k].sign;
    auto [begin, end] = clip(plan.bounds, origin, direction, 0, t_end);
    const bool present = begin < end;
    if (present && !std::isfinite(end)) end = s.end;
    if (present && !std::isfinite(end)) return {};
    // Inside of this leaf's surface, and of its bounds: between `begin` and `end`.
    bool by_surface = false, until_surface = false, empty = !present;
    const bool leaves_surface =
        present && starts[k].kind != Start::Kind::outside && starts[k].state.value == 0;
    if (leaves_surface) {
      const double slope = dot(starts[k].state.gradient, direction);
      if (!(sign * slope > 0)) return {};
      begin = 0;
      empty = sign > 0;  // a ray that leaves a convex body does not come back
    } else if (present) {
      const double bound = begin;
      const Root root = convex_root(mean, geometry, 1, end, begin);
      if (root == Root::unclear) return {};
      empty = root == Root::none;
      by_surface = begin > bound;
    }
    if (!empty) {
      const double bound = end;
      const Root root = convex_root(mean, geometry, -1, begin, end);
      if (root == Root::unclear) return {};
      if (root == Root::none) empty = true;  // it grazes, within rounding
      until_surface = end < bound;
    }
    if (sign > 0) {
      if (empty) return nothing;
      if (begin > s.begin) {
        s.begin = begin;
        s.entered = by_surface ? k : kBounds;
      }
      s.end = std::min(s.end, end);
    } else if (!empty && end > s.begin && begin < s.end) {
      // Outside of it: before `begin` and behind `end`.
      if (begin > s.begin && end < s.end) return {};
      if (begin > s.begin) {
        s.end = begin;
      } else {
        s.begin = end;
        s.entered = until_surface ? k : kBounds;
      }
    }
    if (!(s.begin < s.end)) return nothing;
  }
  if (s.entered == kBounds) return {};
  return s;
}

std::optional<TreeHit> CertainCut::first_hit(const ProcessTree& tree,
                                             const std::vector<ProcessSurface>& leaves,
                                             const LineGeometry& geometry, std::span<Line> lines,
                                             double t_max, std::span<const Start> starts, Rng& rng,
                                             Counters& counters) const {
  const std::optional<Stretch> seen = stretch(tree, leaves, geometry, t_max, starts);
  if (!seen) return {};
  const double a = seen->begin;
  if (0 < a && a < seen->end)
    for (const int k : random_)
      if (starts[k].kind != Start::Kind::outside) return {};
  const auto& [origin, direction] = geometry;
  for (std::size_t k = 0; k < leaves.size(); ++k) begin_ray(lines[k].impl(), leaves[k], geometry);
  if (!(seen->begin < seen->end)) {
    ++counters.line_skipped;
    return TreeHit{};
  }

  // Behind a certain surface nothing is known of the random leaves that are present already: each
  // is inside with P(f <= 0) = Φ(-μ/σ), and F falls to 0 right there if one is.
  if (seen->entered >= 0) {
    struct Entry {
      int leaf;
      double level, end;
      bool below;
    };
    thread_local std::vector<Entry> entries;
    entries.clear();
    bool hit = false;
    const Vec3 at = origin + direction * a;
    for (const int k : random_) {
      const PlannedLine& plan = leaves[k].planned();
      const auto [begin, end] = clip(plan.bounds, origin, direction, 0, t_max);
      if (!(begin < a && a < end)) continue;
      const double mean = plan.process->mean->value(at), sigma = plan.process->sigma->value(at);
      if (mean > plan.skip_threshold) continue;
      const double level = sigma > 0 ? mean / sigma : std::copysign(kInfinity, mean);
      const bool below = rng.uniform() < 0.5 * std::erfc(level / std::sqrt(2));
      hit = hit || below;
      entries.push_back({k, level, end, below});
    }
    if (hit) {
      for (const Entry& e : entries) {
        if (std::isinf(e.level)) continue;  // certain here
        Line::Impl& l = lines[e.leaf].impl();
        const std::unique_ptr<LineNoise> path = l.plan->line_sampler->noise(l);
        l.anchor = a;
        path->reset(geometry, a, e.end, counters);
        PathStart known;
        known.value = e.below ? -truncated_normal(e.level, rng) : truncated_normal(-e.level, rng);
        path->start(known, rng, counters);
        path->prepare(0, rng, counters);
        l.stretches.push_back({a, a, 0});
        ++counters.truncated_normals;
      }
      ++counters.line_segments;
      Line::Impl& l = lines[seen->entered].impl();
      l.hit_t = a;
      l.hit_g = l.hit_dg = 0;
      l.hit_mean = l.plan->process->mean->sample(at);
      l.hit_sigma = {};
      return TreeHit{a, seen->entered};
    }
  }

  TreeHit first;
  for (const int k : random_) {
    auto [begin, end] = clip(leaves[k].planned().bounds, origin, direction, 0,
                             std::min({t_max, seen->end, first.t}));
    begin = starts[k].kind != Start::Kind::outside && begin < end ? 0 : std::max(begin, a);
    if (!(begin < end)) {
      ++counters.line_skipped;
      continue;
    }
    Line::Impl& l = lines[k].impl();
    const double t =
        l.plan->line_sampler->first_hit(*l.plan, l, begin, end, starts[k], rng, counters);
    if (t < first.t) first = {t, k};
  }
  return first;
}

}  // namespace gpis

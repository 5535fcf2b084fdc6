#include "process/hit_gradient.h"

#include <algorithm>

#include "process/line_impl.h"
#include "process/plan.h"

namespace gpis {

HitGradient::HitGradient(const TreeSurface& surface, std::span<Line> lines, const TreeHit& hit,
                         std::span<const std::optional<State>> states, Rng& rng, Counters& counters)
    : surface_(surface), leaf_(hit.leaf) {
  if (surface.tree().has_blends()) {
    blend(lines, hit, states, rng, counters);
    share_noise(lines, hit, rng);
    return;
  }
  law_ = surface.leaves()[leaf_].gradient_law(lines[leaf_], hit.t, rng);
  const double sign = surface.sign(leaf_);
  law_ = {law_.mean * sign, law_.b1 * sign, law_.b2 * sign, law_.degenerate};
  share_noise(lines, hit, rng);
}

// Leaves of the noise that was hit and no part of F there: their gradients follow from that of F
// too, ∇fᵢ = ∇μᵢ + g ∇σᵢ + σᵢ ∇g.
void HitGradient::share_noise(std::span<Line> lines, const TreeHit& hit, Rng& rng) {
  const double spread = dot(law_.b1, law_.b1) + dot(law_.b2, law_.b2);
  if (!(spread > 0)) return;
  const std::vector<ProcessSurface>& leaves = surface_.leaves();
  const std::vector<ProcessTree::Leaf>& of_tree = surface_.tree().leaves();
  for (int k = 0; k < static_cast<int>(leaves.size()); ++k) {
    if (k == leaf_ || of_tree[k].noise != of_tree[leaf_].noise ||
        !leaves[k].sampled_at(lines[k], hit.t) ||
        std::any_of(parts_.begin(), parts_.end(), [&](const Part& p) { return p.leaf == k; }))
      continue;
    const GradientLaw law = leaves[k].gradient_law(lines[k], hit.t, rng);
    followers_.push_back({k, leaves[k].value(lines[k], hit.t, rng), law.mean,
                          (dot(law.b1, law_.b1) + dot(law.b2, law_.b2)) / spread});
  }
}

void HitGradient::blend(std::span<Line> lines, const TreeHit& hit,
                        std::span<const std::optional<State>> states, Rng& rng,
                        Counters& counters) {
  const ProcessTree& tree = surface_.tree();
  const std::vector<ProcessSurface>& leaves = surface_.leaves();
  std::vector<double> values(leaves.size()), weights(leaves.size());
  for (std::size_t k = 0; k < leaves.size(); ++k) {
    // A leaf that was not drawn there is too far from the surface to matter, on either side.
    const PlannedLine& plan = leaves[k].planned();
    const LineGeometry& line = lines[k].impl().geometry;
    const Vec3 at = line.origin + line.direction * hit.t;
    double f = kInfinity;
    if (k == static_cast<std::size_t>(leaf_) || plan.bounds.contains(at))
      f = leaves[k].sampled_at(lines[k], hit.t) ? leaves[k].value(lines[k], hit.t, rng)
          : plan.process->mean->value(at) < 0   ? -kInfinity
                                                : kInfinity;
    values[k] = surface_.sign(static_cast<int>(k)) * f;
  }
  tree.compose(values.data(), weights.data());
  const int noise = tree.leaves()[leaf_].noise;
  std::vector<GradientLaw> laws;
  for (int k = 0; k < static_cast<int>(leaves.size()); ++k) {
    if (!(weights[k] > 0) || !leaves[k].sampled_at(lines[k], hit.t)) continue;
    const double weight = weights[k] * surface_.sign(k);
    GradientLaw law = leaves[k].gradient_law(lines[k], hit.t, rng);
    if (tree.leaves()[k].noise != noise) {
      const bool known = states[k] && leaves[k].memory() != Memory::renewal;
      if (!known) counters.line_normals += 2;
      law_.mean += (known ? leaves[k].world_gradient(*states[k]) : law.draw(rng)) * weight;
      continue;
    }
    law_.mean += law.mean * weight;
    law_.b1 += law.b1 * weight;
    law_.b2 += law.b2 * weight;
    law_.degenerate |= law.degenerate;
    parts_.push_back({k, surface_.sign(k) * values[k], law.mean, 0});
    laws.push_back(law);
  }
  // Leaves of one noise differ by one factor: σᵢ ∇g.
  const double spread = dot(law_.b1, law_.b1) + dot(law_.b2, law_.b2);
  for (std::size_t i = 0; i < parts_.size() && spread > 0; ++i)
    parts_[i].share = (dot(laws[i].b1, law_.b1) + dot(laws[i].b2, law_.b2)) / spread;
  const double larger = std::max(dot(law_.b1, law_.b1), dot(law_.b2, law_.b2));
  const Vec3 area = cross(law_.b1, law_.b2);
  law_.degenerate |= !(dot(area, area) > 1e-12 * larger * dot(law_.mean, law_.mean));
}

void HitGradient::remember(const Vec3& gradient, std::span<std::optional<State>> states) const {
  if (parts_.empty())
    states[leaf_] = surface_.leaves()[leaf_].state(0, gradient * surface_.sign(leaf_));
  for (const std::vector<Part>* parts : {&parts_, &followers_})
    for (const Part& part : *parts)
      states[part.leaf] = surface_.leaves()[part.leaf].state(
          part.value, part.mean + (gradient - law_.mean) * part.share);
}

}  // namespace gpis

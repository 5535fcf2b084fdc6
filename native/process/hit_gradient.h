// ∇F at a hit of a tree. As a rule it is that of the leaf that was hit. Where a smooth union blends
// leaves it is ∇F = Σ wᵢ sᵢ ∇fᵢ (chain rule), of weights that follow from the values there: its law
// is then that given the gradients of the leaves with other noises, which are drawn before it.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "process/tree_surface.h"

namespace gpis {

class HitGradient {
 public:
  // `states`: one a leaf; gradients of blended leaves that are remembered are those, others are
  // drawn. `lines` hold the paths of the hit.
  HitGradient(const TreeSurface& surface, std::span<Line> lines, const TreeHit& hit,
              std::span<const std::optional<State>> states, Rng& rng, Counters& counters);

  // World space, in the sense in which F grows (of a ray inside: as the leaf's own law turns it).
  const GradientLaw& law() const { return law_; }
  // Puts the states into `states` of the leaf that was hit and of those that share its noise, given
  // a gradient of the law.
  void remember(const Vec3& gradient, std::span<std::optional<State>> states) const;

 private:
  struct Part {
    int leaf;
    double value;
    Vec3 mean;
    double share;  // of what the gradient differs from the mean of its law
  };
  void blend(std::span<Line> lines, const TreeHit& hit,
             std::span<const std::optional<State>> states, Rng& rng, Counters& counters);
  void share_noise(std::span<Line> lines, const TreeHit& hit, Rng& rng);

  const TreeSurface& surface_;
  GradientLaw law_;
  int leaf_;
  // Of the noise of the hit: what F is blended of (none without blends), and what only follows.
  std::vector<Part> parts_, followers_;
};

}  // namespace gpis

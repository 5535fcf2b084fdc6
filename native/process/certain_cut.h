// A tree that cuts random leaves with certain ones: the greatest of leaves of σ = 0 and of either
// one random leaf or a union of independent ones. Along a ray the certain part is inside on
// stretches that are known before anything is drawn; where there is one stretch, every random leaf
// is marched for itself within it, and the tree need not march its leaves together (definitions
// B6). F falls to 0 on the certain surface itself where a random leaf is inside already.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "process/surface.h"
#include "process/tree.h"
#include "process/tree_march.h"

namespace gpis {

class CertainCut {
 public:
  // What serves the tree; or nothing, and `why`: a clause for the plan, empty where no leaf is
  // certain. `leaves` are those of the tree and must outlive it.
  static std::optional<CertainCut> of(const ProcessTree& tree,
                                      const std::vector<ProcessSurface>& leaves, Memory memory,
                                      Sampler sampler, std::string& why);

  // As TreeSurface::first_hit for a ray outside, its geometry in object space; nothing for a ray
  // that the leaves must be marched together for: it is inside of the certain part on two
  // stretches, comes into it by bounds, or remembers a random leaf from before it.
  std::optional<TreeHit> first_hit(const ProcessTree& tree,
                                   const std::vector<ProcessSurface>& leaves,
                                   const LineGeometry& geometry, std::span<Line> lines,
                                   double t_max, std::span<const Start> starts, Rng& rng,
                                   Counters& counters) const;

  // For the plan: which leaves cut which.
  std::string describe() const;

 private:
  // Where F of the certain leaves is below 0: on (begin, end), behind the surface of the leaf
  // `entered`; kFree: the ray or the random leaves begin there; kBounds: a certain leaf does, by
  // its bounds, which are no surface.
  static constexpr int kFree = -1, kBounds = -2;
  struct Stretch {
    double begin, end;
    int entered = kFree;
  };
  std::optional<Stretch> stretch(const ProcessTree& tree, const std::vector<ProcessSurface>& leaves,
                                 const LineGeometry& geometry, double t_end,
                                 std::span<const Start> starts) const;

  std::vector<int> certain_, random_;
};

}  // namespace gpis

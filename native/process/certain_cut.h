// One random leaf cut by certain ones (σ = 0): the greatest of it and of planes, boxes and spheres,
// each as it is or turned inside out. Where the certain ones let the leaf be seen is known of a ray
// before anything is drawn. Where that is one stretch, the leaf is asked for itself within it, by
// its own sampler, and the leaves need not be marched together (definitions B6).
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "field/convex_body.h"
#include "process/tree_march.h"

namespace gpis {

class CertainCut {
 public:
  // Nothing for other trees, and `why`: a clause for the plan, empty where no leaf is certain.
  static std::optional<CertainCut> of(const ProcessTree& tree,
                                      const std::vector<ProcessSurface>& leaves, Memory memory,
                                      Sampler sampler, std::string& why);

  // As TreeSurface::first_hit for a ray outside, its geometry in object space. Nothing for a ray
  // that is to be marched through all leaves: the certain ones let it see the random one twice, or
  // at their bounds, which are no surface; or it remembers the random leaf from before it sees it.
  std::optional<TreeHit> first_hit(const std::vector<ProcessSurface>& leaves,
                                   const LineGeometry& geometry, std::span<Line> lines,
                                   double t_max, std::span<const Start> starts, Rng& rng,
                                   Counters& counters) const;

  // No ray ends in the bounds on anything else: a table may serve the random leaf, since rays that
  // leave a certain face and remember the leaf from there are not asked of it.
  void stands_alone(const std::vector<ProcessSurface>& leaves) {
    if (!leaves[random_].gains_alone()) return;
    alone_ = leaves[random_];
    alone_->stands_alone();
  }

  // For the plan.
  std::string describe() const;
  std::vector<std::pair<std::string, std::string>> plan() const;

 private:
  struct Certain {
    int leaf;
    double sign;  // -1: what is subtracted
    ConvexBody body;
  };
  // Where the random leaf is seen: on (begin, end), behind the face of the leaf `face`, or from its
  // own bounds or the ray's start on.
  static constexpr int kNoFace = -1;
  struct Stretch {
    double begin, end;
    int face = kNoFace;
  };
  std::optional<Stretch> seen(const std::vector<ProcessSurface>& leaves,
                              const LineGeometry& geometry, double t_max,
                              std::span<const Start> starts) const;
  bool enters_inside(const std::vector<ProcessSurface>& leaves, const LineGeometry& geometry,
                     std::span<Line> lines, const Stretch& seen, double t_max, Rng& rng,
                     Counters& counters) const;

  int random_ = -1;
  std::vector<Certain> certain_;         // those that are subtracted come last
  std::optional<ProcessSurface> alone_;  // the random leaf, where a table serves it
};

}  // namespace gpis

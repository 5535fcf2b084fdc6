// The leaves of a tree on one ray: fields and noises, where they are certain, and their values at
// points of the ray. The march (tree_march.h) decides what is evaluated.
#pragma once

#include <span>

#include "process/line_impl.h"
#include "process/line_noise.h"
#include "process/plan.h"
#include "process/tree.h"

namespace gpis {

// A leaf at t: f and its slope times the leaf's sign, and what they are made of.
struct LeafPoint {
  bool known = false;
  double t = 0, f = 0, df = 0;
  double g = 0, dg = 0;
  double mean = 0, sigma = 0, dsigma = 0;
};

// The leaves at one t, as far as they were evaluated.
struct TreeSample {
  struct NoisePoint {
    bool known = false;
    double g = 0, dg = 0;
  };
  double t = 0;
  std::vector<NoisePoint> noise;
  std::vector<LeafPoint> leaf;

  void reset(double at, std::size_t noises, std::size_t leaves) {
    t = at;
    noise.assign(noises, {});
    leaf.assign(leaves, {});
  }
};

class TreeLines {
 public:
  struct Noise {
    std::unique_ptr<LineNoise> path;
    Line::Impl* line = nullptr;  // of its first leaf: keeps the path and where it was sampled
    double t_end = 0;
    double step = 1;
    long cell = 0;
    bool begun = false;        // its path is drawn, from line->anchor on
    bool conditioned = false;  // and was told a value there
    bool current = false;      // `cell` is where the march is
    bool prepared = false;     // and is drawn
    double cell_end() const { return line->anchor + (cell + 1) * step; }
  };
  struct Leaf {
    const PlannedLine* plan = nullptr;
    Line::Impl* line = nullptr;
    double sign = 1;
    int noise = 0;
    int twin = 0;  // the first leaf that is the same function of the same noise
    bool mean_varies = true, sigma_varies = true;
    std::unique_ptr<FieldLine> mean, sigma;
    double t_begin = 0, t_end = 0;  // its bounds
    double smooth_step = kInfinity, mean_deviation = 0, mean_slope = kInfinity;
    double lift = 0;  // of the tree's leaf
    // Times its sign: farther than `lift` from 0 without drawing until then; 0: not for certain.
    int certain = 0;
    double until = -kInfinity;
    bool looked = false;
    bool engaged = false;  // evaluated where the march is
    double piece_end = 0;  // of the smooth piece of its fields
    bool new_piece = false;
  };

  void reset(const ProcessTree& tree, std::span<const PlannedLine* const> plans,
             const LineGeometry& geometry, std::span<Line> lines, double t_max, Rng& rng,
             Counters& counters);
  // Counts the ray, and leads all lines to their paths, for values and gradients after the march.
  void finish();

  // A new path for this noise from `anchor` on; nothing of it is drawn yet.
  void reset_noise(Noise& noise, double anchor);
  // Brings a path that was left behind to a.
  void resume(Noise& noise, double a);
  // Selects the pieces of the leaf's fields just behind a.
  void enter(Leaf& leaf, double a);
  // Where a step from a must end for this leaf.
  double step_end(Leaf& leaf, double a) const;
  // Is the leaf certain at a, and how long? `here`: the leaf at a if it was evaluated.
  void look_ahead(Leaf& leaf, double a, const LeafPoint& here);
  // A sign of F at a node that is certain until then, from the leaves that are; 0: it is not.
  struct Stretch {
    int sign;
    double until;
  };
  Stretch certain(const ProcessTree& tree, int node) const;
  // Where F is certain at a: leads a to where it is not, `outside` to F > 0 there, forgets what was
  // looked at, and returns true. A ray outside that enters a random leaf has it drawn instead.
  // `leaving`: a ray inside is at the end of bounds, where nothing holds it inside.
  bool skip_certain(const ProcessTree& tree, TreeSample& from, double& a, bool& outside,
                    bool leaving);
  // Whether F depends on the leaf, given what is certain of others.
  bool matters(const ProcessTree& tree, int node, int leaf) const;
  // Whether bounds end at a of a leaf that counts as its complement, and held F up till there.
  bool complement_ends(double a) const;
  // From now on all leaves count as their complements, in what is known of them as well.
  void turn_inside_out(TreeSample& sample, TreeSample& other);

  // f = μ + σ g, f' = μ' + gσ' + σ g' (math.md §2).
  LeafPoint combine(const Leaf& leaf, double t, double g, double dg);
  LeafPoint evaluate(int leaf, double t);
  const LeafPoint& point(TreeSample& sample, int leaf);
  // How far the leaf may differ from the cubic between both points, in units of (B₁ + B₂).
  double margin(int leaf, const LeafPoint& a, const LeafPoint& b) const;

  std::vector<Leaf> leaves;
  std::vector<Noise> noises;

 private:
  void enter_outside(const ProcessTree& tree, double a, Stretch& sure);
  void noise_at(Noise& noise, double t, double& g, double& dg);

  LineGeometry geometry_;
  Rng* rng_ = nullptr;
  Counters* counters_ = nullptr;
};

}  // namespace gpis

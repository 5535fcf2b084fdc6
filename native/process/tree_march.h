// First hit of a tree of processes along a ray (definitions B6, formulas C7): all leaves are
// marched on one grid, every step is certified by the signs of the leaves that can matter there,
// and the root of F is refined on the leaf that it comes from. Leaves are not conditioned on their
// own first passages, they may cross 0 many times inside of others; nothing of a leaf is drawn
// where others decide.
#pragma once

#include <array>

#include "process/tree_lines.h"

namespace gpis {

struct TreeHit {
  double t = kInfinity;
  int leaf = -1;
  // Where a ray from inside has left the body before, by bounds: what it hits, it hits from
  // outside.
  double left = kInfinity;
};

// Reused from ray to ray: keeps its buffers.
class TreeMarch {
 public:
  // `starts`: one a leaf; a leaf with value 0 is the one whose surface the ray leaves. `beyond`:
  // the tree that a ray from inside sees once it has left the body by bounds, null for rays from
  // outside.
  TreeHit first_hit(const ProcessTree& tree, const ProcessTree* beyond,
                    std::span<const PlannedLine* const> plans, const LineGeometry& geometry,
                    std::span<Line> lines, double t_max, std::span<const Start> starts, Rng& rng,
                    Counters& counters);

 private:
  static constexpr int kMaxSteps = 1 << 20;
  static constexpr int kStepsToStop = 1024;
  static constexpr int kMaxDepth = 64;

  // Logarithms of P(above 0) and P(at or below 0).
  struct Odds {
    double above, below;
  };
  // Where a leaf changes sign as g grows.
  struct Cut {
    double g;
    int leaf;
  };
  struct Level {
    TreeSample middle;
    std::vector<int> sign;  // of the leaves over the whole stretch, 0 where it is not certified
  };
  using Leaf = TreeLines::Leaf;
  using Noise = TreeLines::Noise;

  // tree_march.cpp
  bool march(double t_end);
  int step_over(double a, double t_end);
  // Whether a ray inside is at the end of bounds, behind which nothing may hold it inside.
  bool leaving_by_bounds(double a) const {
    return beyond_ && outside_ && lines_.complement_ends(a);
  }
  void leave_by_bounds(double a);
  void advance();
  int sign_over(int leaf, std::vector<int>& signs, TreeSample& a, TreeSample& b);
  int certify(int leaf, const LeafPoint& a, const LeafPoint& b) const;
  int sign_here(TreeSample& sample) const;
  bool search(TreeSample& a, TreeSample& b, int depth);
  bool take(TreeSample& sample);
  void refine(int leaf, const LeafPoint& lo, const LeafPoint& hi);
  void hit(int leaf, const LeafPoint& p);

  // tree_start.cpp
  void start(std::span<const Start> starts);
  void start_noise(Noise& noise, int leaf, const Start& start);
  void leaving(LeafPoint& p, const Leaf& leaf);
  void engage(int leaf, double a);
  void begin(int noise, double a);
  void find_cuts(int noise, double a, std::vector<Cut>& cuts);
  int sign_in(const std::vector<Cut>& cuts, int part, int leaf) const;
  int choose_part(int noise, double a, double g, const std::vector<Cut>& cuts);
  Odds odds(int node, double a);

  const ProcessTree* tree_ = nullptr;
  const ProcessTree* beyond_ = nullptr;
  TreeLines lines_;
  Rng* rng_ = nullptr;
  Counters* counters_ = nullptr;
  TreeHit hit_;
  bool outside_ = true;  // F > 0 behind the last point
  bool grew_ = false;    // a leaf was engaged: the step must be looked at again
  double b_ = 0;         // the step's end
  TreeSample from_, to_;
  std::array<Level, kMaxDepth> levels_;
  std::vector<int> known_;  // signs at a, for odds: 0 where it is drawn
  std::vector<Cut> cuts_;
};

}  // namespace gpis

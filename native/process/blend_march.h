// First hit of a tree with smooth unions along a ray (definitions B6): F depends on the values of
// its leaves where they are blended, not on their signs alone, so all leaves that are not certain
// are marched together and every step is certified by an enclosure of F and of its slope. F grows
// with every leaf (times its sign), and ∇F is a convex combination of theirs: both enclosures
// follow from those of the leaves. A leaf is left out only where it is farther from 0 than the
// radii above it, which is farther than it can move the sign of F (ProcessTree::Leaf::lift).
#pragma once

#include <array>

#include "process/tree_march.h"

namespace gpis {

// Reused from ray to ray: keeps its buffers.
class BlendMarch {
 public:
  // As TreeMarch; a ray leaves the surface where the states of `starts` compose to F = 0.
  TreeHit first_hit(const ProcessTree& tree, const ProcessTree* beyond,
                    std::span<const PlannedLine* const> plans, const LineGeometry& geometry,
                    std::span<Line> lines, double t_max, std::span<const Start> starts, Rng& rng,
                    Counters& counters);

 private:
  static constexpr int kMaxSteps = 1 << 20;
  static constexpr int kStepsToStop = 1024;
  static constexpr int kMaxDepth = 64;
  // Draws of all leaves at once until F > 0 there; then the ray is inside.
  static constexpr int kMostDraws = 4096;
  static constexpr int kFreeDraws = 16;      // before the ranges of the draws are looked for
  static constexpr double kFarthest = 1000;  // deviations that a value may be from its mean

  // F at a point of the line.
  struct Point {
    double t, f, df;
  };
  // Bounds of a value and of its slope over a stretch.
  struct Enclosure {
    double low, high, slope_low, slope_high;
  };
  // Of a value of g.
  struct Range {
    double low = -kInfinity, high = kInfinity;
  };
  using Leaf = TreeLines::Leaf;
  using Noise = TreeLines::Noise;

  // blend_march.cpp
  bool march(double t_end);
  void step_over(double a, double t_end);
  bool leaving_by_bounds(double a) const {
    return beyond_ && outside_ && lines_.complement_ends(a);
  }
  void leave_by_bounds(double a);
  void advance();
  bool search(TreeSample& a, TreeSample& b, int depth);
  Enclosure enclose(TreeSample& a, TreeSample& b);
  Enclosure enclose(int node) const;
  Point at(TreeSample& sample);
  void refine(Point lo, Point hi);
  void hit(TreeSample& sample);

  // blend_start.cpp
  void start(std::span<const Start> starts);
  void tell(std::span<const Start> starts, int noise);
  void weigh_slopes(std::span<const Start> starts);
  void engage(double a);
  void draw_outside();
  bool find_range(int noise, Range& range);
  bool acceptable();
  bool is_fresh(int noise) const;

  const ProcessTree* tree_ = nullptr;
  const ProcessTree* beyond_ = nullptr;
  TreeLines lines_;
  Rng* rng_ = nullptr;
  Counters* counters_ = nullptr;
  TreeHit hit_;
  bool outside_ = true;   // F > 0 behind the last point
  bool leaving_ = false;  // F = 0 at t = 0, and grows
  double b_ = 0;          // the step's end
  TreeSample from_, to_, here_;
  std::array<TreeSample, kMaxDepth> middles_;
  std::vector<Enclosure> leaf_;           // over the stretch that is looked at
  std::vector<double> values_, weights_;  // of the leaves where F is looked at
  std::vector<int> fresh_;                // noises that are drawn at one point
  std::vector<Range> ranges_;             // of them
  std::vector<std::size_t> forgotten_;    // leaves that may be anything at the start
  std::vector<double> slope_mean_, slope_deviation_, slope_weight_;  // of the noises at a start
};

}  // namespace gpis

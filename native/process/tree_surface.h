// A tree of processes placed in the world and planned for rendering: its leaves are ProcessSurfaces
// that share one place, one memory model and one march. A tree of one leaf is that leaf and keeps
// the march of its own; so do the leaves of a plain union of independent ones, whose first hit is
// the first of theirs (definitions B5), and one random leaf that certain ones cut (certain_cut.h).
#pragma once

#include "process/blend_march.h"
#include "process/certain_cut.h"
#include "process/surface.h"

namespace gpis {

class TreeSurface {
 public:
  // Throws std::invalid_argument with a sentence where a leaf cannot be rendered.
  TreeSurface(TreePtr tree, const Affine& object_to_world, Memory memory, Sampler sampler,
              double missed_root);

  // With walls (walls.h), as leaves behind those of the tree as it was given, its operands.
  const ProcessTree& tree() const { return *tree_; }
  const std::vector<ProcessSurface>& leaves() const { return leaves_; }
  std::size_t operands() const { return leaves_.size() - walled_.size(); }
  // The operand that a leaf belongs to: a wall to what it ends.
  int operand(std::size_t leaf) const {
    return leaf < operands() ? static_cast<int>(leaf) : walled_[leaf - operands()];
  }
  Memory memory() const { return leaves_[0].memory(); }
  // -1 where F falls as the leaf grows: gradients of F are those of the leaf times this.
  double sign(int leaf) const { return tree_->leaves()[leaf].sign; }
  // World-space box outside of which F > 0 for certain (infinite where unbounded).
  const Box3& bounds() const { return bounds_; }
  // Whether F > 0 at t for certain, the ray being outside of bounds of leaves there: of the operand
  // that it was in, however far others of a union reach.
  bool leaves_bounds(const Ray& ray, double t) const;

  // Plans rays that travel inside the body too; before the first of them.
  void serve_inside();
  // As ProcessSurface's; and a tree that certain leaves cut gains: a ray that ends on something
  // else would remember what a march of all leaves had drawn of them there.
  bool gains_alone() const { return tree_->is_single() ? leaves_[0].gains_alone() : bool(cut_); }
  void stands_alone();
  // It does not: the object of that name reaches into the bounds.
  void has_company(const std::string& name);

  // The first t in (0, t_max) where F changes to F <= 0 (inside: to F >= 0), and the leaf it comes
  // from. A ray inside a tree of several leaves that leaves it by the bounds of one goes on to what
  // it meets outside, and tells where it left. `lines` and `starts` hold one a leaf; lines hold the
  // sample paths afterwards.
  struct March {
    TreeMarch hard;
    BlendMarch blended;
  };
  TreeHit first_hit(March& march, std::span<Line> lines, const Ray& ray, double t_max,
                    std::span<const Start> starts, Rng& rng, Counters& counters) const;

  std::vector<std::pair<std::string, std::string>> plan() const;

 private:
  void add_walls(const Affine& object_to_world, Memory memory, Sampler sampler, double missed_root);

  TreePtr tree_, inside_out_;
  bool independent_union_ = false;
  std::vector<ProcessSurface> leaves_;
  std::vector<int> walled_;
  std::string composition_;  // of the tree as it was given
  std::optional<CertainCut> cut_;
  std::string uncut_;  // why there is none
  std::vector<const PlannedLine*> plans_;
  Box3 bounds_;
};

}  // namespace gpis

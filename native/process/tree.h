// A tree of processes composed per realisation (definitions B6): union is the least of its parts,
// intersection the greatest, difference max(a, -b), complement -a. Normal form: complements are
// pushed down to the leaves (De Morgan), so inner nodes are least and greatest alone and every sign
// of F follows from signs of leaves. A smooth union rounds the crease where two parts are within
// its blend radius of each other: F depends on their values there (blend_march.h). Immutable.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "process/gaussian_process.h"

namespace gpis {

class ProcessTree;
using TreePtr = std::shared_ptr<const ProcessTree>;

class ProcessTree {
 public:
  using ProcessPtr = std::shared_ptr<const GaussianProcess>;
  enum class Kind { leaf, least, greatest };
  struct Leaf {
    ProcessPtr process;
    double sign = 1;  // -1: the leaf counts as its complement
    int noise = 0;    // leaves of one number see the same g
    // Blend radii above it, summed up: F takes its sign from others wherever the leaf is farther
    // than this from 0 on the side where they decide, and from the leaf alone on the other.
    double lift = 0;
  };
  struct Node {
    Kind kind = Kind::leaf;
    int leaf = -1;
    int noise = -1;  // all leaves below see this g, -1: they differ
    std::vector<int> children;
    double blend = 0;  // two children; 0: no blend
  };

  static TreePtr single(ProcessPtr process);
  // `shared_noise`: all leaves below see the same g. Throws std::invalid_argument where their
  // kernels differ. `name` is what the caller calls it. `blend`: radius of a smooth union or
  // intersection, of the parts one after the other.
  static TreePtr combine(Kind kind, const std::vector<TreePtr>& parts, bool shared_noise,
                         const std::string& name, double blend = 0);
  static TreePtr complement(const ProcessTree& tree);

  // The same tree of other operands, cut by their walls (walls.h), which become leaves behind all
  // others; null: as it was, none.
  struct Wall {
    ProcessPtr operand, box;
  };
  TreePtr with_walls(const std::vector<Wall>& walls) const;

  // The same tree of other processes; one object that is several leaves stays one.
  template <class Change>
  TreePtr with_leaves(const Change& change) const {
    auto tree = std::make_shared<ProcessTree>(*this);
    for (std::size_t i = 0; i < leaves_.size(); ++i) {
      std::size_t first = 0;
      while (leaves_[first].process != leaves_[i].process) ++first;
      tree->leaves_[i].process =
          first < i ? tree->leaves_[first].process : change(*leaves_[i].process);
    }
    return tree;
  }

  const std::vector<Leaf>& leaves() const { return leaves_; }
  const std::vector<Node>& nodes() const { return nodes_; }  // children before their parents
  int root() const { return static_cast<int>(nodes_.size()) - 1; }
  int noises() const { return noises_; }
  bool is_single() const { return nodes_.size() == 1 && leaves_[0].sign > 0; }
  bool has_blends() const;
  // Refuses leaves whose kernels differ, which cannot see one and the same g.
  void check_one_kernel(const std::string& name) const;

  // -1, 1 or 0 (unknown) at a node, from those of the leaves times their sign. Leaves are asked in
  // order and only while they can matter.
  template <class SignOfLeaf>
  int sign(int node, const SignOfLeaf& sign_of_leaf) const {
    const Node& n = nodes_[node];
    if (n.kind == Kind::leaf) return sign_of_leaf(n.leaf);
    const int dominant = n.kind == Kind::least ? -1 : 1;
    bool all = true;
    for (const int child : n.children) {
      const int s = sign(child, sign_of_leaf);
      if (s == dominant) return dominant;
      all = all && s != 0;
    }
    // A blend reaches beyond the least of its parts.
    return all && n.blend == 0 ? -dominant : 0;
  }

  // Visits the leaves that leave the sign at a node unknown.
  template <class SignOfLeaf, class Visit>
  void undecided(int node, const SignOfLeaf& sign_of_leaf, const Visit& visit) const {
    const Node& n = nodes_[node];
    if (sign(node, sign_of_leaf) != 0) return;
    if (n.kind == Kind::leaf) visit(n.leaf);
    for (const int child : n.children) undecided(child, sign_of_leaf, visit);
  }

  // F and the leaf it comes from, from values of the leaves times their sign. No blends.
  struct Winner {
    double value;
    int leaf;
  };
  template <class ValueOfLeaf>
  Winner winner(int node, const ValueOfLeaf& value_of_leaf) const {
    const Node& n = nodes_[node];
    if (n.kind == Kind::leaf) return {value_of_leaf(n.leaf), n.leaf};
    Winner best = winner(n.children[0], value_of_leaf);
    for (std::size_t i = 1; i < n.children.size(); ++i) {
      const Winner w = winner(n.children[i], value_of_leaf);
      if (n.kind == Kind::least ? w.value < best.value : w.value > best.value) best = w;
    }
    return best;
  }

  // F from values of the leaves times their sign, blends and all, and ∂F/∂(each of them) unless
  // `weights` is null.
  double compose(const double* values, double* weights) const;

  // As it was put together, leaves by index: "difference(union(0, 1), 2)" in normal form.
  std::string describe() const { return describe(root()); }

 private:
  std::string describe(int node) const;

  std::vector<Leaf> leaves_;
  std::vector<Node> nodes_;
  int noises_ = 0;
};

}  // namespace gpis

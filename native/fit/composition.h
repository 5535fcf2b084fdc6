// A tree of processes at one point: which leaves may still decide F there, and the closed form of F
// by Clark's formulas.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "fit/clark.h"
#include "process/covariance.h"
#include "process/tree.h"

namespace gpis {

// The noise of leaves: independent sources ξ of unit variance, one for each noise number of the
// tree and a common one, from which leaves take `common` and `own` parts.
struct Mixture {
  double common = 0, own = 1;
};

class Composition {
 public:
  // Correlation of the noises of different numbers: 0 independent, 1 shared. Negative: of two.
  Composition(TreePtr tree, double correlation);

  static constexpr int kMostNodes = 64;  // leaves and nodes are bits of a word
  int leaves() const { return static_cast<int>(leaves_.size()); }
  const ProcessTree& tree() const { return *tree_; }

  // A leaf at x, times its sign; outside of its bounds the certain distance to them.
  Jet jet(int leaf, const Vec3& x) const;
  // Without the gradients.
  Jet value(int leaf, const Vec3& x) const;

  // Nodes that may decide F at a point, with leaves that may win there: all others lose by more
  // than `certainty` standard deviations of the difference.
  struct Alive {
    std::uint64_t nodes = 0, leaves = 0;
  };
  Alive alive(const Jet* leaves, double certainty) const;
  // F by Clark's formulas, and those of smooth unions, from the leaves that are alive: exact for
  // one or two of them, else each result is taken for normal and carried on, as Clark does. Without
  // `shape` there is no Kolmogorov distance.
  Greatest closed_form(const Jet* leaves, const Alive& alive, bool shape) const;

  // Covariance of g of two leaves at one point.
  double correlation(int a, int b) const;
  // Sources: 0 is the common one, 1 + k noise k.
  int sources() const { return 1 + tree_->noises(); }
  const Mixture& mixture(int leaf) const { return mixtures_[leaf]; }
  // One whose kernel the source has.
  int leaf_of_source(int source) const;

 private:
  struct Leaf {
    std::shared_ptr<const GaussianProcess> process;
    double sign, weight;  // standard deviation of the kernel's g
    Covariance covariance;
    SymMat3 slopes;  // where the kernel is stationary
  };
  struct Partial {
    Greatest greatest;
    std::array<double, kMostNodes + 1> along{};  // covariance with each source
  };
  bool above(int a, int b, const Jet* leaves, double certainty, double margin) const;
  void mark(int node, const Jet* leaves, double certainty, Alive& out) const;
  Partial fold(int node, const Jet* leaves, const Alive& alive, bool shape) const;

  TreePtr tree_;
  double correlation_;
  std::vector<Leaf> leaves_;
  std::vector<Mixture> mixtures_;
};

}  // namespace gpis

#include "process/tree.h"

#include "field/check.h"

namespace gpis {
namespace {

bool same(const Vec3& a, const Vec3& b) {
  return a.x == b.x && a.y == b.y && a.z == b.z;
}

// The same correlation: weights apart, which the deviation takes over (definitions E9).
bool same_noise(const GaussianProcess& a, const GaussianProcess& b) {
  if (a.anisotropy != b.anisotropy || a.time != b.time) return false;
  if (a.kernel == b.kernel) return true;
  const auto x = a.kernel->terms(), y = b.kernel->terms();
  if (!x || !y || x->size() != y->size()) return false;
  const double vx = a.kernel->variance(), vy = b.kernel->variance();
  for (std::size_t i = 0; i < x->size(); ++i) {
    const Term &s = (*x)[i], &t = (*y)[i];
    if (s.radial.family != t.radial.family || s.radial.alpha != t.radial.alpha ||
        s.weight * vy != t.weight * vx || !same(s.wave_vector, t.wave_vector))
      return false;
    for (int k = 0; k < 3; ++k)
      if (!same(s.whitening.row[k], t.whitening.row[k])) return false;
  }
  return true;
}

}  // namespace

TreePtr ProcessTree::single(std::shared_ptr<const GaussianProcess> process) {
  auto tree = std::make_shared<ProcessTree>();
  tree->leaves_ = {{std::move(process), 1, 0}};
  tree->nodes_ = {{Kind::leaf, 0, 0, {}}};
  tree->noises_ = 1;
  return tree;
}

TreePtr ProcessTree::combine(Kind kind, const std::vector<TreePtr>& parts, bool shared_noise,
                             const std::string& name) {
  if (parts.empty()) refuse("", name, " takes at least one operand.");
  if (parts.size() == 1 && !shared_noise) return parts[0];
  auto tree = std::make_shared<ProcessTree>();
  Node top;
  top.kind = kind;
  for (const TreePtr& part : parts) {
    const int first_leaf = static_cast<int>(tree->leaves_.size());
    const int first_node = static_cast<int>(tree->nodes_.size());
    for (Leaf leaf : part->leaves_) {
      leaf.noise = shared_noise ? 0 : leaf.noise + tree->noises_;
      tree->leaves_.push_back(std::move(leaf));
    }
    for (Node node : part->nodes_) {
      if (node.kind == Kind::leaf) node.leaf += first_leaf;
      for (int& child : node.children) child += first_node;
      if (shared_noise) {
        node.noise = 0;
      } else if (node.noise >= 0) {
        node.noise += tree->noises_;
      }
      tree->nodes_.push_back(std::move(node));
    }
    tree->noises_ += part->noises_;
    top.children.push_back(tree->root());
  }
  if (shared_noise) {
    for (const Leaf& leaf : tree->leaves_)
      if (!same_noise(*tree->leaves_[0].process, *leaf.process))
        refuse("", name, " with shared_noise=True takes operands of one kernel; these have ",
               tree->leaves_[0].process->kernel->describe(), " and ",
               leaf.process->kernel->describe(), ".");
    for (const Leaf& leaf : tree->leaves_)
      if (leaf.process->conditions && tree->leaves_.size() > 1)
        refuse("", name,
               " with shared_noise=True takes operands without conditions: what is known "
               "of one would be known of all.");
    tree->noises_ = 1;
    top.noise = 0;
  }
  tree->nodes_.push_back(std::move(top));
  return tree;
}

TreePtr ProcessTree::complement(const ProcessTree& of) {
  auto tree = std::make_shared<ProcessTree>(of);
  for (Leaf& leaf : tree->leaves_) leaf.sign = -leaf.sign;
  for (Node& node : tree->nodes_)
    if (node.kind != Kind::leaf)
      node.kind = node.kind == Kind::least ? Kind::greatest : Kind::least;
  return tree;
}

std::string ProcessTree::describe(int node) const {
  const Node& n = nodes_[node];
  if (n.kind == Kind::leaf) {
    const std::string leaf = std::to_string(n.leaf);
    return leaves_[n.leaf].sign > 0 ? leaf : "complement(" + leaf + ")";
  }
  std::string text = n.kind == Kind::least ? "union(" : "intersection(";
  for (std::size_t i = 0; i < n.children.size(); ++i)
    text += (i ? ", " : "") + describe(n.children[i]);
  return text + ")";
}

}  // namespace gpis

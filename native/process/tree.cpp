#include "process/tree.h"

#include <algorithm>

#include "field/check.h"

namespace gpis {
namespace {

// But for rounding: a kernel that was turned there and back is what it was.
bool same(const Vec3& a, const Vec3& b) {
  return length(a - b) <= 1e-12 * (length(a) + length(b));
}

bool same_metric(const Mat3& a, const Mat3& b) {
  const Mat3 p = transpose(a) * a, q = transpose(b) * b;
  double difference = 0, size = 0;
  for (int k = 0; k < 3; ++k) {
    difference += length(p.row[k] - q.row[k]);
    size += length(p.row[k]);
  }
  return difference <= 1e-12 * size;
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
    if (!same_metric(s.whitening, t.whitening)) return false;
  }
  return true;
}

}  // namespace

TreePtr ProcessTree::single(ProcessPtr process) {
  auto tree = std::make_shared<ProcessTree>();
  tree->leaves_ = {{std::move(process), 1, 0, 0}};
  tree->nodes_ = {{Kind::leaf, 0, 0, {}}};
  tree->noises_ = 1;
  return tree;
}

TreePtr ProcessTree::combine(Kind kind, const std::vector<TreePtr>& parts, bool shared_noise,
                             const std::string& name, double blend) {
  if (parts.empty()) refuse("", name, " takes at least one operand.");
  if (parts.size() == 1 && !shared_noise) return parts[0];
  if (blend > 0 && parts.size() > 2) {  // one after the other
    const std::vector<TreePtr> but_last(parts.begin(), parts.end() - 1);
    return combine(kind, {combine(kind, but_last, shared_noise, name, blend), parts.back()},
                   shared_noise, name, blend);
  }
  auto tree = std::make_shared<ProcessTree>();
  Node top;
  top.kind = kind;
  top.blend = parts.size() > 1 ? blend : 0;
  for (const TreePtr& part : parts) {
    const int first_leaf = static_cast<int>(tree->leaves_.size());
    const int first_node = static_cast<int>(tree->nodes_.size());
    for (Leaf leaf : part->leaves_) {
      leaf.noise = shared_noise ? 0 : leaf.noise + tree->noises_;
      leaf.lift += top.blend;
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
    tree->check_one_kernel(name + " with shared_noise=True");
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

void ProcessTree::check_one_kernel(const std::string& name) const {
  for (const Leaf& leaf : leaves_)
    if (leaves_[0].process->time != leaf.process->time) {
      refuse("", name,
             " takes operands of one time and time_scale, since they see the same bumps.");
    } else if (!same_noise(*leaves_[0].process, *leaf.process)) {
      refuse("", name, " takes operands of one kernel; these have ",
             leaves_[0].process->kernel->describe(), " and ", leaf.process->kernel->describe(),
             ".");
    }
}

TreePtr ProcessTree::complement(const ProcessTree& of) {
  auto tree = std::make_shared<ProcessTree>(of);
  for (Leaf& leaf : tree->leaves_) leaf.sign = -leaf.sign;
  for (Node& node : tree->nodes_)
    if (node.kind != Kind::leaf)
      node.kind = node.kind == Kind::least ? Kind::greatest : Kind::least;
  return tree;
}

TreePtr ProcessTree::with_walls(const std::vector<Wall>& walls) const {
  auto tree = std::make_shared<ProcessTree>(*this);
  for (std::size_t k = 0; k < walls.size(); ++k)
    if (walls[k].operand) tree->leaves_[k].process = walls[k].operand;
  tree->nodes_.clear();
  std::vector<int> moved;  // where a node is now
  for (Node node : nodes_) {
    for (int& child : node.children) child = moved[child];
    tree->nodes_.push_back(node);
    if (node.kind == Kind::leaf && walls[node.leaf].box) {
      // The box comes first: nothing is drawn of the leaf where it decides.
      const int leaf = tree->root(), box = leaf + 1;
      Leaf certain = leaves_[node.leaf];
      certain.process = walls[node.leaf].box;
      certain.noise = tree->noises_++;
      Node both{certain.sign > 0 ? Kind::greatest : Kind::least, -1, node.noise, {box, leaf}};
      node.leaf = static_cast<int>(tree->leaves_.size());
      node.noise = certain.noise;
      tree->leaves_.push_back(std::move(certain));
      tree->nodes_.push_back(node);
      tree->nodes_.push_back(std::move(both));
    }
    moved.push_back(tree->root());
  }
  return tree;
}

bool ProcessTree::has_blends() const {
  return std::any_of(nodes_.begin(), nodes_.end(), [](const Node& n) { return n.blend > 0; });
}

double ProcessTree::compose(const double* values, double* weights) const {
  // Nodes in order: children before their parents, so values go up and weights come down.
  thread_local std::vector<double> value, weight;
  value.resize(nodes_.size());
  for (std::size_t k = 0; k < nodes_.size(); ++k) {
    const Node& n = nodes_[k];
    if (n.kind == Kind::leaf) {
      value[k] = values[n.leaf];
      continue;
    }
    const double sign = n.kind == Kind::least ? 1 : -1;
    double best = kInfinity, other = kInfinity;
    for (const int child : n.children) {
      const double v = sign * value[child];
      other = std::min(other, std::max(best, v));
      best = std::min(best, v);
    }
    // The quadratic smooth minimum: min - (k - |a - b|)²₊/4k.
    const double overlap = n.blend > 0 ? std::max(n.blend - (other - best), 0.0) : 0.0;
    value[k] = sign * (overlap > 0 ? best - overlap * overlap / (4 * n.blend) : best);
  }
  if (weights) {
    weight.assign(nodes_.size(), 0.0);
    weight.back() = 1;
    for (std::size_t k = nodes_.size(); k-- > 0;) {
      const Node& n = nodes_[k];
      if (n.kind == Kind::leaf) {
        weights[n.leaf] = weight[k];
        continue;
      }
      const bool least = n.kind == Kind::least;
      const auto wins = [&](int a, int b) {
        return least ? value[a] < value[b] : value[a] > value[b];
      };
      int winner = n.children[0];
      for (const int child : n.children)
        if (wins(child, winner)) winner = child;
      double share = 0;
      if (n.blend > 0) {
        const int other = winner == n.children[0] ? n.children[1] : n.children[0];
        const double apart = std::abs(value[other] - value[winner]);
        share = apart < n.blend ? (n.blend - apart) / (2 * n.blend) : 0.0;
        weight[other] = share * weight[k];
      }
      weight[winner] = (1 - share) * weight[k];
    }
  }
  return value.back();
}

std::string ProcessTree::describe(int node) const {
  const Node& n = nodes_[node];
  if (n.kind == Kind::leaf) {
    const std::string leaf = std::to_string(n.leaf);
    return leaves_[n.leaf].sign > 0 ? leaf : "complement(" + leaf + ")";
  }
  std::string text = n.blend > 0 ? "smooth_" : "";
  text += n.kind == Kind::least ? "union(" : "intersection(";
  for (std::size_t i = 0; i < n.children.size(); ++i)
    text += (i ? ", " : "") + describe(n.children[i]);
  if (n.blend > 0) text += ", blend=" + number_text(n.blend);
  return text + ")";
}

}  // namespace gpis

#include "process/tree_surface.h"

#include <cmath>
#include <stdexcept>

#include "process/joint_line.h"
#include "process/realisation_path.h"
#include "process/walls.h"

namespace gpis {
namespace {

Box3 box_of(const ProcessTree& tree, int node, const std::vector<ProcessSurface>& leaves) {
  const ProcessTree::Node& n = tree.nodes()[node];
  // Outside of its bounds a leaf is absent: its complement is everywhere.
  if (n.kind == ProcessTree::Kind::leaf)
    return tree.leaves()[n.leaf].sign > 0 ? leaves[n.leaf].bounds() : Box3::everywhere();
  const bool all = n.kind == ProcessTree::Kind::least;
  Box3 box = all ? Box3{} : Box3::everywhere();
  for (const int child : n.children) {
    const Box3 b = box_of(tree, child, leaves);
    for (int i = 0; i < 3; ++i) {
      box.min[i] = all ? std::min(box.min[i], b.min[i]) : std::max(box.min[i], b.min[i]);
      box.max[i] = all ? std::max(box.max[i], b.max[i]) : std::min(box.max[i], b.max[i]);
    }
  }
  return box;
}

bool is_independent_union(const ProcessTree& tree) {
  if (tree.noises() < static_cast<int>(tree.leaves().size())) return false;
  for (const ProcessTree::Node& n : tree.nodes())
    if (n.kind == ProcessTree::Kind::greatest || n.blend > 0) return false;
  for (const ProcessTree::Leaf& leaf : tree.leaves())
    if (leaf.sign < 0) return false;
  return true;
}

}  // namespace

TreeSurface::TreeSurface(TreePtr tree, const Affine& object_to_world, Memory memory,
                         Sampler sampler, double missed_root)
    : tree_(std::move(tree)), composition_(tree_->describe()) {
  const auto& leaves = tree_->leaves();
  for (std::size_t i = 0; i < leaves.size(); ++i) {
    try {
      if (!tree_->is_single() && !leaves[i].process->kernel->differentiable())
        throw std::invalid_argument("the kernel " + leaves[i].process->kernel->describe() +
                                    " has no gradient, and trees are marched by gradients: take "
                                    "Matern 3/2 for a rough surface.");
      if (!tree_->is_single() && sampler == Sampler::first_passage)
        throw std::invalid_argument(
            "the sampler first_passage serves a process of its own, not the leaves of a tree, "
            "which are marched together: take 'auto'.");
      leaves_.emplace_back(leaves[i].process, object_to_world, memory, sampler, missed_root);
    } catch (const std::invalid_argument& error) {
      if (leaves.size() == 1) throw;
      throw std::invalid_argument("Operand " + std::to_string(i) + ": " + error.what());
    }
  }
  add_walls(object_to_world, memory, sampler, missed_root);
  inside_out_ = ProcessTree::complement(*tree_);
  independent_union_ = is_independent_union(*tree_);
  for (const ProcessSurface& leaf : leaves_) plans_.push_back(&leaf.planned());
  bounds_ = box_of(*tree_, tree_->root(), leaves_);
  cut_ = CertainCut::of(*tree_, leaves_, memory, sampler, uncut_);
}

void TreeSurface::add_walls(const Affine& object_to_world, Memory memory, Sampler sampler,
                            double missed_root) {
  const std::vector<ProcessTree::Wall> of_leaf = walls(*tree_, leaves_);
  const auto plan = [&](const ProcessTree::ProcessPtr& process) {
    return ProcessSurface(process, object_to_world, memory, sampler, missed_root);
  };
  bool any = false;
  for (std::size_t k = 0; k < of_leaf.size(); ++k) {
    const auto& [operand, box] = of_leaf[k];
    any = any || operand;
    if (operand) leaves_[k] = plan(operand);
    if (!box) continue;
    walled_.push_back(static_cast<int>(k));
    leaves_.push_back(plan(box));
  }
  if (any) tree_ = tree_->with_walls(of_leaf);
}

void TreeSurface::serve_inside() {
  if (tree_->is_single()) leaves_[0].serve_inside();
  if (!cut_) return;
  cut_.reset();
  uncut_ = "a cut takes bodies that no ray travels in";
}

void TreeSurface::stands_alone() {
  if (!tree_->is_single()) return cut_->stands_alone(leaves_);
  leaves_[0].stands_alone();
  plans_[0] = &leaves_[0].planned();
}

void TreeSurface::has_company(const std::string& name) {
  if (!cut_) return;
  cut_.reset();
  uncut_ = "a cut takes an object of its own, and '" + name + "' reaches into its bounds";
}

bool TreeSurface::leaves_bounds(const Ray& ray, double t) const {
  const Affine& to_object = leaves_[0].world_to_object();
  const LineGeometry line{to_object.point(ray.origin), to_object.vector(ray.direction)};
  // The least that F can be there.
  thread_local std::vector<double> least;
  least.assign(leaves_.size(), -kInfinity);
  bool left = false;
  for (std::size_t k = 0; k < leaves_.size(); ++k) {
    const auto [enter, leave] = clip(plans_[k]->bounds, line.origin, line.direction, 0, t);
    if (enter <= leave && leave >= t) continue;
    least[k] = sign(k) * kInfinity;
    left = true;
  }
  for (std::size_t k = 0; k < leaves_.size() && left; ++k) {
    const PlannedLine& plan = *plans_[k];
    const double clear = plan.skip_threshold + tree_->leaves()[k].lift;
    if (std::isinf(clear) || least[k] > 0) continue;
    if (plan.process->mean->value(line.origin + line.direction * t) > clear)
      least[k] = sign(k) * kInfinity;
  }
  return left && tree_->compose(least.data(), nullptr) > 0;
}

TreeHit TreeSurface::first_hit(March& march, std::span<Line> lines, const Ray& ray, double t_max,
                               std::span<const Start> starts, Rng& rng, Counters& counters) const {
  if (tree_->is_single()) {
    const double t = leaves_[0].first_hit(lines[0], ray, t_max, starts[0], rng, counters);
    return {t, t < kInfinity ? 0 : -1};
  }
  ++counters.composed_rays;
  if (independent_union_ && !starts[0].inside) {
    // Outside of the union is outside of every leaf, and the leaves know nothing of each other.
    TreeHit first;
    for (std::size_t k = 0; k < leaves_.size(); ++k) {
      const double t =
          leaves_[k].first_hit(lines[k], ray, std::min(first.t, t_max), starts[k], rng, counters);
      if (t < first.t) first = {t, static_cast<int>(k)};
    }
    return first;
  }
  const Affine& to_object = leaves_[0].world_to_object();
  const LineGeometry geometry{to_object.point(ray.origin), to_object.vector(ray.direction)};
  if (cut_ && !starts[0].inside)
    if (const auto hit = cut_->first_hit(leaves_, geometry, lines, t_max, starts, rng, counters))
      return *hit;
  // Leaves are drawn as they are: a ray inside sees their tree inside out (definitions B7).
  const ProcessTree& tree = starts[0].inside ? *inside_out_ : *tree_;
  const ProcessTree* const beyond = starts[0].inside ? tree_.get() : nullptr;
  const bool kept = memory() == Memory::global;
  const auto keep = [&](bool now) {
    for (std::size_t k = 0; k < lines.size() && kept; ++k)
      lines[k].impl().path<RealisationPath>().keep(now ? starts[k].realisation : nullptr, false);
  };
  const auto recall = [&](bool now) {
    for (std::size_t k = 0; k < lines.size() && memory() == Memory::segments; ++k)
      if (JointLine* joint = plans_[k]->line_sampler->joint(lines[k].impl()))
        joint->recall(now ? starts[k].segments : nullptr, 1);
  };
  keep(true);
  recall(true);
  const TreeHit hit = tree.has_blends()
                          ? march.blended.first_hit(tree, beyond, plans_, geometry, lines, t_max,
                                                    starts, rng, counters)
                          : march.hard.first_hit(tree, beyond, plans_, geometry, lines, t_max,
                                                 starts, rng, counters);
  keep(false);
  recall(false);
  return hit;
}

std::vector<std::pair<std::string, std::string>> TreeSurface::plan() const {
  const bool single = operands() == 1 && sign(0) > 0;
  const auto add_leaves = [&](auto& rows) {
    const auto leaf = [&](std::size_t i) {
      return single ? "" : "leaf[" + std::to_string(operand(i)) + "].";
    };
    for (std::size_t i = 0; i < operands(); ++i)
      for (const auto& [key, text] : leaves_[i].plan()) rows.emplace_back(leaf(i) + key, text);
    for (std::size_t i = operands(); i < leaves_.size(); ++i)
      rows.emplace_back(
          leaf(i) + "wall",
          sign(operand(i)) > 0
              ? "its bounds: they cut it where it is solid for certain"
              : "its bounds: it is subtracted, and they end where others may be solid");
  };
  std::vector<std::pair<std::string, std::string>> rows;
  if (single) {
    add_leaves(rows);
    return rows;
  }
  const bool shared = tree_->noises() < static_cast<int>(leaves_.size());
  rows.emplace_back(
      "composition",
      composition_ + ", composed per realisation; noise " +
          (shared ? "shared by some leaves" : "independent") +
          (independent_union_ ? "; every leaf marched for itself, the first hit wins"
           : tree_->has_blends()
               ? "; leaves marched together, all that are within the blend radii of "
                 "the surface (skipping is bounded by them)"
           : cut_ ? "; " + cut_->describe()
                  : "; leaves marched together" + (uncut_.empty() ? "" : " (" + uncut_ + ")")));
  if (cut_) {
    const auto cut = cut_->plan();
    rows.insert(rows.end(), cut.begin(), cut.end());
  }
  add_leaves(rows);
  return rows;
}

}  // namespace gpis

#include "process/walls.h"

#include <algorithm>

#include "field/box_field.h"
#include "field/constant_field.h"
#include "kernel/stationary_kernel.h"
#include "process/plan.h"

namespace gpis {
namespace {

// Of the size of the bounds: a wall lies this far behind them and the operand goes on as far again,
// so that it is there where a ray meets the wall, and others whose bounds end at the same place end
// first. Bounds that are those of a grid cannot go on: there the wall lies this far before them.
constexpr double kMargin = 1e-7;

// A rectangle across an axis: its centre and half its sides.
struct Patch {
  Vec3 center, half;
};

class Walls {
 public:
  Walls(const ProcessTree& tree, const std::vector<ProcessSurface>& leaves)
      : tree_(tree), leaves_(leaves) {}

  // The faces of the leaf's bounds that are walls, by bits 2 axis + upper.
  unsigned faces(int leaf) const {
    const PlannedLine& plan = leaves_[leaf].planned();
    if ((tree_.leaves()[leaf].sign > 0 && plan.process->sigma->range().min > 0) ||
        !std::isfinite(length(plan.bounds.max - plan.bounds.min)))
      return 0;
    unsigned bits = 0;
    for (int face = 0; face < 6; ++face)
      if (is_wall(leaf, face)) bits |= 1u << face;
    return bits;
  }

  bool certain(int leaf) const { return leaves_[leaf].planned().sigma_max == 0; }

 private:
  // The most patches of a face that are looked at, and how often it is halved at most where nothing
  // is known of the slopes of a mean.
  static constexpr int kMostPatches = 4096, kDepthByPoints = 4, kMostDepth = 48;

  // Of leaf k times its sign on all of a patch, 0 where it is not certain.
  int sign(int k, const Patch& x) const {
    const PlannedLine& plan = leaves_[k].planned();
    const int positive = tree_.leaves()[k].sign > 0 ? 1 : -1;
    bool within = true;
    for (int i = 0; i < 3; ++i) {
      const double low = x.center[i] - x.half[i], high = x.center[i] + x.half[i];
      if (high < plan.bounds.min[i] || low > plan.bounds.max[i]) return positive;
      within = within && low >= plan.bounds.min[i] && high <= plan.bounds.max[i];
    }
    if (plan.process->conditions) return 0;
    const double clear = plan.skip_threshold + tree_.leaves()[k].lift + reach(plan, x);
    const double mean = plan.process->mean->value(x.center);
    return mean > clear ? positive : mean < -clear && within ? -positive : 0;
  }

  static double reach(const PlannedLine& plan, const Patch& x) {
    const double r = length(x.half);
    return r > 0 ? plan.mean_lipschitz * r : 0;
  }

  bool may_be_solid(int leaf, const Patch& x) const {
    const PlannedLine& plan = leaves_[leaf].planned();
    const bool positive = tree_.leaves()[leaf].sign > 0;
    if (!positive && !certain(leaf)) return sign(leaf, x) != -1;
    // A random process that is not subtracted is entered outside, but for where its deviation is 0.
    if (length(x.half) == 0 && plan.process->sigma->value(x.center) > 0) return false;
    // The face of a certain process may itself lie on its bounds.
    const double mean = plan.process->mean->value(x.center) - reach(plan, x);
    const double slope = std::min(1.0, plan.mean_lipschitz);
    return mean < -4 * kMargin * slope * length(plan.bounds.max - plan.bounds.min);
  }

  // Whether F may depend on the leaf on the patch.
  bool matters(int leaf, const Patch& x) const {
    const auto given = [&](int of_leaf) {
      return tree_.sign(tree_.root(), [&](int k) { return k == leaf ? of_leaf : sign(k, x); });
    };
    return given(-1) != 1 && given(1) != -1;
  }

  // Whether the body may end, or begin, with the leaf's bounds: before their end the leaf may be
  // solid and matters, and behind it as well.
  bool may_end(int leaf, Patch x, int axis, double out) const {
    const Box3& bounds = leaves_[leaf].planned().bounds;
    const double step = out * kMargin * (bounds.max[axis] - bounds.min[axis]);
    x.center[axis] -= step;
    if (!may_be_solid(leaf, x) || !matters(leaf, x)) return false;
    x.center[axis] += 2 * step;
    return matters(leaf, x);
  }

  // Patches on which it may end are halved until it does so at the centre of one.
  bool is_wall(int leaf, int face) const {
    const int axis = face / 2, j = (axis + 1) % 3, k = (axis + 2) % 3;
    const Box3& bounds = leaves_[leaf].planned().bounds;
    const double out = face % 2 ? 1 : -1;
    bool slopes = true;
    for (const ProcessSurface& l : leaves_)
      slopes = slopes && std::isfinite(l.planned().mean_lipschitz);
    std::vector<std::pair<Patch, int>> open(1);
    Patch& whole = open[0].first;
    whole.center = (bounds.min + bounds.max) / 2;
    whole.center[axis] = face % 2 ? bounds.max[axis] : bounds.min[axis];
    whole.half = (bounds.max - bounds.min) / 2;
    whole.half[axis] = 0;
    // In the order of their size.
    for (std::size_t next = 0; next < open.size() && next < kMostPatches; ++next) {
      const auto [patch, depth] = open[next];
      if (slopes && !may_end(leaf, patch, axis, out)) continue;
      if (may_end(leaf, {patch.center, {}}, axis, out)) return true;
      if (depth == (slopes ? kMostDepth : kDepthByPoints)) continue;
      for (const double u : {-0.5, 0.5})
        for (const double v : {-0.5, 0.5}) {
          Patch part{patch.center, patch.half / 2};
          part.center[j] += u * patch.half[j];
          part.center[k] += v * patch.half[k];
          open.emplace_back(part, depth + 1);
        }
    }
    return false;
  }

  const ProcessTree& tree_;
  const std::vector<ProcessSurface>& leaves_;
};

ProcessTree::Wall wall(const ProcessTree::Leaf& leaf, const Box3& bounds, bool certain,
                       unsigned faces) {
  const Vec3 size = bounds.max - bounds.min;
  // Where a face is no wall the box goes on: nothing but the operand's bounds end it there.
  Box3 inner = bounds, outer = bounds, own = leaf.process->bounds.value_or(Box3::everywhere());
  for (int face = 0; face < 6; ++face) {
    const int axis = face / 2;
    const auto end = [&](auto& box) -> auto& {
      return (face % 2 ? box.max : box.min)[axis];
    };
    const double margin = (face % 2 ? kMargin : -kMargin) * size[axis];
    const bool is_wall = faces >> face & 1;
    const bool goes_on = end(own) == (face % 2 ? bounds.max : bounds.min)[axis];
    if ((is_wall || certain) && goes_on)
      end(outer) += 2 * margin + (face % 2 ? leaf.lift : -leaf.lift);
    end(inner) += is_wall ? (goes_on ? margin : -margin) : margin / kMargin;
  }
  ProcessTree::Wall out;
  GaussianProcess wider = *leaf.process;
  wider.bounds = outer;
  out.operand = std::make_shared<const GaussianProcess>(std::move(wider));
  if (faces == 0) return out;
  GaussianProcess box;
  box.mean = std::make_shared<BoxField>((inner.min + inner.max) / 2, inner.max - inner.min);
  box.sigma = std::make_shared<ConstantField>(0);
  // It correlates nothing, but tells the march what is small here.
  box.kernel = std::make_shared<SquaredExponential>(std::min({size.x, size.y, size.z}));
  out.box = std::make_shared<const GaussianProcess>(std::move(box));
  return out;
}

}  // namespace

std::vector<ProcessTree::Wall> walls(const ProcessTree& tree,
                                     const std::vector<ProcessSurface>& leaves) {
  const Walls all(tree, leaves);
  std::vector<ProcessTree::Wall> out(leaves.size());
  std::vector<unsigned> faces(leaves.size());
  for (std::size_t k = 0; k < leaves.size(); ++k) {
    const ProcessTree::Leaf& leaf = tree.leaves()[k];
    const bool certain = all.certain(static_cast<int>(k)) && leaf.process->bounds;
    faces[k] = all.faces(static_cast<int>(k));
    if (faces[k] == 0 && !certain) continue;
    // An object that is several leaves stays one.
    for (std::size_t i = 0; i < k && !out[k].operand; ++i)
      if (out[i].operand && faces[i] == faces[k] && tree.leaves()[i].process == leaf.process &&
          tree.leaves()[i].lift == leaf.lift)
        out[k] = out[i];
    if (!out[k].operand) out[k] = wall(leaf, leaves[k].planned().bounds, certain, faces[k]);
  }
  return out;
}

}  // namespace gpis

#include "process/walls.h"

#include <map>

#include "field/box_field.h"
#include "field/constant_field.h"
#include "kernel/stationary_kernel.h"
#include "process/plan.h"

namespace gpis {
namespace {

// Of its size, how far a wall is within the bounds: the operand is still there where a ray meets
// it.
constexpr double kWithin = 1e-7;

// Of leaf k times its sign, 0 where it is not certain.
int sign_at(const ProcessTree& tree, const std::vector<ProcessSurface>& leaves, int k,
            const Vec3& p) {
  const PlannedLine& plan = leaves[k].planned();
  const int positive = tree.leaves()[k].sign > 0 ? 1 : -1;
  for (int i = 0; i < 3; ++i)
    if (p[i] < plan.bounds.min[i] || p[i] > plan.bounds.max[i]) return positive;
  if (plan.process->conditions) return 0;
  const double clear = plan.skip_threshold + tree.leaves()[k].lift;
  const double mean = plan.process->mean->value(p);
  return mean > clear ? positive : mean < -clear ? -positive : 0;
}

// Whether the body may end, or begin, with the leaf's bounds: the leaf may be solid at p before
// their end, and behind it, at q, it matters that the leaf is absent.
bool ends_inside(const ProcessTree& tree, const std::vector<ProcessSurface>& leaves, int leaf,
                 const Vec3& p, const Vec3& q) {
  const int absent = tree.leaves()[leaf].sign > 0 ? 1 : -1;
  if (sign_at(tree, leaves, leaf, p) == absent) return false;
  const auto given = [&](int of_leaf) {
    return tree.sign(tree.root(),
                     [&](int k) { return k == leaf ? of_leaf : sign_at(tree, leaves, k, q); });
  };
  return given(absent) != -absent && given(-absent) != absent;
}

// Looked at on a lattice on the faces.
bool ends_inside(const ProcessTree& tree, const std::vector<ProcessSurface>& leaves, int leaf) {
  constexpr int kPoints = 16;
  const Box3& box = leaves[leaf].planned().bounds;
  if (!std::isfinite(length(box.max - box.min))) return false;
  for (int axis = 0; axis < 3; ++axis) {
    const double behind = kWithin * (box.max[axis] - box.min[axis]);
    for (const double side : {box.min[axis], box.max[axis]})
      for (int i = 0; i < kPoints * kPoints; ++i) {
        const double u = (i % kPoints + 0.5) / kPoints, v = (i / kPoints + 0.5) / kPoints;
        const int j = (axis + 1) % 3, k = (axis + 2) % 3;
        Vec3 p;
        p[axis] = side;
        p[j] = box.min[j] + u * (box.max[j] - box.min[j]);
        p[k] = box.min[k] + v * (box.max[k] - box.min[k]);
        Vec3 q = p;
        q[axis] += side > box.min[axis] ? behind : -behind;
        if (ends_inside(tree, leaves, leaf, p, q)) return true;
      }
  }
  return false;
}

}  // namespace

std::vector<ProcessTree::ProcessPtr> walls(const ProcessTree& tree,
                                           const std::vector<ProcessSurface>& leaves) {
  std::vector<ProcessTree::ProcessPtr> boxes(leaves.size());
  std::map<const GaussianProcess*, ProcessTree::ProcessPtr> of_process;
  for (int k = 0; k < static_cast<int>(leaves.size()); ++k) {
    const ProcessTree::Leaf& leaf = tree.leaves()[k];
    const bool certain = leaves[k].planned().sigma_max == 0;
    if ((leaf.sign > 0 && !certain) || !ends_inside(tree, leaves, k)) continue;
    ProcessTree::ProcessPtr& box = of_process[leaf.process.get()];
    if (!box) {
      const Box3& bounds = leaves[k].planned().bounds;
      GaussianProcess certain;
      certain.mean = std::make_shared<BoxField>((bounds.min + bounds.max) / 2,
                                                (bounds.max - bounds.min) * (1 - kWithin));
      certain.sigma = std::make_shared<ConstantField>(0);
      // It correlates nothing, but tells the march what is small here.
      certain.kernel = std::make_shared<SquaredExponential>(length(bounds.max - bounds.min));
      box = std::make_shared<const GaussianProcess>(std::move(certain));
    }
    boxes[k] = box;
  }
  return boxes;
}

}  // namespace gpis

#include "geometry/box_tree.h"

namespace gpis {

BoxTree::BoxTree(std::span<const Box3> boxes) : boxes_(boxes.begin(), boxes.end()) {
  std::vector<int> bounded;
  for (int i = 0; i < static_cast<int>(boxes_.size()); ++i) {
    const Box3& box = boxes_[i];
    if (box.empty()) continue;
    (is_finite(box.min) && is_finite(box.max) ? bounded : unbounded_).push_back(i);
  }
  if (!bounded.empty()) root_ = build(bounded);
}

// Halves along the axis in which the middles of the boxes spread most.
int BoxTree::build(std::span<int> members) {
  if (members.size() == 1) return members[0];
  Box3 all, middles;
  for (const int i : members) {
    all.include(boxes_[i].min);
    all.include(boxes_[i].max);
    middles.include(boxes_[i].min * 0.5 + boxes_[i].max * 0.5);
  }
  const Vec3 spread = middles.max - middles.min;
  int axis = 0;
  for (const int other : {1, 2})
    if (spread[other] > spread[axis]) axis = other;
  const std::size_t half = members.size() / 2;
  std::nth_element(members.begin(), members.begin() + half, members.end(), [&](int a, int b) {
    return boxes_[a].min[axis] + boxes_[a].max[axis] < boxes_[b].min[axis] + boxes_[b].max[axis];
  });
  const int node = static_cast<int>(nodes_.size());
  nodes_.push_back({all, {}});
  const int low = build(members.first(half)), high = build(members.subspan(half));
  nodes_[node].children[0] = low;
  nodes_[node].children[1] = high;
  return ~node;
}

}  // namespace gpis

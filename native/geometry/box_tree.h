// Which of many boxes a ray meets, nearest first: a hierarchy of bounding volumes. Work grows with
// the logarithm of their number, not with it.
#pragma once

#include <algorithm>
#include <limits>
#include <span>
#include <vector>

#include "core/vec.h"

namespace gpis {

class BoxTree {
 public:
  // Boxes may be empty (no ray meets them) or infinite (every ray is tested against them).
  explicit BoxTree(std::span<const Box3> boxes);
  BoxTree() = default;

  // Where a ray enters a box (>= 0), or a node of boxes: ~index. Working memory of `visit`.
  struct Entry {
    double enter;
    int box;
    // Of those entered at once nodes come first, so that of all boxes there the least index does:
    // the order of boxes does not depend on the tree.
    bool operator<(const Entry& o) const {
      return enter > o.enter || (enter == o.enter && box > o.box);
    }
  };

  // Calls reached(index) for every box that the ray meets in [0, end], in the order in which
  // it enters them, the least index first where that is the same; goes on up to the end that this
  // returns. Gives the number of boxes and nodes that were tested.
  template <class Reached>
  int visit(const Ray& ray, double end, std::vector<Entry>& queue, const Reached& reached) const {
    int tested = 0;
    const auto test = [&](const Box3& box, int id) {
      ++tested;
      const auto [enter, leave] = clip(box, ray.origin, ray.direction, 0, end);
      if (enter > leave) return;
      queue.push_back({enter, id});
      std::push_heap(queue.begin(), queue.end());
    };
    queue.clear();
    for (const int box : unbounded_) test(boxes_[box], box);
    if (root_ != kNone) test(box_of(root_), root_);
    while (!queue.empty() && queue.front().enter <= end) {
      const int id = queue.front().box;
      std::pop_heap(queue.begin(), queue.end());
      queue.pop_back();
      if (id >= 0) {
        end = reached(id);
        continue;
      }
      for (const int child : nodes_[~id].children) test(box_of(child), child);
    }
    return tested;
  }

 private:
  static constexpr int kNone = std::numeric_limits<int>::max();
  struct Node {
    Box3 box;
    int children[2];  // a box, or ~node
  };
  const Box3& box_of(int id) const { return id >= 0 ? boxes_[id] : nodes_[~id].box; }
  int build(std::span<int> members);

  std::vector<Box3> boxes_;
  std::vector<Node> nodes_;
  std::vector<int> unbounded_;
  int root_ = kNone;
};

}  // namespace gpis

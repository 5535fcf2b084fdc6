// Boxes along a ray: the tree against all boxes one by one.
#include "check.h"
#include "geometry/box_tree.h"
#include "scenes.h"

using namespace gpis;
using namespace gpis::test;

namespace {

Box3 random_box(Rng& rng, double spread, double size) {
  Vec3 at, half;
  for (int i = 0; i < 3; ++i) {
    at[i] = spread * (2 * rng.uniform() - 1);
    half[i] = size * rng.uniform();
  }
  return {at - half, at + half};
}

struct Found {
  double enter;
  int box;
};

// What `visit` promises, without a tree: in the order of entering, the least index first; every
// `stop`-th box ends the ray where the ray enters it and a bit.
std::vector<Found> all(const std::vector<Box3>& boxes, const Ray& ray, double end, int stop) {
  std::vector<Found> met;
  for (int i = 0; i < static_cast<int>(boxes.size()); ++i) {
    if (boxes[i].empty()) continue;
    const auto [enter, leave] = clip(boxes[i], ray.origin, ray.direction, 0, end);
    if (enter <= leave) met.push_back({enter, i});
  }
  std::stable_sort(met.begin(), met.end(),
                   [](const Found& a, const Found& b) { return a.enter < b.enter; });
  for (std::size_t k = 0; k < met.size(); ++k) {
    if (met[k].enter > end)
      met.resize(k);
    else if (met[k].box % stop == 0)
      end = std::min(end, met[k].enter + 0.5);
  }
  return met;
}

}  // namespace

TEST(box_tree_meets_the_same_boxes_in_order) {
  Rng rng(11, 0);
  std::vector<BoxTree::Entry> queue;
  int met = 0, ties = 0;
  for (const int count : {0, 1, 2, 3, 7, 50, 300}) {
    std::vector<Box3> boxes;
    for (int i = 0; i < count; ++i) {
      boxes.push_back(random_box(rng, 5, 1.5));
      if (i % 7 == 3) boxes.back() = boxes[i / 2];               // twice the same
      if (i % 11 == 5) boxes.back() = {};                        // empty
      if (i % 13 == 6) boxes.back().min.x = -kInfinity;          // half a space
      if (i % 17 == 8) boxes.back().max.z = boxes.back().min.z;  // flat
      if (i % 19 == 9)
        boxes.back() = {{-kInfinity, -kInfinity, -kInfinity}, {kInfinity, kInfinity, kInfinity}};
    }
    const BoxTree tree(boxes);
    for (int i = 0; i < 400; ++i) {
      context() = std::to_string(count) + " boxes, ray " + std::to_string(i);
      Vec3 d = any_direction(rng), o = random_box(rng, 8, 0).min;
      if (i % 5 == 0) d = {i % 2 ? 1.0 : -1.0, 0, 0};
      if (i % 10 == 0 && count) o = boxes[i % count].min;  // from a corner, along faces
      if (!is_finite(o)) continue;
      const double end = i % 3 ? kInfinity : 6 * rng.uniform();
      const int stop = i % 4 ? 3 : 1'000'000;
      const std::vector<Found> expected = all(boxes, {o, d}, end, stop);
      std::size_t next = 0;
      double now = end;
      tree.visit({o, d}, end, queue, [&](int box) {
        CHECK(next, <, expected.size());
        if (next >= expected.size()) return -1.0;
        CHECK(box, ==, expected[next].box);
        ties += next > 0 && expected[next].enter == expected[next - 1].enter;
        if (box % stop == 0) now = std::min(now, expected[next].enter + 0.5);
        ++next;
        return now;
      });
      CHECK(next, ==, expected.size());
      met += static_cast<int>(next);
    }
  }
  CHECK(met, >, 5'000);
  CHECK(ties, >, 500);
}

// Boxes side by side, a ray through one of them: 2 a level of the tree, and what its neighbours'
// boxes share.
TEST(box_tree_tests_few_boxes) {
  Rng rng(12, 0);
  std::vector<BoxTree::Entry> queue;
  for (const int side : {1, 4, 16, 64}) {
    std::vector<Box3> boxes;
    for (int i = 0; i < side * side; ++i) {
      const double x = i % side, y = i / side;
      boxes.push_back({{x, y, 0}, {x + 0.9, y + 0.9, 0.9}});
    }
    const BoxTree tree(boxes);
    Mean tested;
    for (int i = 0; i < 2'000; ++i) {
      const Vec3 o{side * rng.uniform(), side * rng.uniform(), 4};
      int reached = 0;
      tested.add(tree.visit({o, {0, 0, -1}}, kInfinity, queue, [&](int) {
        ++reached;
        return kInfinity;
      }));
      CHECK(reached, <=, 1);
    }
    context() = std::to_string(side) + " boxes a side";
    CHECK(tested.mean(), <=, 2 * std::log2(1.0 * side * side) + 1);
  }
}

// The points of a block: nets in every decision, and no dependence between decisions or on the
// place in the block.
#include <boost/math/distributions/chi_squared.hpp>
#include <set>

#include "check.h"
#include "core/block_points.h"

using namespace gpis;
using namespace gpis::test;

TEST(points_of_a_block_are_a_net_in_every_decision) {
  Rng rng(1, 0);
  for (int block = 0; block < 100; ++block) {
    const std::uint64_t word = rng();
    for (int decision = 0; decision < 20; ++decision)
      for (const int size : {8, 16})
        for (int columns = 1; columns <= size; columns *= 2) {
          std::set<std::pair<int, int>> boxes;
          for (int i = 0; i < size; ++i) {
            const SquarePoint p = BlockPoints(word, i, size).point(decision, rng);
            boxes.emplace(p.u * columns, p.v * size / columns);
          }
          CHECK(boxes.size(), ==, static_cast<std::size_t>(size));
        }
  }
}

TEST(decisions_of_a_sample_are_uniform_and_independent) {
  for (const auto& [index, size] : {std::pair(0, 16), {5, 16}, {15, 16}, {0, 8}, {5, 8}}) {
    std::vector<int> counts(256);  // quarters of both numbers of two decisions
    Rng rng(2, index);
    constexpr int kBlocks = 100'000;
    for (int block = 0; block < kBlocks; ++block) {
      const BlockPoints points(rng(), index, size);
      const SquarePoint a = points.point(1, rng), b = points.point(2, rng);
      int cell = 0;
      for (const double x : {a.u, a.v, b.u, b.v}) cell = 4 * cell + static_cast<int>(4 * x);
      ++counts[cell];
    }
    double statistic = 0;
    const double expected = kBlocks / 256.0;
    for (const int count : counts) statistic += (count - expected) * (count - expected) / expected;
    CHECK(cdf(complement(boost::math::chi_squared(255), statistic)), >, 1e-4);
  }
}

// Nets dealt in one and the same order would make products of two decisions far noisier than
// independent numbers do; their block mean has a variance of 1/(n·144). Of two sets of n points,
// each with one point in every nth, dealt at random, it is n/(n-1) times that; the standard error
// here is .01.
TEST(decisions_of_a_block_are_dealt_in_different_orders) {
  for (const auto& [other, size] : {std::pair(1, 16), {2, 16}, {9, 16}, {1, 8}, {9, 8}}) {
    Rng rng(3, other);
    Mean squares;
    for (int block = 0; block < 20'000; ++block) {
      const std::uint64_t word = rng();
      double mean = 0;
      for (int i = 0; i < size; ++i) {
        const BlockPoints points(word, i, size);
        mean += (points.point(0, rng).u - 0.5) * (points.point(other, rng).u - 0.5) / size;
      }
      squares.add(mean * mean * size * 144);
    }
    CHECK(std::abs(squares.mean() * (size - 1) / size - 1), <, 0.05);
  }
}

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
      for (int columns = 1; columns <= kBlockSamples; columns *= 2) {
        std::set<std::pair<int, int>> boxes;
        for (int i = 0; i < kBlockSamples; ++i) {
          const SquarePoint p = BlockPoints(word, i).point(decision, rng);
          boxes.emplace(p.u * columns, p.v * kBlockSamples / columns);
        }
        CHECK(boxes.size(), ==, 16u);
      }
  }
}

TEST(decisions_of_a_sample_are_uniform_and_independent) {
  for (const int index : {0, 5, 15}) {
    std::vector<int> counts(256);  // quarters of both numbers of two decisions
    Rng rng(2, index);
    constexpr int kBlocks = 100'000;
    for (int block = 0; block < kBlocks; ++block) {
      const BlockPoints points(rng(), index);
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
// independent numbers do; their block mean has a variance of 1/(16·144).
TEST(decisions_of_a_block_are_dealt_in_different_orders) {
  for (const int other : {1, 2, 9}) {
    Rng rng(3, other);
    Mean squares;
    for (int block = 0; block < 20'000; ++block) {
      const std::uint64_t word = rng();
      double mean = 0;
      for (int i = 0; i < kBlockSamples; ++i) {
        const BlockPoints points(word, i);
        mean += (points.point(0, rng).u - 0.5) * (points.point(other, rng).u - 0.5) / 16;
      }
      squares.add(mean * mean * 16 * 144);
    }
    CHECK(std::abs(squares.mean() - 1), <, 0.1);
  }
}

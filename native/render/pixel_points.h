// Where the samples of one block fall in their pixel: the first 16 points of Sobol's sequence, a
// (0,2)-net (one point in each of the 16 boxes of every shape 1x16, 2x8, 4x4, …), with random
// digits (XOR) per block and a random place inside the finest box. Each point is uniform and blocks
// are independent, so pixel means are unbiased and block sums are a fair sample of them.
#pragma once

#include "core/rng.h"

namespace gpis {

inline constexpr int kBlockSamples = 16;

struct PixelPoint {
  double u, v;
};

// `scramble` is the block's random word, `rng` the sample's own stream.
inline PixelPoint pixel_point(std::uint64_t scramble, int index_in_block, Rng& rng) {
  static constexpr unsigned kFirst[4] = {8, 4, 2, 1},
                            kSecond[4] = {8, 12, 10, 15};  // direction numbers, 4 digits
  unsigned a = scramble & 15, b = (scramble >> 4) & 15;
  for (int digit = 0; digit < 4; ++digit)
    if (index_in_block >> digit & 1) {
      a ^= kFirst[digit];
      b ^= kSecond[digit];
    }
  const double u = (a + rng.uniform()) / 16;
  return {u, (b + rng.uniform()) / 16};
}

}  // namespace gpis

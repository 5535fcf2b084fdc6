// Low-discrepancy points for the 16 samples of one block of the film.
//
// Each decision that a path takes with two numbers (its place in the pixel, a point on a light, a
// direction) has a set of its own: the first 16 points of Sobol's sequence, a (0,2)-net (one point
// in each of the 16 boxes of every shape 1x16, 2x8, 4x4, …), dealt to the samples in a random order
// (padding, Kollig & Keller 2002), with random digits (XOR) and a random place inside the finest
// box. All numbers of one sample are uniform and independent, and so are blocks: pixel means are
// unbiased and block sums are a fair sample of them.
#pragma once

#include <array>
#include <cstdint>

#include "core/rng.h"
#include "core/warp.h"

namespace gpis {

inline constexpr int kBlockSamples = 16;

class BlockPoints {
 public:
  // `block` is the block's random word, `index` the sample's place in it.
  BlockPoints(std::uint64_t block, int index) : block_(block), index_(index) {}

  // The sample's point of set number `decision`; `rng` places it inside its box.
  SquarePoint point(int decision, Rng& rng) const {
    const std::uint64_t word = mix64(block_ ^ static_cast<std::uint64_t>(decision));
    const unsigned digits =
        kSobol[shuffled(static_cast<unsigned>(index_), word >> 8)] ^ (word & 0xff);
    const double u = ((digits & 15) + rng.uniform()) / 16;
    return {u, ((digits >> 4) + rng.uniform()) / 16};
  }

 private:
  // The points themselves: four digits of the first number, then four of the second.
  static constexpr std::array<std::uint8_t, 16> kSobol = [] {
    constexpr unsigned first[4] = {8, 4, 2, 1}, second[4] = {8, 12, 10, 15};  // direction numbers
    std::array<std::uint8_t, 16> points{};
    for (unsigned place = 0; place < 16; ++place)
      for (int digit = 0; digit < 4; ++digit)
        if (place >> digit & 1) points[place] ^= first[digit] | second[digit] << 4;
    return points;
  }();

  // A random permutation of 0 … 15: a Feistel network on two halves of two bits.
  static unsigned shuffled(unsigned i, std::uint64_t word) {
    for (int round = 0; round < 4; ++round, word >>= 8)
      i = (i & 3) << 2 | (i >> 2 ^ (word >> 2 * (i & 3) & 3));
    return i;
  }

  std::uint64_t block_;
  int index_;
};

}  // namespace gpis

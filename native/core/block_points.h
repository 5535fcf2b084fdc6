// Low-discrepancy points for the samples of one block of the film: 16, or 8 in the first two
// blocks.
//
// The first 16 samples of a pixel are two blocks, since one block alone does not tell how much its
// sum varies: its points depend on each other, and the spread of single samples overstates the
// error of a picture of 16 samples by 20 to 40 %.
//
// Each decision that a path takes with two numbers (its place in the pixel, a point on a light, a
// direction) has a set of its own: the first 16 (8) points of Sobol's sequence, a (0,2)-net (one
// point in each of the 16 boxes of every shape 1x16, 2x8, 4x4, …), dealt to the samples in a random
// order (padding, Kollig & Keller 2002), with random digits (XOR) and a random place inside the
// finest box. All numbers of one sample are uniform and independent, and so are blocks: pixel means
// are unbiased and block sums are a fair sample of them.
#pragma once

#include <array>
#include <cstdint>

#include "core/rng.h"
#include "core/warp.h"

namespace gpis {

inline constexpr int kBlockSamples = 16;

// The block of the film that a sample belongs to, by its first sample.
struct SampleBlock {
  int first, size;
};
constexpr SampleBlock block_of(int sample) {
  const int size = sample < kBlockSamples ? kBlockSamples / 2 : kBlockSamples;
  return {sample / size * size, size};
}

class BlockPoints {
 public:
  // `block` is the block's random word, `index` the sample's place in it, `size` 8 or 16.
  BlockPoints(std::uint64_t block, int index, int size = kBlockSamples)
      : block_(block), index_(index), size_(size) {}

  // The sample's point of set number `decision`; `rng` places it inside its box.
  SquarePoint point(int decision, Rng& rng) const {
    const std::uint64_t word = mix64(block_ ^ static_cast<std::uint64_t>(decision));
    const auto index = static_cast<unsigned>(index_);
    const bool half = size_ < kBlockSamples;  // 8 points have three digits
    const unsigned place = half ? shuffled_half(index, word >> 8) : shuffled(index, word >> 8);
    const unsigned digits = kSobol[place] ^ (word & 0xff);
    const double u = ((digits & 15) >> half) + rng.uniform();
    return {u / size_, ((digits >> 4 >> half) + rng.uniform()) / size_};
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

  // A random permutation of 0 … 7: i -> m i + s over the field of 8 elements, m not 0, so that all
  // pairs of places are as likely for any two samples.
  static unsigned shuffled_half(unsigned i, std::uint64_t word) {
    static constexpr unsigned kPower[14] = {1, 2, 4, 3, 6, 7, 5, 1, 2, 4, 3, 6, 7, 5};
    static constexpr unsigned kLogarithm[8] = {0, 0, 1, 3, 2, 6, 4, 5};
    const unsigned shift = word & 7, multiplier = static_cast<unsigned>((word >> 3) % 7);
    return (i == 0 ? 0 : kPower[kLogarithm[i] + multiplier]) ^ shift;
  }

  std::uint64_t block_;
  int index_, size_;
};

}  // namespace gpis

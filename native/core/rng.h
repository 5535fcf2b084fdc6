// Random numbers: one independent stream per (seed, pixel, sample), so that an image depends
// neither on threads nor on tiles.
#pragma once

#include <cstddef>
#include <cstdint>

#include "core/ziggurat.h"

namespace gpis {

inline constexpr std::uint64_t kGolden = 0x9e3779b97f4a7c15ull;

// SplitMix64 (Steele, Lea, Flood 2014), one step: the hash behind every seed.
inline std::uint64_t mix64(std::uint64_t z) {
  z += kGolden;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ull;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebull;
  return z ^ (z >> 31);
}

// xoshiro256++ (Blackman, Vigna 2021).
class Rng {
 public:
  using result_type = std::uint64_t;

  Rng(std::uint64_t seed, std::uint64_t stream, std::uint64_t substream = 0) {
    std::uint64_t h = mix64(mix64(mix64(seed) ^ stream) ^ substream);
    for (auto& s : state_) {
      s = mix64(h);
      h += kGolden;
    }
  }

  static constexpr result_type min() { return 0; }
  static constexpr result_type max() { return ~result_type{0}; }
  result_type operator()() {
    const std::uint64_t result = rotl(state_[0] + state_[3], 23) + state_[0];
    const std::uint64_t t = state_[1] << 17;
    state_[2] ^= state_[0];
    state_[3] ^= state_[1];
    state_[1] ^= state_[2];
    state_[0] ^= state_[3];
    state_[2] ^= t;
    state_[3] = rotl(state_[3], 45);
    return result;
  }

  // Uniform in [0, 1), 53 bits.
  double uniform() { return static_cast<double>((*this)() >> 11) * 0x1p-53; }
  // Uniform in (0, 1]: safe under a logarithm.
  double positive_uniform() { return static_cast<double>(((*this)() >> 11) + 1) * 0x1p-53; }
  // Standard normal.
  double normal() { return Ziggurat::draw(*this); }
  // As many in a row: the state stays in registers, since only a copy of it is handed on (by its
  // address, which would keep it in memory) where a number is not accepted at once.
  void normals(double* out, std::size_t count) {
    Rng local = *this;
    for (std::size_t i = 0; i < count; ++i) {
      const result_type word = local();
      if (Ziggurat::accepts(word, out[i])) [[likely]]
        continue;
      *this = local;
      out[i] = Ziggurat::decide(word, out[i], *this);
      local = *this;
    }
    *this = local;
  }

 private:
  static std::uint64_t rotl(std::uint64_t x, int k) { return (x << k) | (x >> (64 - k)); }
  std::uint64_t state_[4];
};

}  // namespace gpis

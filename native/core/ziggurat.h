// Standard normal random numbers by the ziggurat (Marsaglia and Tsang 2000): layers of one area
// cover e^{-x²/2}, x >= 0; a point of a layer that lies under the curve for certain is accepted at
// once (99.3%), any other is decided exactly. Layer, sign and place come from different bits of one
// word (Doornik 2005: shared bits are visible).
#pragma once

#include <array>
#include <cmath>
#include <cstdint>

namespace gpis {

class Ziggurat {
 public:
  template <class Generator>
  static double draw(Generator& generator) {
    double x;
    const std::uint64_t word = generator();
    return accepts(word, x) ? x : decide(word, x, generator);
  }

  // x is the place of a word in its layer: a normal number if this says so, else `decide` has to.
  static bool accepts(std::uint64_t word, double& x) {
    const int i = word & (kLayers - 1);
    // The upper 53 bits, signed.
    x = static_cast<double>(static_cast<std::int64_t>(word) >> 11) * kTable.scale[i];
    return std::abs(x) < kTable.inner[i];
  }

  template <class Generator>
  [[gnu::noinline]] static double decide(std::uint64_t word, double x, Generator& generator) {
    for (;;) {
      const int i = word & (kLayers - 1);
      if (i == 0) return std::copysign(tail(generator), x);
      if (under_curve(i, x, generator)) return x;
      word = generator();
      if (accepts(word, x)) return x;
    }
  }

 private:
  static constexpr int kLayers = 256;
  // Where the tail begins, so that 256 layers close at x = 0.
  static constexpr double kTail = 3.6541528853610087963519472518;

  // Layer i holds |x| <= outer, between e^{-outer²/2} and e^{-inner²/2}; layer 0 the rectangle up
  // to kTail and the tail, as if it were a wider rectangle.
  struct Table {
    std::array<double, kLayers> scale;  // outer edge / 2⁵²
    std::array<double, kLayers> inner;
    std::array<double, kLayers + 1> height;  // of the curve at the outer edge of i; at 0 last

    Table() {
      height[0] = height[1] = std::exp(-0.5 * kTail * kTail);
      const double area =
          kTail * height[0] + std::sqrt(std::acos(-1) / 2) * std::erfc(kTail / std::sqrt(2));
      double outer = kTail;
      scale[0] = area / height[0] * 0x1p-52;
      inner[0] = outer;
      for (int i = 1; i < kLayers; ++i) {
        height[i + 1] = i + 1 < kLayers ? height[i] + area / outer : 1;
        scale[i] = outer * 0x1p-52;
        inner[i] = outer = std::sqrt(-2 * std::log(height[i + 1]));
      }
    }
  };
  inline static const Table kTable;

  // Uniform in (0, 1].
  template <class Generator>
  static double uniform(Generator& generator) {
    return static_cast<double>((generator() >> 11) + 1) * 0x1p-53;
  }

  // |x| beyond kTail (Marsaglia 1964).
  template <class Generator>
  static double tail(Generator& generator) {
    for (;;) {
      const double beyond = -std::log(uniform(generator)) / kTail;
      if (-2 * std::log(uniform(generator)) > beyond * beyond) return kTail + beyond;
    }
  }

  template <class Generator>
  static bool under_curve(int i, double x, Generator& generator) {
    const double low = kTable.height[i], high = kTable.height[i + 1];
    return low + (high - low) * uniform(generator) < std::exp(-0.5 * x * x);
  }
};

}  // namespace gpis

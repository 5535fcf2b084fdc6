// Sine and cosine of many numbers at once, in a form that compilers turn into vector instructions.
#pragma once

#include <bit>
#include <cstdint>

namespace gpis {

// Absolute error below 1e-15 for |x| < 1e6; what lies far beyond loses digits as its own rounding
// does.
inline void sincos(const double* x, int count, double* sine, double* cosine) {
  // π in three parts, so that n·π is exact (Cody & Waite 1980).
  constexpr double kPiA = 3.1415926218032836914, kPiB = 3.1786509424591713469e-08,
                   kPiC = 1.2246467864107188502e-16, kInversePi = 0.31830988618379067154;
  constexpr double kRound = 6755399441055744.0;  // 1.5·2⁵²: adding it rounds to an integer
  for (int i = 0; i < count; ++i) {
    const double shifted = x[i] * kInversePi + kRound, n = shifted - kRound;
    const double r = ((x[i] - n * kPiA) - n * kPiB) - n * kPiC, r2 = r * r;
    // Taylor series on [-π/2, π/2]: the next terms are below 3e-16.
    double s = -1.0 / 121645100408832000, c = 1.0 / 2432902008176640000;
    s = s * r2 + 1.0 / 355687428096000;
    c = c * r2 - 1.0 / 6402373705728000;
    s = s * r2 - 1.0 / 1307674368000;
    c = c * r2 + 1.0 / 20922789888000;
    s = s * r2 + 1.0 / 6227020800;
    c = c * r2 - 1.0 / 87178291200;
    s = s * r2 - 1.0 / 39916800;
    c = c * r2 + 1.0 / 479001600;
    s = s * r2 + 1.0 / 362880;
    c = c * r2 - 1.0 / 3628800;
    s = s * r2 - 1.0 / 5040;
    c = c * r2 + 1.0 / 40320;
    s = s * r2 + 1.0 / 120;
    c = c * r2 - 1.0 / 720;
    s = s * r2 - 1.0 / 6;
    c = c * r2 + 1.0 / 24;
    s = s * r2 + 1;
    c = c * r2 - 0.5;
    c = c * r2 + 1;
    // An odd n changes both signs.
    const std::uint64_t sign = std::bit_cast<std::uint64_t>(shifted) << 63;
    sine[i] = std::bit_cast<double>(std::bit_cast<std::uint64_t>(s * r) ^ sign);
    cosine[i] = std::bit_cast<double>(std::bit_cast<std::uint64_t>(c) ^ sign);
  }
}

}  // namespace gpis

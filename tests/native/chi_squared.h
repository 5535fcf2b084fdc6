// Does a sampler of directions follow its density? Pearson's χ² over a grid of the sphere.
#pragma once

#include <boost/math/distributions/chi_squared.hpp>
#include <cstdint>
#include <functional>
#include <optional>

#include "core/rng.h"
#include "core/vec.h"

namespace gpis::test {

struct ChiSquared {
  double p_value;
  double total;  // integral of the density
};

// `sample` may give nothing: with probability 1 - ∫ pdf. Cells of less than 5 expected samples are
// pooled.
inline ChiSquared chi_squared(const std::function<std::optional<Vec3>(Rng&)>& sample,
                              const std::function<double(const Vec3&)>& pdf, int samples,
                              std::uint64_t seed) {
  constexpr int kRows = 24, kColumns = 32, kFine = 24;
  std::vector<double> expected(kRows * kColumns), observed(kRows * kColumns + 1);
  double total = 0;
  for (int j = 0; j < kRows; ++j)
    for (int i = 0; i < kColumns; ++i) {
      double sum = 0;
      for (int b = 0; b < kFine; ++b)
        for (int a = 0; a < kFine; ++a) {
          const double z = -1 + 2 * (j + (b + 0.5) / kFine) / kRows,
                       phi = 2 * kPi * (i + (a + 0.5) / kFine) / kColumns;
          const double r = std::sqrt(1 - z * z);
          sum += pdf({r * std::cos(phi), r * std::sin(phi), z});
        }
      expected[j * kColumns + i] = samples * sum / (kFine * kFine) * 4 * kPi / (kRows * kColumns);
      total += expected[j * kColumns + i] / samples;
    }
  Rng rng(seed, 0);
  for (int n = 0; n < samples; ++n) {
    const std::optional<Vec3> w = sample(rng);
    if (!w) {
      ++observed.back();
      continue;
    }
    const int j = std::clamp(static_cast<int>((w->z + 1) / 2 * kRows), 0, kRows - 1);
    double phi = std::atan2(w->y, w->x);
    if (phi < 0) phi += 2 * kPi;
    ++observed[j * kColumns +
               std::clamp(static_cast<int>(phi / (2 * kPi) * kColumns), 0, kColumns - 1)];
  }
  expected.push_back(std::max(0.0, samples * (1 - total)));
  double statistic = 0, pooled_expected = 0, pooled_observed = 0;
  int cells = 0;
  const auto add = [&](double e, double o) {
    statistic += (o - e) * (o - e) / e;
    ++cells;
  };
  for (std::size_t k = 0; k < expected.size(); ++k) {
    if (expected[k] < 5) {
      pooled_expected += expected[k];
      pooled_observed += observed[k];
    } else {
      add(expected[k], observed[k]);
    }
  }
  if (pooled_expected >= 5) add(pooled_expected, pooled_observed);
  if (pooled_expected < 5 && pooled_observed > 30) return {0, total};
  const double p =
      boost::math::cdf(complement(boost::math::chi_squared(std::max(1, cells - 1)), statistic));
  return {p, total};
}

}  // namespace gpis::test

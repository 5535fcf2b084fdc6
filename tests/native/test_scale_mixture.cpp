// Mixtures of squared exponentials against the correlations that they stand for.
#include "check.h"
#include "process/scale_mixture.h"

namespace gpis {

TEST(mixtures_of_lengths_are_the_correlation) {
  using enum Radial::Family;
  for (const Radial& radial :
       {Radial{squared_exponential}, Radial{matern12}, Radial{matern32}, Radial{matern52},
        Radial{wong}, Radial{rational_quadratic, 0.3}, Radial{rational_quadratic, 1},
        Radial{rational_quadratic, 7}, Radial{rational_quadratic, 1e4}}) {
    const ScaleMixture mixture = scale_mixture(radial);
    CHECK(mixture.error, <, 5.01e-4);
    double weights = 0, slopes = 0;
    for (const auto& [weight, length] : mixture.parts) {
      CHECK(weight, >, 0);
      weights += weight;
      slopes += weight / (length * length);
    }
    CHECK(std::abs(weights - 1), <, 1e-12);
    if (radial.differentiable()) CHECK(std::abs(slopes / radial.lambda2() - 1), <, 2e-3);
    for (double q = 1e-6; q < 1e4; q *= 1.013) {
      double sum = 0;
      for (const auto& [weight, length] : mixture.parts)
        sum += weight * std::exp(-0.5 * q * q / (length * length));
      CHECK(std::abs(sum - radial.value(q)), <, mixture.error + 1e-5);
    }
  }
}

}  // namespace gpis

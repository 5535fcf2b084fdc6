#include "fit/moments.h"

namespace gpis {

Moments::Summary Moments::summary(int n, const SymMat3& slopes_if_certain) const {
  const double m1 = power[0] / n, m2 = power[1] / n, m3 = power[2] / n, m4 = power[3] / n;
  const double biased = std::max(m2 - m1 * m1, 0.0);
  const double unbias = n > 1 ? n / (n - 1.0) : 1.0;
  const double third = m3 - 3 * m1 * m2 + 2 * m1 * m1 * m1;
  const double fourth = m4 - 4 * m1 * m3 + 6 * m1 * m1 * m2 - 3 * m1 * m1 * m1 * m1;

  Vec3 slope, with;
  SymMat3 covariance;
  for (int axis = 0; axis < 3; ++axis) {
    slope[axis] = gradient[axis] / n;
    with[axis] = (with_value[axis] / n - m1 * slope[axis]) * scale * unbias;
  }
  for (int k = 0; k < 6; ++k) covariance[k] = second[k] / n;
  covariance = (covariance - square(slope)) * unbias;

  Summary out;
  out.jet = jet_of_moments(reference + scale * m1, scale * scale * biased * unbias, slope,
                           covariance, with, slopes_if_certain);
  out.mean_error = out.jet.sigma / std::sqrt(static_cast<double>(n));
  const bool certain = !(biased > 0);
  out.skewness = certain ? 0 : third / (biased * std::sqrt(biased));
  // Var σ̂ = (kurtosis - 1) σ²/4n.
  const double kurtosis = certain ? 1 : fourth / (biased * biased);
  out.sigma_error = out.jet.sigma * std::sqrt(std::max(kurtosis - 1, 0.0) / (4.0 * n));
  out.kolmogorov = 0;
  std::uint64_t below = 0;
  for (int k = 0; k + 1 < kBins && !certain; ++k) {
    below += count[k];
    const double y = (k + 1 - kBins / 2) * kBin;
    const double normal = normal_cdf((y - m1) / std::sqrt(biased));
    out.kolmogorov = std::max(out.kolmogorov, std::abs(static_cast<double>(below) / n - normal));
  }
  return out;
}

}  // namespace gpis

#include "render/scheduler.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/block_points.h"

namespace gpis {

namespace {

// Below this the estimate comes from too few blocks to stop by.
constexpr int kMinimumForNoise = 4 * kBlockSamples;

// The number of samples at which the error should fall to the threshold: it goes as 1 / samples.
double samples_for_noise(double threshold, const RenderState& state) {
  if (state.estimated_error == 0) return 0;
  return state.samples * (state.estimated_error / threshold / threshold);
}

}  // namespace

Round next_round(const StoppingRules& rules, const RenderState& state) {
  const int done = state.samples;
  const int limit = rules.samples.value_or(std::numeric_limits<int>::max());
  if (done >= limit) return {0, Round::Stop::samples};
  if (done > 0 && rules.time_limit && state.seconds >= *rules.time_limit)
    return {0, Round::Stop::time};
  if (done >= kMinimumForNoise && rules.noise_threshold &&
      state.estimated_error <= *rules.noise_threshold * *rules.noise_threshold)
    return {0, Round::Stop::noise};

  if (done < kBlockSamples && rules.time_limit)
    return {std::min({std::max(done, 1), kBlockSamples - done, limit - done})};
  if (done < kBlockSamples) return {std::min(kBlockSamples - done, limit - done)};
  int count = std::max(done / 4, 1);
  if (rules.noise_threshold && std::isfinite(state.estimated_error)) {
    const double needed =
        std::max<double>(samples_for_noise(*rules.noise_threshold, state), kMinimumForNoise);
    count = static_cast<int>(std::clamp<double>(needed - done, 1, count));
  }
  count = (count + kBlockSamples - 1) / kBlockSamples * kBlockSamples;
  return {std::min(count, limit - done)};
}

double fraction_done(const StoppingRules& rules, const RenderState& state, double paths_done) {
  double fraction = 0;
  if (rules.samples) fraction = std::max(fraction, paths_done / *rules.samples);
  if (rules.time_limit) fraction = std::max(fraction, state.seconds / *rules.time_limit);
  if (rules.noise_threshold && state.samples > 0 && std::isfinite(state.estimated_error)) {
    const double needed =
        std::max<double>(samples_for_noise(*rules.noise_threshold, state), kMinimumForNoise);
    fraction = std::max(fraction, paths_done / needed);
  }
  return std::min(fraction, 1.0);
}

}  // namespace gpis

// What to render next, decided from how far a render is: knows neither pixels nor threads.
#pragma once

#include <optional>

namespace gpis {

// When to stop; at least one is set. Whichever is reached first ends the render.
struct StoppingRules {
  std::optional<int> samples;             // per pixel
  std::optional<double> time_limit;       // seconds
  std::optional<double> noise_threshold;  // of the square root of the estimated error
};

// How far a render is. `estimated_error` is infinite where it is not known.
struct RenderState {
  int samples = 0;  // per pixel, finished everywhere
  double seconds = 0;
  double estimated_error;
};

// Samples `samples .. samples + count - 1` of every pixel; count 0: stop.
struct Round {
  enum class Stop { none, samples, time, noise };

  int count = 0;
  Stop stop = Stop::none;
};

// Rounds hold whole blocks of 16 samples and add a quarter to those there are, so that the error is
// looked at on a logarithmic scale. Exceptions: with a time limit the first round is a single
// sample (every pixel gets one, whatever the limit) and the first block is made in rounds that
// double, so that even a short render has about the same in every pixel; `samples` ends the last
// round; a noise threshold ends a round where it should be reached.
Round next_round(const StoppingRules& rules, const RenderState& state);

// Part of the whole render that is done, in [0, 1], by the rule that is nearest to its end.
// `paths_done` counts samples of the round in hand too, per pixel.
double fraction_done(const StoppingRules& rules, const RenderState& state, double paths_done);

}  // namespace gpis

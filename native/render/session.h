// One render: threads trace the rounds that the scheduler asks for into a film, until a stopping
// rule holds or it is cancelled.
#pragma once

#include <cstdint>
#include <functional>

#include "render/result.h"
#include "render/scheduler.h"

namespace gpis {

class Scene;

struct RenderOptions {
  int width = 0, height = 0;
  StoppingRules stop;
  int first_sample = 0;  // a multiple of 16: this render is the slice that starts there
  std::uint64_t seed = 0;
  int threads = 0;  // 0: all cores
};

struct Progress {
  double fraction = 0;
  double seconds = 0;
  double samples = 0;                  // per pixel, mean
  double estimated_error = kInfinity;  // after the last finished round
  double remaining = kInfinity;        // seconds, estimated; infinite while unknown
};

// `progress` is called from this thread at most ten times a second; false cancels, and the result
// holds what was done. What it throws, and what a render thread throws, ends the render and comes
// out of here.
using ProgressCallback = std::function<bool(const Progress&)>;
RenderResult render(const Scene& scene, const RenderOptions& options,
                    const ProgressCallback& progress);

}  // namespace gpis

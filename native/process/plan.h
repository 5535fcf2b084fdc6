// What is decided about a process once, before rendering: the sampler, the specialised march, and
// what can be skipped.
#pragma once

#include <memory>
#include <string>

#include "process/line_sampler.h"

namespace gpis {

struct PlannedLine {
  std::shared_ptr<const GaussianProcess> process;  // with a kernel of unit variance
  double sigma_max = 0;                            // over all space
  double skip_threshold =
      0;  // where the mean exceeds it, the surface is certainly absent (definitions B13)
  double skip_deviations = 0;  // the same in standard deviations
  // Paths are taken to be this much farther from their cubics than for a missed root in 1000 rays.
  double caution = 1;
  double condition_pull = 0;  // how far conditions may hold the mean of g from 0
  double smooth_scale = kInfinity;
  double mean_lipschitz = kInfinity, sigma_lipschitz = kInfinity;
  Box3 bounds;       // object space; outside there is no surface
  double steps = 0;  // of a ray across the bounds, should all of it be uncertain; 0: unbounded
  std::unique_ptr<const LineSampler> line_sampler;
  std::string sampler_reason;
};

// The process of -f: rays inside the body march it as others march f (definitions B7).
std::shared_ptr<const GaussianProcess> inside_out(const GaussianProcess& process);

// Throws std::invalid_argument with a sentence where the process cannot be rendered. `alone`: no
// ray ends inside the bounds on anything else, so that first passages may come out of a table.
PlannedLine plan_line(std::shared_ptr<const GaussianProcess> process, Memory memory,
                      Sampler sampler, double missed_root, bool alone = false);

}  // namespace gpis

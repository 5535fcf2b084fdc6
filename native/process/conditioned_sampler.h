// Lines of a process with conditions: those that come near one are drawn jointly with them, the
// others by the sampler that the process has without (math.md §3).
#pragma once

#include <memory>

#include "process/line_sampler.h"

namespace gpis {

// `near` draws jointly.
std::unique_ptr<LineSampler> make_conditioned(std::unique_ptr<LineSampler> near,
                                              std::unique_ptr<LineSampler> far);

}  // namespace gpis

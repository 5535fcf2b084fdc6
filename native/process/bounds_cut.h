// What bounds do to a process: where it is not outside at them, a ray that comes in is told that it
// is (definitions B4), which leaves out what lies across them.
#pragma once

#include <string>

#include "process/gaussian_process.h"

namespace gpis {

// For a plan: where on the bounds the process is most likely inside, and how likely, looked for on
// a grid over their faces. `enough`: deviations of the mean that are certain to be outside.
std::string describe_bounds(const GaussianProcess& process, const Box3& bounds, double enough);

}  // namespace gpis

// What is known of f at points, read from Python.
#pragma once

#include "binding/arguments.h"
#include "process/conditions.h"

namespace gpis {

// dict(points (C, 3), values (C,) NaN = none, normals (C, 3) NaN = none, slopes (C,) = 1, noise
// (C,) = 0); null for none.
std::shared_ptr<const Conditions> conditions_argument(const pybind11::object& value);

}  // namespace gpis

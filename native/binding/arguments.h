// Python arguments that several bindings take, and results that several give.
#pragma once

#include <pybind11/pybind11.h>

#include "core/counters.h"
#include "field/field.h"
#include "process/gaussian_process.h"

namespace gpis {

// A field, or a number as a constant field. `name` says in the error whose argument it was.
FieldPtr field_argument(const pybind11::handle& value, const std::string& name);

// 'none', 'renewal' or 'renewal+'.
Memory memory_argument(const std::string& value, const std::string& name);

// Three numbers, or one that stands for all three.
Vec3 vec_or_number(const pybind11::handle& value, const std::string& name);

pybind11::dict counters_dict(const Counters& counters);

}  // namespace gpis

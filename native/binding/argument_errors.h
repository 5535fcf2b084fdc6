// Wrong arguments as sentences, for everything the module binds.
#pragma once

#include <pybind11/pybind11.h>

namespace gpis {

// pybind11 answers arguments that it cannot convert with a TypeError that lists signatures. From
// here on the functions and methods of the module raise a ValueError instead, which names the
// argument, what it got and what it takes. To be called when everything is bound.
void explain_wrong_arguments(const pybind11::module_& m);

}  // namespace gpis

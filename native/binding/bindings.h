// One function per folder of native/, each in a file of its own (bind_<folder>.cpp), called by module.cpp in this order:
// a type must be known to Python before another one's signature names it.
#pragma once

#include <pybind11/pybind11.h>

namespace gpis {

void bind_build_info(pybind11::module_& m);
void bind_field(pybind11::module_& m);
void bind_vdb(pybind11::module_& m);
void bind_process(pybind11::module_& m);

}  // namespace gpis

#pragma once
#include <pybind11/pybind11.h>

namespace gpis {

void bind_build_info(pybind11::module_& m);

}  // namespace gpis

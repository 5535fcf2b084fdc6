// One function a file, called by module.cpp in an order in which a type is known to Python before
// another one's signature names it.
#pragma once

#include <pybind11/pybind11.h>

namespace gpis {

void bind_build_info(pybind11::module_& m);
void bind_field(pybind11::module_& m);
void bind_vdb(pybind11::module_& m);
void bind_paint(pybind11::module_& m);
void bind_kernel(pybind11::module_& m);
void bind_process(pybind11::module_& m);
void bind_realisation(pybind11::module_& m);
void bind_tree(pybind11::module_& m);
void bind_first_hits(pybind11::module_& m);
void bind_fit(pybind11::module_& m);
void bind_scene(pybind11::module_& m);
void bind_film(pybind11::module_& m);
void bind_render(pybind11::module_& m);

}  // namespace gpis

// The scene description as a Python dict (keys and defaults: docstring of Scene) to the structs of scene/description.h.
#pragma once

#include <pybind11/pybind11.h>

#include "scene/description.h"

namespace gpis {

// Throws std::invalid_argument with the path of the value and a sentence.
SceneDescription read_description(const pybind11::handle& dict);

// "none", "renewal", "renewal+" in the order of Memory.
Memory read_memory(const pybind11::handle& value, const std::string& path);

}  // namespace gpis

// The scene description as a Python dict (keys and defaults: docstring of Scene) to the structs of
// scene/description.h.
#pragma once

#include <pybind11/pybind11.h>

#include "scene/description.h"

namespace gpis {

// Reads structure: keys, types, shapes, names. Whether the values make sense is checked by Scene,
// for scenes from anywhere. Throws std::invalid_argument with the path of the value and a sentence.
SceneDescription read_description(const pybind11::handle& dict);

}  // namespace gpis

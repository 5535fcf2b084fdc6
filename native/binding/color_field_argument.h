#pragma once

#include <pybind11/pybind11.h>

#include <string>

#include "field/color_field.h"

namespace gpis {

// A ColorField, as bind_paint.cpp makes them. `name` says in the error whose argument it was.
ColorFieldPtr color_field_argument(const pybind11::handle& value, const std::string& name);

}  // namespace gpis

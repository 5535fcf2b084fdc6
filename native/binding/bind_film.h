// The film as numpy arrays: its passes, and its exact sums as they are saved.
#pragma once

#include <pybind11/pybind11.h>

#include "render/film.h"

namespace gpis {

// Pass name -> (H, W, C) float32, row 0 at the bottom.
pybind11::dict film_passes(const Film& film);

pybind11::dict film_arrays(const Film& film);
// Throws std::invalid_argument or a Python error where these are not the arrays of a film.
Film film_from_arrays(const pybind11::handle& arrays);

}  // namespace gpis

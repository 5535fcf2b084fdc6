// A render's result as Python dicts, and in a file: a numpy .npz archive (zip, so that damage is
// noticed) of the film's exact sums and one JSON text for the rest.
#pragma once

#include <pybind11/pybind11.h>

#include <memory>

#include "render/result.h"

namespace gpis {

pybind11::list history_list(const RenderResult& result);
pybind11::dict stats_dict(const RenderResult& result);

void save_result(const RenderResult& result, const pybind11::object& path);
std::shared_ptr<RenderResult> load_result(const pybind11::object& path);

}  // namespace gpis

// What first_hits and line_values are asked, read from Python, and the hits as Python gets them.
#pragma once

#include <string>

#include "binding/arguments.h"
#include "process/first_hits.h"

namespace gpis {

// What both functions take, as pybind11 passes it.
struct FirstHitsArguments {
  pybind11::object gp, origins, directions;
  std::string memory;
  pybind11::object start, inside;
  std::uint64_t first_index;
  std::string sampler;
  double tolerance;
  std::uint64_t seed;
  int threads;
};

struct FirstHitsSetup {
  TreeSurface surface;
  FirstHitsQuery query;
};

// Both, checked; rays end at t_max.
FirstHitsSetup first_hits_setup(const FirstHitsArguments& arguments, double t_max);

// What first_hits returns: arrays that hold the buffers of `hits`.
pybind11::dict hits_dict(FirstHits hits, std::size_t leaves);

}  // namespace gpis

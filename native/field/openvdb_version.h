#pragma once

#include <string>

namespace gpis {

// Of the OpenVDB this module was compiled with, "10.0.1". The version is part of its namespace, so
// no other one can answer.
std::string openvdb_version();

}  // namespace gpis

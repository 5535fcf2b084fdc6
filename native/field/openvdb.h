#pragma once
// The only way to OpenVDB's headers; the ones of openvdb/tools belong into the same block. Their
// templates must keep default visibility: with the hidden one that pybind11 asks for,
// openvdb::initialize() of the shared library crashes.

#include <string>

#pragma GCC visibility push(default)
#include <openvdb/openvdb.h>
#pragma GCC visibility pop

namespace gpis {

// Version this module was compiled with (part of its namespace, so no other one can answer),
// "10.0.1".
std::string openvdb_version();

}  // namespace gpis

#pragma once
// The only way to OpenVDB's headers; the ones of openvdb/tools belong into the same block. Their
// templates must keep default visibility: with the hidden one that pybind11 asks for,
// openvdb::initialize() of the shared library crashes.

#pragma GCC visibility push(default)
#include <openvdb/openvdb.h>
#pragma GCC visibility pop

// The only way to OpenVDB's headers; the ones of openvdb/tools belong into the same block. Their
// templates must keep default visibility: with the hidden one that pybind11 asks for,
// openvdb::initialize() of the shared library crashes.
#pragma once

#pragma GCC visibility push(default)
#include <openvdb/openvdb.h>

// Whole grids are compiled once, in openvdb_grids.cpp: their virtual functions, with all of reading
// and writing behind them, would be in each file that makes a grid (half a minute each).
namespace openvdb {
OPENVDB_USE_VERSION_NAMESPACE
namespace OPENVDB_VERSION_NAME {
extern template class tree::Tree<FloatTree::RootNodeType>;
extern template class tree::Tree<Vec3STree::RootNodeType>;
extern template class Grid<FloatTree>;
extern template class Grid<Vec3STree>;
}  // namespace OPENVDB_VERSION_NAME
}  // namespace openvdb
#pragma GCC visibility pop

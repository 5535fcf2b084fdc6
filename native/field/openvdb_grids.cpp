#include "field/openvdb.h"

#pragma GCC visibility push(default)
namespace openvdb {
OPENVDB_USE_VERSION_NAMESPACE
namespace OPENVDB_VERSION_NAME {
template class tree::Tree<FloatTree::RootNodeType>;
template class tree::Tree<Vec3STree::RootNodeType>;
template class Grid<FloatTree>;
template class Grid<Vec3STree>;
}  // namespace OPENVDB_VERSION_NAME
}  // namespace openvdb
#pragma GCC visibility pop

#include "field/openvdb.h"

namespace gpis {

std::string openvdb_version() {
  return OPENVDB_LIBRARY_VERSION_STRING;
}

}  // namespace gpis

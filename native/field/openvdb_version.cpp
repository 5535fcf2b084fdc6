#include "field/openvdb_version.h"

#include <openvdb/version.h>  // macros only, so it needs no field/openvdb.h

namespace gpis {

std::string openvdb_version() {
  return OPENVDB_LIBRARY_VERSION_STRING;
}

}  // namespace gpis

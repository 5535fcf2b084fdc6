#include "binding/bindings.h"
#include "field/openvdb_version.h"
#include "geometry/embree_api.h"

namespace gpis {
namespace py = pybind11;

void bind_build_info(py::module_& m) {
  m.def(
      "build_info",
      [] {
        const EmbreeApi& api = embree();
        py::dict info;
        info["embree"] = api.version;
        info["embree_path"] = api.path;
        info["openvdb"] = openvdb_version();
        info["compiler"] = __VERSION__;
        return info;
      },
      "Versions of the libraries in use and the file Embree came from. Opens Embree.");
}

}  // namespace gpis

#include <pybind11/pybind11.h>

#include "binding/bindings.h"

PYBIND11_MODULE(gpis_native, m) {
  m.doc() =
      "Stochastic implicit surfaces: Gaussian processes, their first hits along rays, and light "
      "transport on them.";
  gpis::bind_build_info(m);
  gpis::bind_field(m);
  gpis::bind_vdb(m);
  gpis::bind_process(m);
}

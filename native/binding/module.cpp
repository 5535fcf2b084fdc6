#include <pybind11/pybind11.h>

#include "binding/argument_errors.h"
#include "binding/bindings.h"
#include "core/errors.h"

namespace py = pybind11;

PYBIND11_MODULE(gpis_native, m) {
  m.doc() =
      "Stochastic implicit surfaces: Gaussian processes, their first hits along rays, and light "
      "transport on them.";
  // std::invalid_argument is pybind11's ValueError already.
  py::register_local_exception_translator([](std::exception_ptr error) {
    try {
      if (error) std::rethrow_exception(error);
    } catch (const gpis::FileNotFound& e) {
      PyErr_SetString(PyExc_FileNotFoundError, e.what());
    }
  });
  gpis::bind_build_info(m);
  gpis::bind_field(m);
  gpis::bind_vdb(m);
  gpis::bind_paint(m);
  gpis::bind_kernel(m);
  gpis::bind_process(m);
  gpis::bind_realisation(m);
  gpis::bind_tree(m);
  gpis::bind_first_hits(m);
  gpis::bind_fit(m);
  gpis::bind_scene(m);
  gpis::bind_film(m);
  gpis::bind_render(m);
  gpis::explain_wrong_arguments(m);
}

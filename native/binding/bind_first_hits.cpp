// First hits of many rays, and the values on their sample paths.
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <algorithm>

#include "binding/bindings.h"
#include "binding/first_hits_arguments.h"

namespace gpis {
namespace py = pybind11;
using namespace py::literals;
namespace {

// The work of C++ alone, which may have ended because Python was interrupted.
template <class Work>
auto without_python(Work work) {
  auto result = [&] {
    const py::gil_scoped_release release;
    return work();
  }();
  if (PyErr_Occurred()) throw py::error_already_set();
  return result;
}

py::dict first_hits_dict(const py::object& gp, const py::object& origins,
                         const py::object& directions, double t_max, const std::string& memory,
                         const py::object& start, const py::object& inside,
                         std::uint64_t first_index, const std::string& sampler, double tolerance,
                         std::uint64_t seed, int threads) {
  const FirstHitsSetup setup = first_hits_setup({gp, origins, directions, memory, start, inside,
                                                 first_index, sampler, tolerance, seed, threads},
                                                t_max);
  return hits_dict(without_python([&] { return first_hits(setup.surface, setup.query); }),
                   setup.surface.operands());
}

NumberArray line_values_array(const py::object& gp, const py::object& origins,
                              const py::object& directions, const std::vector<double>& t,
                              const std::string& memory, const py::object& start,
                              const py::object& inside, std::uint64_t first_index,
                              const std::string& sampler, double tolerance, std::uint64_t seed,
                              int threads) {
  if (t.empty()) throw std::invalid_argument("t must hold at least one distance.");
  const double t_max = *std::max_element(t.begin(), t.end());
  if (!(t_max > 0)) throw std::invalid_argument("t must hold a distance above 0.");
  const FirstHitsSetup setup = first_hits_setup({gp, origins, directions, memory, start, inside,
                                                 first_index, sampler, tolerance, seed, threads},
                                                t_max);
  if (setup.surface.leaves()[0].must_stand_alone())
    throw std::invalid_argument(
        "the sampler first_passage knows where a ray ends and nothing of the way to it.");
  const auto values = without_python([&] { return line_values(setup.surface, setup.query, t); });
  std::vector<py::ssize_t> shape{static_cast<py::ssize_t>(setup.query.rays.size()),
                                 static_cast<py::ssize_t>(t.size())};
  if (setup.surface.operands() > 1) shape.push_back(setup.surface.operands());
  NumberArray out(shape);
  std::copy(values.begin(), values.end(), out.mutable_data());
  return out;
}

}  // namespace

void bind_first_hits(py::module_& m) {
  m.def(
      "first_hits", &first_hits_dict, "gp"_a, "origins"_a, "directions"_a, "t_max"_a, py::kw_only(),
      "memory"_a = "renewal+", "start"_a = py::none(), "inside"_a = py::none(), "first_index"_a = 0,
      "sampler"_a = "auto", "tolerance"_a = 1e-3, "seed"_a = 0, "threads"_a = 0,
      "First change of sign from outside to inside along rays: dict of t (N,) (inf = none), "
      "position (N, 3), gradient (N, 3),\n"
      "part (N,), the leaf that was hit (-1 = none), state (the `start` of rays that leave the "
      "hits) and counters.\n\n"
      "gp: a GaussianProcess or a CSG tree; the state of a tree is value (N, leaves) and gradient "
      "(N, leaves, 3), NaN where a\nleaf was not sampled.\n"
      "origins, directions (N, 3), unit length. start: None (rays come from outside) or "
      "dict(value (N,), gradient (N, 3)):\n"
      "rays leave a point where f = value (0 on the surface), remembered as `memory` says "
      "('none', 'renewal', 'renewal+', 'global-n' for n segments, 'global').\n"
      "inside: (N,) bool, rays that travel inside the body: their first change of sign to "
      "outside.\n"
      "sampler: 'auto', 'convolution', 'markov', 'spectral', 'nystrom', 'dense', 'realisation' or "
      "'first_passage'. "
      "tolerance: probability of a missed root per "
      "ray (touches of 1e-3 deviations\n"
      "and less by rough kernels: some 5e-5, however small it is). Row i uses the random\n"
      "stream (seed, first_index + i), whatever the number of threads.");
  m.def("line_values", &line_values_array, "gp"_a, "origins"_a, "directions"_a, "t"_a,
        py::kw_only(), "memory"_a = "renewal+", "start"_a = py::none(), "inside"_a = py::none(),
        "first_index"_a = 0, "sampler"_a = "auto", "tolerance"_a = 1e-3, "seed"_a = 0,
        "threads"_a = 0,
        "Values of f at distances t (M,) on the sample paths that first_hits draws for the same "
        "arguments: (N, M); NaN where a\n"
        "path was not sampled (behind its hit, or where the surface is certainly absent).");
}

}  // namespace gpis

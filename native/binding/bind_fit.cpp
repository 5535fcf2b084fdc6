// Fits: processes composed and fitted on a grid.
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "binding/arguments.h"
#include "binding/bindings.h"
#include "field/check.h"
#include "fit/fit.h"

namespace gpis {
namespace py = pybind11;
using namespace py::literals;
namespace {

constexpr int kMostThreads = 1024;

TreePtr composed(const py::object& operands, const std::string& op, double blend) {
  if (!py::isinstance<py::sequence>(operands) || py::isinstance<py::str>(operands) ||
      py::isinstance<py::bytes>(operands))
    refuse("operands must be a list of GaussianProcesses and CSG trees, it is ",
           py::repr(operands).cast<std::string>().substr(0, 100), ".");
  std::vector<TreePtr> parts;
  for (const auto& operand : operands.cast<py::sequence>())
    parts.push_back(tree_argument(operand, "operands[" + std::to_string(parts.size()) + "]"));
  if (parts.empty()) refuse("operands is empty; it takes at least one process.");
  if (!(std::isfinite(blend) && blend >= 0))
    refuse("blend is ", blend, "; it takes a radius, 0 for none.");
  using Kind = ProcessTree::Kind;
  if (op == "smooth_union") return ProcessTree::combine(Kind::least, parts, false, op, blend);
  if (blend > 0) refuse("blend is ", blend, ": it is the radius of op 'smooth_union' alone.");
  if (op == "union") return ProcessTree::combine(Kind::least, parts, false, op);
  if (op == "intersection") return ProcessTree::combine(Kind::greatest, parts, false, op);
  if (op != "difference")
    refuse("op is '", op, "'; it takes 'union', 'intersection', 'difference' or 'smooth_union'.");
  for (std::size_t i = 1; i < parts.size(); ++i) parts[i] = ProcessTree::complement(*parts[i]);
  return ProcessTree::combine(Kind::greatest, parts, false, op);
}

FitQuery query_of(const py::object& bounds, int resolution, int realisations, std::uint64_t seed,
                  const std::string& method, double correlation, double certainty, int threads) {
  const auto corners = points_argument(bounds, "bounds");
  if (corners.size() != 2) refuse("bounds must be (min (3,), max (3,)).");
  if (method != "sample" && method != "closed_form")
    refuse("method is '", method, "'; it takes 'sample' or 'closed_form'.");
  if (threads < 0 || threads > kMostThreads)
    refuse("threads must be 0 (all cores) to ", kMostThreads, ", it is ", threads, ".");
  return {{corners[0], corners[1]}, resolution,  realisations, seed,
          method == "closed_form",  correlation, certainty,    threads};
}

// The array takes the values over: they may be most of the memory there is.
py::array_t<float> array_of(std::vector<float>&& grid, const NodeGrid& nodes, int components = 1) {
  std::vector<py::ssize_t> shape(nodes.resolution.begin(), nodes.resolution.end());
  if (components > 1) shape.push_back(components);
  auto* values = new std::vector<float>(std::move(grid));
  const py::capsule owner(values, [](void* p) { delete static_cast<std::vector<float>*>(p); });
  return py::array_t<float>(shape, values->data(), owner);
}

py::object fit(const py::object& operands, const std::string& op, const py::object& bounds,
               int resolution, int realisations, std::uint64_t seed, const std::string& method,
               double blend, double correlation, double certainty, int threads,
               const py::object& progress) {
  const TreePtr tree = composed(operands, op, blend);
  const FitQuery query =
      query_of(bounds, resolution, realisations, seed, method, correlation, certainty, threads);
  if (!progress.is_none() && !PyCallable_Check(progress.ptr()))
    refuse("compose_and_fit: progress takes a function of the fraction.");
  const auto report = [&](double fraction) {
    py::gil_scoped_acquire acquire;
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    return progress.is_none() || !progress(fraction).is(py::bool_(false));
  };
  std::optional<Fit> f;
  {
    py::gil_scoped_release release;
    f = compose_and_fit(tree, query, report);
  }
  if (!f) return py::none();
  const NodeGrid& nodes = f->nodes;
  py::dict counters("voxels"_a = nodes.count(), "voxels_drawn"_a = f->voxels_drawn,
                    "voxels_filled"_a = f->voxels_filled,
                    "length_scales_limited"_a = f->length_scales_limited,
                    "change_limited"_a = f->change_limited, "seconds"_a = f->seconds);
  const Vec3& o = nodes.origin;
  return py::dict("mean"_a = array_of(std::move(f->mean), nodes),
                  "sigma"_a = array_of(std::move(f->sigma), nodes),
                  "anisotropy"_a = array_of(std::move(f->anisotropy), nodes, 6),
                  "mean_error"_a = array_of(std::move(f->mean_error), nodes),
                  "sigma_error"_a = array_of(std::move(f->sigma_error), nodes),
                  "skewness"_a = array_of(std::move(f->skewness), nodes),
                  "kolmogorov"_a = array_of(std::move(f->kolmogorov), nodes),
                  "origin"_a = std::array<double, 3>{o.x, o.y, o.z},
                  "voxel_size"_a = nodes.voxel_size, "counters"_a = counters);
}

py::dict plan(const py::object& operands, const std::string& op, const py::object& bounds,
              int resolution, int realisations, const std::string& method, double blend,
              double correlation, double certainty, int threads) {
  const TreePtr tree = composed(operands, op, blend);
  const FitQuery query =
      query_of(bounds, resolution, realisations, 0, method, correlation, certainty, threads);
  FitPlan p;
  {
    py::gil_scoped_release release;
    p = plan_fit(tree, query);
  }
  return py::dict("resolution"_a = p.nodes.resolution, "voxel_size"_a = p.nodes.voxel_size,
                  "voxels"_a = p.nodes.count(), "voxels_drawn"_a = p.voxels_drawn,
                  "seconds"_a = p.seconds, "memory"_a = p.memory);
}

}  // namespace

void bind_fit(py::module_& m) {
  m.def(
      "compose_and_fit", &fit, "operands"_a, "op"_a, "bounds"_a, "resolution"_a, "realisations"_a,
      "seed"_a = 0, py::kw_only(), "method"_a = "sample", "blend"_a = 0.0, "correlation"_a = 0.0,
      "certainty"_a = 5.0, "threads"_a = 0, "progress"_a = py::none(),
      R"(Composes processes and fits one process to the result, on a grid: a dict for GridField, TensorGridField and write_vdb.

operands: GaussianProcesses or CSG trees. op: 'union', 'intersection', 'difference' (of the first, all others), 'smooth_union'
(`blend` its radius). bounds: (min (3,), max (3,)); resolution: nodes along the longest side, the first and last on its ends.
correlation of the operands' noises: 0 independent, 1 shared, between -1 and 1 a mixture (one kernel). method: 'sample' sums up
joint realisations; 'closed_form' takes Clark's formulas (1961), of a smooth union an integral over the difference of its two
operands: exact in mean, sigma and gradients for two operands, each further one as if the result so far were normal. Where one
operand wins by `certainty` standard deviations it is taken as it is, and nothing is drawn; inf draws everywhere.
progress(fraction) may return False to cancel: then None.

Returns mean, sigma (X, Y, Z), anisotropy (X, Y, Z, 6), the squared length scales of a squared exponential; mean_error and
sigma_error, their standard errors; skewness, and kolmogorov, the distance of the distribution to the normal one (0 where nothing
is drawn); origin (3,), voxel_size, and counters: voxels, voxels_drawn, voxels_filled (of the boxes around them), length_scales_limited (brought into one
voxel to 4 diagonals), change_limited (where lengths change too fast for their own gradients to be told apart), seconds.)");
  m.def(
      "compose_and_fit_plan", &plan, "operands"_a, "op"_a, "bounds"_a, "resolution"_a,
      "realisations"_a, py::kw_only(), "method"_a = "sample", "blend"_a = 0.0,
      "correlation"_a = 0.0, "certainty"_a = 5.0, "threads"_a = 0,
      R"(What compose_and_fit would take, from the number of nodes to sample and a trial of a few realisations of one tile.

Returns dict(resolution (3,), voxel_size, voxels, voxels_drawn, seconds, memory in bytes).)");
}

}  // namespace gpis

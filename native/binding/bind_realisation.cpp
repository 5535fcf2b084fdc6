// Realisations of a process: on grids, at points, and as meshes.
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <climits>

#include "binding/arguments.h"
#include "binding/bindings.h"
#include "field/check.h"
#include "geometry/level_set_mesh.h"
#include "process/realisation_grid.h"

namespace gpis {
namespace py = pybind11;
using namespace py::literals;
namespace {

using FloatArray = py::array_t<float, py::array::c_style | py::array::forcecast>;
constexpr int kMostThreads = 1024;

int threads_argument(int threads) {
  if (threads < 0 || threads > kMostThreads)
    refuse("threads must be 0 (all cores) to ", kMostThreads, ", it is ", threads, ".");
  return threads;
}

py::object realisation(const GaussianProcess& gp, const py::object& bounds, int resolution,
                       std::uint64_t seed, int threads, const py::object& progress) {
  const auto corners = points_argument(bounds, "bounds");
  if (corners.size() != 2) refuse("bounds must be (min (3,), max (3,)).");
  if (!progress.is_none() && !PyCallable_Check(progress.ptr()))
    refuse("realisation: progress takes a function of the fraction.");
  RealisationQuery query{{corners[0], corners[1]}, resolution, seed, threads_argument(threads)};
  const auto report = [&](double fraction) {
    py::gil_scoped_acquire acquire;
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    return progress.is_none() || !progress(fraction).is(py::bool_(false));
  };
  std::optional<RealisationGrid> grid;
  try {
    py::gil_scoped_release release;
    grid = realise(gp, query, report);
  } catch (const std::bad_alloc&) {
    throw std::runtime_error("A realisation with " + std::to_string(resolution) +
                             " nodes along its longest side takes more memory than is to be had. "
                             "Take a lower resolution.");
  }
  if (!grid) return py::none();
  const auto& [x, y, z] = grid->resolution;
  // The array takes the values over: they may be most of the memory there is.
  auto* values = new std::vector<float>(std::move(grid->values));
  const py::capsule owner(values, [](void* p) { delete static_cast<std::vector<float>*>(p); });
  const Vec3& o = grid->origin;
  return py::dict("realisation"_a = py::array_t<float>({x, y, z}, values->data(), owner),
                  "origin"_a = std::array<double, 3>{o.x, o.y, o.z},
                  "voxel_size"_a = grid->voxel_size);
}

py::dict realisation_at(const GaussianProcess& gp, const py::object& at, std::uint64_t seed, int n,
                        int threads) {
  const auto points = points_argument(at, "points");
  if (n < 0) refuse("n must not be negative, it is ", n, ".");
  threads_argument(threads);
  std::vector<FieldSample> samples;
  {
    py::gil_scoped_release release;
    samples = realise_at(gp, points, seed, n, threads);
  }
  const auto count = static_cast<py::ssize_t>(points.size());
  py::array_t<double> value({py::ssize_t{n}, count}), gradient({py::ssize_t{n}, count, {3}});
  double *v = value.mutable_data(), *g = gradient.mutable_data();
  for (const FieldSample& s : samples) {
    *v++ = s.value;
    for (int axis = 0; axis < 3; ++axis) *g++ = s.gradient[axis];
  }
  return py::dict("value"_a = value, "gradient"_a = gradient);
}

py::tuple mesh(const py::object& values, const py::object& voxel_size, const py::object& origin,
               double level) {
  const auto a = FloatArray::ensure(values);
  if (!a || a.ndim() != 3 || a.shape(0) < 2 || a.shape(1) < 2 || a.shape(2) < 2) {
    PyErr_Clear();
    refuse(
        "level_set_mesh: values must be an array (X, Y, Z) of at least 2 nodes along each axis.");
  }
  for (py::ssize_t axis = 0; axis < 3; ++axis)
    if (a.shape(axis) > INT_MAX / 2)
      refuse("level_set_mesh: values has ", a.shape(axis), " nodes along an axis, too many.");
  for (py::ssize_t i = 0; i < a.size(); ++i)
    if (!std::isfinite(a.data()[i]))
      refuse("level_set_mesh: values holds numbers that are not finite.");
  const Vec3 h = vec_or_number(voxel_size, "level_set_mesh: voxel_size");
  check_positive("level_set_mesh: voxel_size", h);
  const Vec3 o = vec_or_number(origin, "level_set_mesh: origin");
  check_finite("level_set_mesh: origin", o);
  check_finite("level_set_mesh: level", level);
  LevelSetMesh out;
  {
    py::gil_scoped_release release;
    out =
        level_set_mesh(a.data(), {int(a.shape(0)), int(a.shape(1)), int(a.shape(2))}, h, o, level);
  }
  const auto nv = static_cast<py::ssize_t>(out.vertices.size()),
             nt = static_cast<py::ssize_t>(out.triangles.size());
  py::array_t<double> vertices({nv, py::ssize_t{3}});
  py::array_t<std::int32_t> triangles({nt, py::ssize_t{3}});
  for (py::ssize_t i = 0; i < nv; ++i)
    for (int c = 0; c < 3; ++c) vertices.mutable_at(i, c) = out.vertices[i][c];
  for (py::ssize_t i = 0; i < nt; ++i)
    for (int c = 0; c < 3; ++c) triangles.mutable_at(i, c) = out.triangles[i][c];
  return py::make_tuple(vertices, triangles);
}

}  // namespace

void bind_realisation(py::module_& m) {
  auto process =
      py::reinterpret_borrow<py::class_<GaussianProcess, std::shared_ptr<GaussianProcess>>>(
          m.attr("GaussianProcess"));
  process.def(
      "realisation", &realisation, "bounds"_a, "resolution"_a, "seed"_a = 0, py::kw_only(),
      "threads"_a = 0, "progress"_a = py::none(),
      R"(One realisation of f on a grid, as a dict of realisation (X, Y, Z), origin (3,) and voxel_size.

bounds: (min (3,), max (3,)). resolution: nodes along the longest side, 2 to 512, the first and last on its ends. Where f = 0 is
the surface: see level_set_mesh, GridField, write_vdb. progress(fraction) may return False to cancel: then None. The same seed
gives the same realisation, whatever the grid and the number of threads.)");
  process.def("realisation_at", &realisation_at, "points"_a, "seed"_a = 0, "n"_a = 1, py::kw_only(),
              "threads"_a = 0,
              R"(f and its gradient at points (N, 3) of the realisations seed … seed + n - 1.

Returns dict(value (n, N), gradient (n, N, 3)).)");
  m.def(
      "level_set_mesh", &mesh, "values"_a, "voxel_size"_a, "origin"_a = 0.0, "level"_a = 0.0,
      R"(The surface values = level of a grid (X, Y, Z) as a mesh: vertices (N, 3), triangles (M, 3).

Marching tetrahedra: closed where the surface does not leave the grid; triangles face towards larger values. A dict of
GaussianProcess.realisation has all it takes.)");
}

}  // namespace gpis

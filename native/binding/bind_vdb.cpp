// .vdb files: fields from their grids, grids as arrays.
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <chrono>
#include <climits>
#include <cstdint>

#include "binding/arguments.h"
#include "binding/bindings.h"
#include "field/check.h"
#include "field/mesh_bake.h"
#include "field/vdb_field.h"
#include "field/vdb_file.h"
#include "field/vdb_tensor_field.h"

namespace gpis {
namespace py = pybind11;
using namespace py::literals;
namespace {

using FloatArray = py::array_t<float, py::array::c_style | py::array::forcecast>;
using Triple = std::array<double, 3>;

Triple to_triple(const Vec3& v) {
  return {v.x, v.y, v.z};
}
py::object voxel_size_object(const Vec3& v) {
  const bool cubic = std::abs(v.x - v.y) < 1e-6 * v.x && std::abs(v.x - v.z) < 1e-6 * v.x;
  return cubic ? py::object(py::float_(v.x)) : py::cast(to_triple(v));
}

std::shared_ptr<Field> vdb_field(const py::object& path, const std::string& grid,
                                 const std::string& meaning) {
  if (meaning != "value" && meaning != "variance")
    refuse("VdbField: meaning is '", meaning,
           "'; it takes 'value' or 'variance' (then the square root is taken).");
  const std::string file = path_argument(path, "path");
  py::gil_scoped_release release;
  return std::const_pointer_cast<Field>(load_vdb_field(
      file, grid, meaning == "variance" ? GridMeaning::variance : GridMeaning::value));
}

py::list grids(const py::object& path) {
  const std::string file = path_argument(path, "path");
  std::vector<VdbGridInfo> all;
  {
    py::gil_scoped_release release;
    all = vdb_grids(file);
  }
  py::list out;
  for (const VdbGridInfo& g : all) {
    py::dict d("name"_a = g.name, "type"_a = g.type, "resolution"_a = g.resolution,
               "voxel_size"_a = to_triple(g.voxel_size), "background"_a = g.background);
    d["min"] = g.bounds.empty() ? py::object(py::none()) : py::cast(to_triple(g.bounds.min));
    d["max"] = g.bounds.empty() ? py::object(py::none()) : py::cast(to_triple(g.bounds.max));
    d["value_range"] =
        g.values ? py::cast(std::pair(g.values->min, g.values->max)) : py::object(py::none());
    out.append(d);
  }
  return out;
}

void write(const py::object& path, const py::dict& grids) {
  VdbArrays arrays;
  bool has_nodes = false;
  const auto add = [&](const std::string& name, const FloatArray& a, int first, int components) {
    VdbArray grid{name, components, {}};
    const auto stored = a.ndim() == 3 ? 1 : a.shape(3);
    const py::ssize_t nodes = a.size() / stored;
    grid.values.reserve(nodes * components);
    for (py::ssize_t n = 0; n < nodes; ++n)
      for (int c = 0; c < components; ++c) {
        const float v = a.data()[n * stored + first + c];
        if (!std::isfinite(v)) refuse("write_vdb: '", name, "' holds values that are not finite.");
        grid.values.push_back(v);
      }
    arrays.grids.push_back(std::move(grid));
  };
  for (const auto& [key, value] : grids) {
    if (!py::isinstance<py::str>(key))
      refuse("write_vdb: the dict has the key ", py::repr(key).cast<std::string>(),
             "; the name of a grid is a text.");
    const auto name = key.cast<std::string>();
    // `counters` say how a fit was made.
    if (name == "origin" || name == "voxel_size" || name == "counters") continue;
    const auto a = FloatArray::ensure(value);
    if (!a) {
      PyErr_Clear();
      refuse("write_vdb: '", name, "' is not an array of numbers.");
    }
    const bool tensor = name == "anisotropy";
    if (!(tensor ? a.ndim() == 4 && a.shape(3) == 6
                 : a.ndim() == 3 || (a.ndim() == 4 && a.shape(3) == 3)) ||
        a.size() == 0)
      refuse("write_vdb: '", name, "' has the shape ",
             py::str(py::tuple(a.attr("shape"))).cast<std::string>(),
             tensor ? "; it takes (X, Y, Z, 6)." : "; a grid takes (X, Y, Z) or (X, Y, Z, 3).");
    const Index3 nodes{int(a.shape(0)), int(a.shape(1)), int(a.shape(2))};
    if (has_nodes && nodes != arrays.resolution)
      refuse("write_vdb: '", name,
             "' has another shape than the grids before it; all stand on the same nodes.");
    arrays.resolution = nodes;
    has_nodes = true;
    if (tensor) {
      add(kAnisotropyGrids[0], a, 0, 3);
      add(kAnisotropyGrids[1], a, 3, 3);
    } else {
      add(name, a, 0, a.ndim() == 3 ? 1 : 3);
    }
  }
  if (!has_nodes)
    refuse("write_vdb: there is no grid in the dict; give at least one, such as 'mean'.");
  for (const char* key : {"origin", "voxel_size"})
    if (!grids.contains(key))
      refuse("write_vdb: the dict has no '", key, "'; say where the nodes are.");
  arrays.voxel_size = vec_or_number(grids["voxel_size"], "write_vdb: voxel_size");
  check_positive("write_vdb: voxel_size", arrays.voxel_size);
  arrays.origin = vec_or_number(grids["origin"], "write_vdb: origin");
  check_finite("write_vdb: origin", arrays.origin);
  const std::string file = path_argument(path, "write_vdb: path");
  check_replaceable(file, "write_vdb: path");
  py::gil_scoped_release release;
  write_vdb(file, arrays);
}

py::array_t<float> array_of(const VdbArray& grid, const Index3& n) {
  std::vector<py::ssize_t> shape(n.begin(), n.end());
  if (grid.components > 1) shape.push_back(grid.components);
  return py::array_t<float>(shape, grid.values.data());
}

py::dict read(const py::object& path, const std::vector<std::string>& names) {
  const std::string file = path_argument(path, "path");
  VdbArrays arrays;
  {
    py::gil_scoped_release release;
    arrays = read_vdb(file, names);
  }
  py::dict out;
  for (const VdbArray& grid : arrays.grids)
    out[grid.name.c_str()] = array_of(grid, arrays.resolution);
  if (out.contains(kAnisotropyGrids[0]) && out.contains(kAnisotropyGrids[1])) {
    out["anisotropy"] = py::module_::import("numpy").attr("concatenate")(
        py::make_tuple(out[kAnisotropyGrids[0]], out[kAnisotropyGrids[1]]), "axis"_a = -1);
    for (const char* name : kAnisotropyGrids) out.attr("pop")(name);
  }
  out["origin"] = py::cast(to_triple(arrays.origin));
  out["voxel_size"] = voxel_size_object(arrays.voxel_size);
  return out;
}

// Indices of vertices. Whole numbers beyond int are kept out of range, for the bake to refuse them.
std::vector<std::array<int, 3>> faces_argument(const py::object& triangles) {
  const py::array given = py::array::ensure(triangles);
  PyErr_Clear();
  if (!given || given.ndim() != 2 || given.shape(1) != 3)
    refuse("bake_mesh_distance: triangles takes integers of shape (M, 3).");
  if (given.size() > 0 && given.dtype().kind() != 'i' && given.dtype().kind() != 'u')
    refuse("bake_mesh_distance: triangles takes integers, got numbers of type ",
           py::str(given.dtype()).cast<std::string>(), ".");
  const auto indices = py::array_t<std::int64_t, py::array::forcecast>::ensure(given);
  std::vector<std::array<int, 3>> faces(indices.shape(0));
  for (py::ssize_t i = 0; i < indices.shape(0); ++i)
    for (int c = 0; c < 3; ++c)
      faces[i][c] = static_cast<int>(std::clamp<std::int64_t>(indices.at(i, c), -1, INT_MAX));
  return faces;
}

py::object bake(const py::array_t<double, py::array::c_style | py::array::forcecast>& vertices,
                const py::object& triangles, const py::object& path, int resolution, double margin,
                double narrow_band, const py::object& progress) {
  if (vertices.ndim() != 2 || vertices.shape(1) != 3)
    refuse("bake_mesh_distance: vertices has ", vertices.ndim(), " dimensions; it takes (N, 3).");
  std::vector<Vec3> points(vertices.shape(0));
  for (py::ssize_t i = 0; i < vertices.shape(0); ++i)
    points[i] = {vertices.at(i, 0), vertices.at(i, 1), vertices.at(i, 2)};
  const std::vector<std::array<int, 3>> faces = faces_argument(triangles);
  if (!progress.is_none() && !PyCallable_Check(progress.ptr()))
    refuse("bake_mesh_distance: progress takes a function of the fraction.");
  const auto report_progress = [&](double fraction) {
    py::gil_scoped_acquire acquire;
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    return progress.is_none() || !progress(fraction).is(py::bool_(false));
  };
  const std::string file = path_argument(path, "bake_mesh_distance: path");
  check_replaceable(file, "bake_mesh_distance: path");
  const auto start = std::chrono::steady_clock::now();
  std::optional<MeshBake> report;
  {
    py::gil_scoped_release release;
    report =
        bake_mesh_distance(points, faces, file, resolution, margin, narrow_band, report_progress);
  }
  if (!report) return py::none();
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return py::dict("voxel_size"_a = report->voxel_size, "origin"_a = to_triple(report->origin),
                  "resolution"_a = report->resolution,
                  "closed"_a = report->open_edges == 0 && !report->meets_itself,
                  "open_edges"_a = report->open_edges, "meets_itself"_a = report->meets_itself,
                  "seconds"_a = seconds);
}

}  // namespace

void bind_vdb(py::module_& m) {
  m.def("VdbField", &vdb_field, "path"_a, "grid"_a, "meaning"_a = "value",
        R"(A Field from a float or double grid of a .vdb file, trilinear between its voxels.

meaning: 'value', or 'variance' where the square root is to be taken. Its support is the box of the active voxels; outside
stands the grid's background (level sets get their inside and outside first). A grid that its transform rotates or shears
is continued by its nearest value. FileNotFoundError, or ValueError with a sentence: no grid of that name, another type,
no active voxel, NaN or infinite voxels, negative variance, a frustum.)");
  m.def(
      "VdbTensorField",
      [](const py::object& path) {
        const std::string file = path_argument(path, "path");
        py::gil_scoped_release release;
        return std::const_pointer_cast<TensorField>(load_vdb_tensor_field(file));
      },
      "path"_a,
      R"(A TensorField from the grids 'anisotropy_diagonal' (xx,yy,zz) and 'anisotropy_offdiagonal' (xy,xz,yz) of a .vdb file.

Trilinear between the voxels of the box of the active ones of the first, the nearest value outside; entries are in object
units whatever the grids' transform. FileNotFoundError, or ValueError with a sentence: no such grids, another type, different
transforms, no active voxel, a matrix that is not positive definite.)");
  m.def("vdb_grids", &grids, "path"_a, R"(What a .vdb file holds: a list of dicts with

name, type ('float', 'vec3s', ...), resolution (3,) nodes of the box of active voxels, min (3,) and max (3,) of these nodes
(None where none is active), voxel_size (3,), value_range (min, max) and background (None unless float or double).)");
  m.def("write_vdb", &write, "path"_a, "grids"_a,
        R"(Writes a new .vdb file from a dict of arrays on the same nodes.

grids: origin (3,), voxel_size (a number or three), and arrays (X, Y, Z), (X, Y, Z, 3), or (X, Y, Z, 6) as 'anisotropy' (entries
xx,yy,zz,xy,xz,yz, kept as two vector grids). What compose_and_fit returns is such a dict; its counters are left
out. Single precision; every node is active, blocks of one value take no memory. ValueError, FileNotFoundError (folder).)");
  m.def(
      "read_vdb", &read, "path"_a, py::kw_only(), "names"_a = std::vector<std::string>{},
      R"(Grids of a .vdb file as a dict of arrays (X, Y, Z) or (X, Y, Z, 3), 'anisotropy' (X, Y, Z, 6), origin and voxel_size.

Arrays cover the box of all active voxels of the grids read (`names`, or all of them), which must stand on the same nodes.)");
  m.def(
      "bake_mesh_distance", &bake, "vertices"_a, "triangles"_a, "path"_a, py::kw_only(),
      "resolution"_a = 96, "margin"_a = 0.0, "narrow_band"_a = 0.0, "progress"_a = py::none(),
      R"(Bakes the signed distance from a triangle mesh, positive outside, into the grid 'mean' of a new .vdb file.

vertices (N, 3), triangles (M, 3) of indices, facing outwards (a mesh that is inside out as a whole is turned). The nodes cover
the mesh's bounds with `margin` around them, `resolution` of them along the longest side. Distances beyond `narrow_band` (0: none)
are cut off there: blocks of such nodes take no memory. Keep it above 6 standard deviations, or the random surface fills the
space beyond. An open mesh, or one that meets itself, is closed where its generalized winding number is 1/2. progress(fraction) may return False to cancel.

Returns dict(voxel_size, origin (3,), resolution (3,), closed, open_edges, meets_itself, seconds), or None where cancelled (then no file
is written). closed: without open edges and not meeting itself, so that the distance is exact at every node. ValueError: no triangle with an area,
indices out of range, coordinates not finite, a mesh that encloses nothing, or is thinner than a voxel everywhere.)");
}

}  // namespace gpis

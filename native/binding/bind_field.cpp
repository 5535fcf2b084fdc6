// Scalar fields: analytic ones, grids, and what is made of other fields.
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "binding/arguments.h"
#include "binding/bindings.h"
#include "field/box_field.h"
#include "field/check.h"
#include "field/clamped_field.h"
#include "field/constant_field.h"
#include "field/grid_field.h"
#include "field/plane_field.h"
#include "field/scaled_field.h"
#include "field/sphere_field.h"
#include "field/sum_field.h"
#include "field/tensor_grid_field.h"
#include "field/torus_field.h"
#include "field/transformed_field.h"
#include "field/transformed_tensor_field.h"

namespace gpis {
namespace py = pybind11;
using namespace py::literals;
namespace {

using Array = py::array_t<double, py::array::c_style | py::array::forcecast>;
using SharedField = std::shared_ptr<Field>;
using Triple = std::array<double, 3>;

Vec3 to_vec(const Triple& v) {
  return {v[0], v[1], v[2]};
}
Triple to_triple(const Vec3& v) {
  return {v.x, v.y, v.z};
}

std::string shape_text(const py::array& a) {
  return py::str(py::tuple(a.attr("shape"))).cast<std::string>();
}

void check_points(const Array& points) {
  if (points.ndim() != 2 || points.shape(1) != 3)
    refuse("points has the shape ", shape_text(points), "; a field takes (N, 3).");
}
Vec3 row(const Array& a, py::ssize_t i) {
  return {a.at(i, 0), a.at(i, 1), a.at(i, 2)};
}

Array values_at(const Field& field, const Array& points) {
  check_points(points);
  Array out(points.shape(0));
  for (py::ssize_t i = 0; i < points.shape(0); ++i) out.mutable_at(i) = field.value(row(points, i));
  return out;
}

Array gradients_at(const Field& field, const Array& points) {
  check_points(points);
  Array out({points.shape(0), py::ssize_t{3}});
  for (py::ssize_t i = 0; i < points.shape(0); ++i) {
    const Vec3 g = field.sample(row(points, i)).gradient;
    for (int c = 0; c < 3; ++c) out.mutable_at(i, c) = g[c];
  }
  return out;
}

std::shared_ptr<GridField> make_grid(const Array& values, const py::object& voxel_size,
                                     const Triple& origin, std::optional<double> background) {
  if (values.ndim() != 3)
    refuse("GridField: values has the shape ", shape_text(values), "; it takes (X, Y, Z).");
  const auto v = values.unchecked<3>();
  std::size_t bad = 0;
  Index3 first{};
  for (int i = 0; i < v.shape(0); ++i)
    for (int j = 0; j < v.shape(1); ++j)
      for (int k = 0; k < v.shape(2); ++k)
        if (!std::isfinite(static_cast<float>(v(i, j, k))) && bad++ == 0) first = {i, j, k};
  if (bad > 0)
    refuse("GridField: ", bad,
           " of the values are not finite single-precision numbers, the first at [", first[0], ", ",
           first[1], ", ", first[2], "].");
  const Index3 nodes{static_cast<int>(v.shape(0)), static_cast<int>(v.shape(1)),
                     static_cast<int>(v.shape(2))};
  auto grid = std::make_shared<BrickGrid>(
      nodes, [&](int i, int j, int k) { return static_cast<float>(v(i, j, k)); });
  return std::make_shared<GridField>(std::move(grid),
                                     vec_or_number(voxel_size, "GridField: voxel_size"),
                                     to_vec(origin), background);
}

using SharedTensorField = std::shared_ptr<TensorField>;

std::shared_ptr<TensorGridField> make_tensor_grid(const Array& values, const py::object& voxel_size,
                                                  const Triple& origin) {
  if (values.ndim() != 4 || values.shape(3) != 6)
    refuse("TensorGridField: values has the shape ", shape_text(values),
           "; it takes (X, Y, Z, 6), entries xx,yy,zz,xy,xz,yz.");
  const auto v = values.unchecked<4>();
  const Index3 nodes{static_cast<int>(v.shape(0)), static_cast<int>(v.shape(1)),
                     static_cast<int>(v.shape(2))};
  TensorGridField::Bricks bricks;
  for (int e = 0; e < 6; ++e)
    bricks[e] = std::make_shared<BrickGrid>(
        nodes, [&](int i, int j, int k) { return static_cast<float>(v(i, j, k, e)); });
  const Vec3 size = vec_or_number(voxel_size, "TensorGridField: voxel_size");
  check_positive("TensorGridField: voxel_size", size);
  check_finite("TensorGridField: origin", to_vec(origin));
  const Affine map{{Vec3{size.x, 0, 0}, Vec3{0, size.y, 0}, Vec3{0, 0, size.z}}, to_vec(origin)};
  return std::make_shared<TensorGridField>(std::move(bricks), map, [](const Index3& at) {
    std::ostringstream text;
    text << "TensorGridField: values[" << at[0] << ", " << at[1] << ", " << at[2] << ']';
    return text.str();
  });
}

Array tensors_at(const TensorField& field, const Array& points) {
  check_points(points);
  Array out({points.shape(0), py::ssize_t{6}});
  for (py::ssize_t i = 0; i < points.shape(0); ++i) {
    const SymMat3 a = field.value(row(points, i));
    for (int e = 0; e < 6; ++e) out.mutable_at(i, e) = a[e];
  }
  return out;
}

Array tensor_gradients_at(const TensorField& field, const Array& points) {
  check_points(points);
  Array out({points.shape(0), py::ssize_t{3}, py::ssize_t{6}});
  for (py::ssize_t i = 0; i < points.shape(0); ++i) {
    const TensorSample s = field.sample(row(points, i));
    for (int c = 0; c < 3; ++c)
      for (int e = 0; e < 6; ++e) out.mutable_at(i, c, e) = s.gradient[c][e];
  }
  return out;
}

py::object support_of(const Field& field) {
  const auto box = field.support();
  if (!box) return py::none();
  return py::make_tuple(to_triple(box->min), to_triple(box->max));
}

void bind_line(py::module_& m) {
  py::class_<FieldLine, std::shared_ptr<FieldLine>>(
      m, "FieldLine", R"(A field along the ray o + t d, smooth on pieces: what the ray marchers use.

Visit the pieces in order: b = next_break(a); enter(a, b); then evaluate and sample belong to that piece, ends included.)")
      .def("next_break", &FieldLine::next_break, "t"_a,
           "The first t' > t where the derivative may jump; inf if there is none.")
      .def("enter", &FieldLine::enter, "a"_a, "b"_a, "Selects the piece that holds (a, b).")
      .def(
          "evaluate",
          [](const FieldLine& line, double t) {
            double value, derivative;
            line.evaluate(t, value, derivative);
            return std::pair(value, derivative);
          },
          "t"_a, "(value, derivative by t) of the selected piece.")
      .def("above_until", &FieldLine::above_until, "t"_a, "t_end"_a, "threshold"_a,
           "A t' >= t such that the field exceeds threshold on all of (t, t'); t if nothing can be "
           "said.")
      .def(
          "sample",
          [](const FieldLine& line, double t) {
            const FieldSample s = line.sample(t);
            return std::pair(s.value, to_triple(s.gradient));
          },
          "t"_a, "(value, gradient (3,)) of the selected piece.");
}

void bind_base(py::module_& m) {
  const auto add = [](const SharedField& a, const SharedField& b) -> SharedField {
    return std::make_shared<SumField>(a, b);
  };
  const auto add_number = [](const SharedField& a, double b) -> SharedField {
    return std::make_shared<SumField>(a, std::make_shared<ConstantField>(b));
  };
  const auto scale = [](const SharedField& a, double s) -> SharedField {
    return std::const_pointer_cast<Field>(scaled(a, s));
  };
  py::class_<Field, SharedField>(m, "Field",
                                 R"(A scalar field over space, in its own (object) units.

field(points (N, 3)) -> (N,); field.gradient(points) -> (N, 3). Fields add to fields and numbers and multiply by numbers.)")
      .def("__call__", &values_at, "points"_a, "Values (N,) at points (N, 3).")
      .def("gradient", &gradients_at, "points"_a,
           "Exact gradients (N, 3) of the field, as it is interpolated, at points (N, 3).")
      .def("__add__", add, py::arg("other").none(false), py::is_operator())
      .def("__add__", add_number, py::is_operator())
      .def("__radd__", add_number, py::is_operator())
      .def("__mul__", scale, py::is_operator())
      .def("__rmul__", scale, py::is_operator())
      .def(
          "clamped",
          [](const SharedField& f, double low, double high) -> SharedField {
            return std::make_shared<ClampedField>(f, low, high);
          },
          "low"_a, "high"_a, "The field kept between low and high. ValueError if low > high.")
      .def(
          "transformed",
          [](const SharedField& f, const Array& matrix) -> SharedField {
            return std::const_pointer_cast<Field>(transformed(f, affine_argument(matrix)));
          },
          "matrix"_a,
          "The field moved by an affine matrix (4, 4): its value at x is the field's at matrix⁻¹ "
          "x. A grid that is rotated or "
          "sheared is continued by its nearest value. ValueError if the matrix is singular.")
      .def(
          "line",
          [](const SharedField& f, const Triple& o, const Triple& d) {
            if (!(length(to_vec(d)) > 0) || !is_finite(to_vec(d)) || !is_finite(to_vec(o)))
              refuse("line: origin + t direction is ", to_vec(o), " + t ", to_vec(d),
                     "; it takes finite numbers and a direction of non-zero length.");
            // Not py::keep_alive, which crashes (pybind11 3.1.0) where an argument is wrong.
            return std::shared_ptr<FieldLine>(f->line(to_vec(o), to_vec(d)).release(),
                                              [f](FieldLine* line) { delete line; });
          },
          "origin"_a, "direction"_a,
          "The field along origin + t direction (not normalised), as a FieldLine.")
      .def_property_readonly(
          "range", [](const Field& f) { return std::pair(f.range().min, f.range().max); },
          "Certified (least, greatest) value over all space.")
      .def_property_readonly("lipschitz", &Field::lipschitz,
                             "An upper bound of the length of the gradient inside support.")
      .def_property_readonly(
          "smooth_scale", &Field::smooth_scale,
          "Length below which a piece along a ray is close to a cubic; inf where it is one.")
      .def_property_readonly("support", &support_of,
                             "(min (3,), max (3,)) of the box outside of which a grid is only "
                             "continued; None if there is none.");
}

void bind_tensor_field(py::module_& m) {
  py::class_<TensorField, SharedTensorField>(
      m, "TensorField",
      "A field of symmetric positive definite matrices, entries xx,yy,zz,xy,xz,yz: squared length "
      "scales A(x).")
      .def("__call__", &tensors_at, "points"_a, "Entries (N, 6) at points (N, 3).")
      .def("gradient", &tensor_gradients_at, "points"_a,
           "Exact derivatives (N, 3, 6) of the entries, as they are interpolated, by x, y and z.")
      .def(
          "transformed",
          [](const SharedTensorField& f, const Array& matrix) -> SharedTensorField {
            return std::make_shared<TransformedTensorField>(f, affine_argument(matrix));
          },
          "matrix"_a,
          "The field moved by an affine matrix M (4, 4), as the length scales of a process that is "
          "moved: M A(M⁻¹x) Mᵀ.")
      .def_property_readonly(
          "eigenvalues",
          [](const TensorField& f) {
            const Range r = f.eigenvalues();
            return std::pair(r.min, r.max);
          },
          "Certified (least, greatest) eigenvalue over all space.");
  py::class_<TensorGridField, TensorField, std::shared_ptr<TensorGridField>>(
      m, "TensorGridField",
      R"(A regular grid of symmetric positive definite matrices, each entry trilinear between nodes.

values (X, Y, Z, 6), entries xx,yy,zz,xy,xz,yz, at least 2 nodes along each axis, kept in single precision: values[i, j, k] stands
at origin + (i, j, k)·voxel_size. Outside the nodes' box: the nearest value. ValueError where a node's matrix is not positive definite.)")
      .def(py::init(&make_tensor_grid), "values"_a, "voxel_size"_a, "origin"_a = Triple{0, 0, 0});
}

}  // namespace

void bind_field(py::module_& m) {
  bind_tensor_field(m);
  bind_line(m);
  bind_base(m);

  py::class_<ConstantField, Field, std::shared_ptr<ConstantField>>(m, "ConstantField",
                                                                   "The same value everywhere.")
      .def(py::init<double>(), "value"_a);
  py::class_<PlaneField, Field, std::shared_ptr<PlaneField>>(
      m, "PlaneField",
      "slope · signed distance from the plane through point; positive where normal (any length) "
      "points.")
      .def(py::init([](const Triple& point, const Triple& normal, double slope) {
             return std::make_shared<PlaneField>(to_vec(point), to_vec(normal), slope);
           }),
           "point"_a, "normal"_a, "slope"_a = 1.0);
  py::class_<SphereField, Field, std::shared_ptr<SphereField>>(
      m, "SphereField", "Signed distance from a sphere, positive outside.")
      .def(py::init([](const Triple& center, double radius) {
             return std::make_shared<SphereField>(to_vec(center), radius);
           }),
           "center"_a, "radius"_a);
  py::class_<BoxField, Field, std::shared_ptr<BoxField>>(
      m, "BoxField",
      "Exact signed distance from a box along the axes; size: its three side lengths.")
      .def(py::init([](const Triple& center, const Triple& size) {
             return std::make_shared<BoxField>(to_vec(center), to_vec(size));
           }),
           "center"_a, "size"_a);
  py::class_<TorusField, Field, std::shared_ptr<TorusField>>(
      m, "TorusField",
      "Signed distance from a torus: major_radius from the centre to the middle of the tube, "
      "minor_radius of the tube.")
      .def(py::init([](const Triple& center, const Triple& axis, double major, double minor) {
             return std::make_shared<TorusField>(to_vec(center), to_vec(axis), major, minor);
           }),
           "center"_a, "axis"_a, "major_radius"_a, "minor_radius"_a);
  py::class_<GridField, Field, std::shared_ptr<GridField>>(
      m, "GridField", R"(A regular grid, trilinear between nodes.

values (X, Y, Z), at least 2 along each axis, kept in single precision: values[i, j, k] stands at origin + (i, j, k)·voxel_size.
voxel_size: a number or three. Outside the nodes' box: background if one is given, else the nearest value; rays of a process
are clipped to that box. ValueError on values that are not finite.)")
      .def(py::init(&make_grid), "values"_a, "voxel_size"_a, "origin"_a = Triple{0, 0, 0},
           py::kw_only(), "background"_a = py::none());
}

}  // namespace gpis

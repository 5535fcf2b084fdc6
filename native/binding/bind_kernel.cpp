// Kernels: covariances of g, and their algebra.
#include <pybind11/operators.h>
#include <pybind11/pybind11.h>

#include "binding/arguments.h"
#include "binding/bindings.h"
#include "field/check.h"
#include "kernel/locally_periodic.h"
#include "kernel/plane_wave.h"
#include "kernel/product_kernel.h"
#include "kernel/scaled_kernel.h"
#include "kernel/stationary_kernel.h"
#include "kernel/sum_kernel.h"

namespace gpis {
namespace py = pybind11;
using namespace py::literals;
namespace {

using SharedKernel = std::shared_ptr<Kernel>;

LengthScales scales_argument(const py::object& length_scale, const py::object& rotation) {
  const Vec3 lengths = vec_or_number(length_scale, "length_scale");
  if (rotation.is_none()) return lengths;
  const NumberArray q =
      numbers_argument(rotation, 4, "rotation must be a quaternion (w, x, y, z).");
  return {lengths, {q.at(0), q.at(1), q.at(2), q.at(3)}};
}

double number_argument(const py::handle& value, const std::string& name) {
  const auto a = NumberArray::ensure(value);
  if (a && a.ndim() == 0) return *a.data();
  PyErr_Clear();
  throw std::invalid_argument(name + " must be a number, it is " +
                              py::repr(value).cast<std::string>() + ".");
}

Vec3 vector_argument(const py::handle& value, const std::string& name) {
  const NumberArray a = numbers_argument(value, 3, (name + " must hold three numbers.").c_str());
  const Vec3 v{a.at(0), a.at(1), a.at(2)};
  if (!is_finite(v)) throw std::invalid_argument(name + " must hold finite numbers.");
  return v;
}

// visit(out, r) for every pair of points; `shape` is that of one entry.
template <class Visit>
NumberArray for_pairs(const py::object& x, const py::object& y,
                      const std::vector<py::ssize_t>& shape, Visit visit) {
  const auto a = points_argument(x, "x"), b = points_argument(y, "y");
  std::vector<py::ssize_t> whole{static_cast<py::ssize_t>(a.size()),
                                 static_cast<py::ssize_t>(b.size())};
  py::ssize_t size = 1;
  for (const py::ssize_t s : shape) {
    whole.push_back(s);
    size *= s;
  }
  NumberArray out(whole);
  double* entry = out.mutable_data();
  for (const Vec3& p : a)
    for (const Vec3& q : b) {
      visit(entry, p - q);
      entry += size;
    }
  return out;
}

void check_differentiable(const Kernel& k) {
  if (!k.differentiable())
    refuse("The kernel ", k.describe(), " has no gradient: g is not differentiable.");
}

NumberArray gradients(const Kernel& k, const py::object& x, const py::object& y) {
  check_differentiable(k);
  return for_pairs(x, y, {3}, [&](double* out, const Vec3& r) {
    const Vec3 g = k.gradient(r);
    for (int i = 0; i < 3; ++i) out[i] = g[i];
  });
}

NumberArray mixed_derivatives(const Kernel& k, const py::object& x, const py::object& y) {
  check_differentiable(k);
  return for_pairs(x, y, {3, 3}, [&](double* out, const Vec3& r) {
    const Mat3 m = k.mixed(r);
    for (int i = 0; i < 9; ++i) out[i] = m.row[i / 3][i % 3];
  });
}

const char* family_name(Radial::Family family) {
  switch (family) {
    case Radial::Family::constant:
      return "constant";
    case Radial::Family::squared_exponential:
      return "squared exponential";
    case Radial::Family::matern12:
      return "matern 1/2";
    case Radial::Family::matern32:
      return "matern 3/2";
    case Radial::Family::matern52:
      return "matern 5/2";
    case Radial::Family::rational_quadratic:
      return "rational quadratic";
    case Radial::Family::wong:
      return "wong";
  }
  return "";
}

py::object terms_list(const Kernel& k) {
  const auto terms = k.terms();
  if (!terms) return py::none();
  py::list out;
  for (const Term& t : *terms) {
    NumberArray whitening({3, 3}), wave_vector(3);
    for (int i = 0; i < 9; ++i) whitening.mutable_at(i / 3, i % 3) = t.whitening.row[i / 3][i % 3];
    for (int i = 0; i < 3; ++i) wave_vector.mutable_at(i) = t.wave_vector[i];
    py::dict term("weight"_a = t.weight, "family"_a = family_name(t.radial.family),
                  "whitening"_a = whitening, "wave_vector"_a = wave_vector);
    if (t.radial.family == Radial::Family::rational_quadratic) term["alpha"] = t.radial.alpha;
    out.append(term);
  }
  return out;
}

SharedKernel scaled(const SharedKernel& k, double weight) {
  return std::make_shared<ScaledKernel>(weight, k);
}

constexpr const char* kScales =
    "length_scale: number or (3,), in the unit of the process's space, inf = constant along that "
    "axis; rotation: quaternion\n(w, x, y, z) that turns the axes of the length scales.";

void bind_families(py::module_& m) {
  const py::arg_v no_rotation = "rotation"_a = py::none();
  const std::string scales = kScales;
  py::class_<SquaredExponential, Kernel, std::shared_ptr<SquaredExponential>>(
      m, "SquaredExponential",
      ("exp(-q²/2), q² = rᵀA⁻¹r: infinitely smooth. Seyb et al. 2024.\n\n" + scales).c_str())
      .def(py::init([](const py::object& length_scale, const py::object& rotation) {
             return std::make_shared<SquaredExponential>(scales_argument(length_scale, rotation));
           }),
           "length_scale"_a, py::kw_only(), no_rotation);
  py::class_<Matern, Kernel, std::shared_ptr<Matern>>(
      m, "Matern",
      ("Matérn correlation, rough: nu = 0.5 (no gradient: free flight only, renders refuse it), "
       "1.5 (once differentiable) or 2.5.\n\n" +
       scales)
          .c_str())
      .def(py::init([](const py::object& nu, const py::object& length_scale, const py::object& r) {
             return std::make_shared<Matern>(number_argument(nu, "nu"),
                                             scales_argument(length_scale, r));
           }),
           "nu"_a, "length_scale"_a, py::kw_only(), no_rotation);
  py::class_<RationalQuadratic, Kernel, std::shared_ptr<RationalQuadratic>>(
      m, "RationalQuadratic",
      ("(1 + q²/2α)^{-α}: bumps of all scales, with a long memory.\n\n" + scales).c_str())
      .def(py::init(
               [](const py::object& alpha, const py::object& length_scale, const py::object& r) {
                 return std::make_shared<RationalQuadratic>(number_argument(alpha, "alpha"),
                                                            scales_argument(length_scale, r));
               }),
           "alpha"_a, "length_scale"_a, py::kw_only(), no_rotation);
  py::class_<Wong, Kernel, std::shared_ptr<Wong>>(
      m, "Wong",
      ("(3/2) e^{-q/√3} - (1/2) e^{-√3 q}: its first passage is known in closed form. Wong "
       "1966.\n\n" +
       scales)
          .c_str())
      .def(py::init([](const py::object& length_scale, const py::object& rotation) {
             return std::make_shared<Wong>(scales_argument(length_scale, rotation));
           }),
           "length_scale"_a, py::kw_only(), no_rotation);
  py::class_<PlaneWave, Kernel, std::shared_ptr<PlaneWave>>(
      m, "PlaneWave",
      "cos(k·r): one cosine of random amplitude and phase. wave_vector: k (3,), 2π over the wave "
      "length.")
      .def(py::init([](const py::object& wave_vector) {
             return std::make_shared<PlaneWave>(vector_argument(wave_vector, "wave_vector"));
           }),
           "wave_vector"_a);
  py::class_<LocallyPeriodic, Kernel, std::shared_ptr<LocallyPeriodic>>(
      m, "LocallyPeriodic",
      ("exp(-2 sin²(π s/p)/ℓ_p²) exp(-q²/2), s = axis·r: repeats with `period` p along `axis` and "
       "drifts apart over the length\nscale; ℓ_p = periodic_scale (no unit), small = sharp.\n\n" +
       scales)
          .c_str())
      .def(py::init([](const py::object& length_scale, const py::object& period,
                       const py::object& axis, const py::object& periodic_scale,
                       const py::object& rotation) {
             return std::make_shared<LocallyPeriodic>(
                 scales_argument(length_scale, rotation), number_argument(period, "period"),
                 vector_argument(axis, "axis"), number_argument(periodic_scale, "periodic_scale"));
           }),
           "length_scale"_a, "period"_a, "axis"_a, "periodic_scale"_a, py::kw_only(), no_rotation);
}

}  // namespace

void bind_kernel(py::module_& m) {
  py::class_<Kernel, std::shared_ptr<Kernel>>(
      m, "Kernel",
      "Covariance of g, a function of x - y. k1 + k2: two independent processes added; k1 * k2; "
      "0.5 * k: weighted.")
      .def_property_readonly("variance", &Kernel::variance, "1 except after sums and scaling.")
      .def(
          "__call__",
          [](const Kernel& k, const py::object& x, const py::object& y) {
            return for_pairs(x, y, {}, [&](double* out, const Vec3& r) { *out = k.covariance(r); });
          },
          "x"_a, "y"_a, "Covariance of g between points x (N, 3) and y (M, 3): (N, M).")
      .def("gradient", &gradients, "x"_a, "y"_a, "Its derivative by x: (N, M, 3).")
      .def("mixed", &mixed_derivatives, "x"_a, "y"_a,
           "Its derivatives by x and y, the covariance of gradients of g: (N, M, 3, 3).")
      .def(
          "derivative_variance",
          [](const Kernel& k, const py::object& direction) {
            return k.derivative_variance(vector_argument(direction, "direction"));
          },
          "direction"_a,
          "Variance of the derivative of g along `direction` (3,); infinite where there is none.")
      .def(
          "__add__",
          [](const SharedKernel& a, const SharedKernel& b) -> SharedKernel {
            return std::make_shared<SumKernel>(a, b);
          },
          py::is_operator())
      .def(
          "__mul__",
          [](const SharedKernel& a, const SharedKernel& b) -> SharedKernel {
            return std::make_shared<ProductKernel>(a, b);
          },
          py::is_operator())
      .def("__mul__", &scaled, py::is_operator())
      .def("__rmul__", &scaled, py::is_operator())
      .def("terms", &terms_list,
           "The normal form, a list of independent terms weight · κ(|whitening r|) · "
           "cos(wave_vector·r), κ of `family`;\nNone where a product has none.")
      .def("__repr__", &Kernel::describe);
  bind_families(m);
}

}  // namespace gpis

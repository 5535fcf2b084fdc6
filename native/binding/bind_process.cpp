// The Gaussian process.
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <cstdint>

#include "binding/arguments.h"
#include "binding/bindings.h"
#include "binding/conditions_argument.h"
#include "process/at_points.h"
#include "process/posterior.h"
#include "process/tree_surface.h"

namespace gpis {
namespace py = pybind11;
using namespace py::literals;
namespace {

using Array = NumberArray;

Array to_array(const Eigen::MatrixXd& m) {
  Array out({m.rows(), m.cols()});
  for (Eigen::Index i = 0; i < m.rows(); ++i)
    for (Eigen::Index j = 0; j < m.cols(); ++j) out.mutable_at(i, j) = m(i, j);
  return out;
}

Array joint_covariance(const GaussianProcess& gp, const py::object& x, const py::object& y) {
  const Covariance covariance(gp);
  if (!covariance.differentiable())
    throw std::invalid_argument("joint_covariance: the kernel " + gp.kernel->describe() +
                                " has no gradient.");
  const auto at_x = points_argument(x, "x"), at_y = points_argument(y, "y");
  const py::ssize_t n = at_x.size(), m = at_y.size();
  Array out({n, m, py::ssize_t{4}, py::ssize_t{4}});
  for (py::ssize_t i = 0; i < n; ++i)
    for (py::ssize_t j = 0; j < m; ++j) {
      const Eigen::Matrix4d block =
          covariance.block(covariance.at(at_x[i]), covariance.at(at_y[j]));
      for (int r = 0; r < 4; ++r)
        for (int c = 0; c < 4; ++c) out.mutable_at(i, j, r, c) = block(r, c);
    }
  return out;
}

Array sample(const GaussianProcess& gp, const py::object& at, py::ssize_t n, std::uint64_t seed) {
  const auto x = points_argument(at, "points");
  if (x.size() > 4096)
    throw std::invalid_argument("sample draws at up to 4096 points jointly, these are " +
                                std::to_string(x.size()) + ".");
  if (n < 0) throw std::invalid_argument("n must not be negative.");
  return to_array(sample_at(gp, x, n, seed));
}

py::tuple posterior(const GaussianProcess& gp, const py::object& at) {
  const auto x = points_argument(at, "x");
  const auto laws = posterior_at(gp, x);
  const auto n = static_cast<py::ssize_t>(x.size());
  Array mean(n), variance(n);
  for (py::ssize_t i = 0; i < n; ++i) {
    mean.mutable_at(i) = laws[i].mean;
    variance.mutable_at(i) = laws[i].variance;
  }
  return py::make_tuple(mean, variance);
}

// Now, in temporal length scales.
std::optional<double> time_argument(std::optional<double> time_scale, double time) {
  if (!std::isfinite(time))
    throw std::invalid_argument("time must be finite, it is " + std::to_string(time) + ".");
  if (!time_scale) {
    if (time != 0) throw std::invalid_argument("time needs a time_scale.");
    return std::nullopt;
  }
  if (!(*time_scale > 0) || !std::isfinite(*time_scale))
    throw std::invalid_argument("time_scale must be positive and finite, it is " +
                                std::to_string(*time_scale) + ".");
  return time / *time_scale;
}

}  // namespace

void bind_process(py::module_& m) {
  py::class_<GaussianProcess, std::shared_ptr<GaussianProcess>>(
      m, "GaussianProcess",
      "f = mean + sigma·g: outside where f > 0, the surface is f = 0.\n\n"
      "mean, sigma: field or number; sigma is the standard deviation, in the unit of the mean, not "
      "negative.\n"
      "kernel: correlation of g. anisotropy: TensorField of squared length scales A(x) (Paciorek "
      "and "
      "Schervish); the kernel's\n"
      "own length_scale, one number, is then a factor on the lengths. bounds: (min (3,), max "
      "(3,)); outside there is no surface. A mean "
      "on a grid bounds the\n"
      "process to its nodes. time_scale, time: g also depends on time, with the correlation "
      "exp(-Δ²/2) over Δ time\n"
      "scales: realisations of the same seed flow from frame to frame (None: they stand still).\n"
      "conditions: what is known of f, a dict of points (C, 3), values (C,), normals (C, 3) (NaN = "
      "none), slopes (C,),\n"
      "the length of the gradient along the normal (1), noise (C,), standard deviation of the "
      "value "
      "(0).")
      .def(py::init([](const py::object& mean, const py::object& sigma, const py::object& kernel,
                       const py::object& anisotropy, const py::object& conditions,
                       const py::object& bounds, std::optional<double> time_scale, double time) {
             auto gp = std::make_shared<GaussianProcess>();
             gp->mean = field_argument(mean, "mean");
             gp->sigma = field_argument(sigma, "sigma");
             gp->kernel = instance_argument<Kernel>(kernel, "kernel", "a kernel");
             if (!anisotropy.is_none()) {
               gp->anisotropy =
                   instance_argument<TensorField>(anisotropy, "anisotropy", "a TensorField");
               const Covariance checks_kernel(*gp);
             }
             if (!bounds.is_none()) {
               const auto corners = points_argument(bounds, "bounds");
               if (corners.size() != 2)
                 throw std::invalid_argument("bounds must be (min (3,), max (3,)).");
               gp->bounds = Box3{corners[0], corners[1]};
               for (int i = 0; i < 3; ++i)
                 if (!(corners[0][i] < corners[1][i]))
                   throw std::invalid_argument("bounds: min must be below max on every axis.");
             }
             gp->conditions = conditions_argument(conditions);
             posterior_of(*gp);  // refuses contradictions
             gp->time = time_argument(time_scale, time);
             if (gp->sigma->range().min < 0)
               throw std::invalid_argument("sigma must not be negative, it goes down to " +
                                           std::to_string(gp->sigma->range().min) +
                                           ": it is a standard deviation; say meaning=\"variance\" "
                                           "where a grid holds the variance.");
             return gp;
           }),
           "mean"_a, "sigma"_a, "kernel"_a, py::kw_only(), "anisotropy"_a = py::none(),
           "conditions"_a = py::none(), "bounds"_a = py::none(), "time_scale"_a = py::none(),
           "time"_a = 0.0)
      .def(
          "mean",
          [](const GaussianProcess& gp, const py::object& x) {
            const auto p = points_argument(x, "x");
            Array out(static_cast<py::ssize_t>(p.size()));
            for (std::size_t i = 0; i < p.size(); ++i) out.mutable_at(i) = gp.mean->value(p[i]);
            return out;
          },
          "x"_a, "Mean at points x (N, 3): (N,).")
      .def(
          "covariance",
          [](const GaussianProcess& gp, const py::object& x, const py::object& y) {
            return to_array(
                covariance_matrix(gp, points_argument(x, "x"), points_argument(y, "y")));
          },
          "x"_a, "y"_a, "Covariance of f between points x (N, 3) and y (M, 3): (N, M).")
      .def("joint_covariance", &joint_covariance, "x"_a, "y"_a,
           "Covariance of g and its gradient (g, ∇g) between points x (N, 3) and y (M, 3): "
           "(N, M, 4, 4). Without sigma.")
      .def("sample", &sample, "points"_a, "n"_a, "seed"_a = 0,
           "n joint samples of f at points (N, 3), N up to 4096, given the conditions: (n, N).")
      .def("posterior", &posterior, "x"_a,
           "Mean and variance of f at points x (N, 3), given the conditions: ((N,), (N,)).")
      .def(
          "plan",
          [](const std::shared_ptr<GaussianProcess>& gp) {
            py::dict out;
            for (const auto& [key, text] :
                 TreeSurface(ProcessTree::single(gp), {}, Memory::renewal_plus, Sampler::automatic,
                             1e-3)
                     .plan())
              out[py::str(key)] = text;
            return out;
          },
          "What a render of this process chooses and leaves out.");
}

}  // namespace gpis

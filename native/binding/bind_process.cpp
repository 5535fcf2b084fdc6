// The Gaussian process and its first hits.
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <cstdint>
#include <set>

#include "binding/arguments.h"
#include "binding/bindings.h"
#include "process/at_points.h"
#include "process/covariance.h"
#include "process/first_hits.h"
#include "process/tree_surface.h"

namespace gpis {
namespace py = pybind11;
using namespace py::literals;
namespace {

using Array = NumberArray;

// As render takes; TBB overflows its stack at a million.
constexpr int kMostThreads = 1024;

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

Sampler sampler_argument(const std::string& name) {
  if (name == "auto") return Sampler::automatic;
  if (name == "convolution") return Sampler::convolution;
  if (name == "markov") return Sampler::markov;
  if (name == "nystrom") return Sampler::nystrom;
  if (name == "spectral") return Sampler::spectral;
  if (name == "dense") return Sampler::dense;
  if (name == "realisation") return Sampler::realisation;
  throw std::invalid_argument("sampler is '" + name +
                              "', it takes 'auto', 'convolution', 'markov', 'spectral', 'nystrom', "
                              "'dense' or 'realisation'.");
}

// What rows have seen of their realisations, memory `global`: seed (N,), and where they were moved
// outside, point (N, 3), value (N,), NaN where they were not; of a tree for each of its leaves.
std::vector<RealisationMemory> realisations_argument(const py::handle& argument, std::size_t n,
                                                     std::size_t leaves) {
  constexpr const char* sentence =
      "start['realisation'] must be a dict of seed (N,), entry (N, 3) and shift (N,), as in the "
      "state of earlier hits.";
  if (!py::isinstance<py::dict>(argument)) throw std::invalid_argument(sentence);
  const auto dict = py::reinterpret_borrow<py::dict>(argument);
  for (const char* key : {"seed", "entry", "shift"})
    if (!dict.contains(key) || py::len(dict) != 3) throw std::invalid_argument(sentence);
  const auto seed =
      py::array_t<std::uint64_t, py::array::c_style | py::array::forcecast>::ensure(dict["seed"]);
  const Array entry = Array::ensure(dict["entry"]), shift = Array::ensure(dict["shift"]);
  const auto count = static_cast<py::ssize_t>(n * leaves);
  const py::ssize_t rank = leaves > 1 ? 2 : 1;
  if (!seed || !entry || !shift || seed.ndim() != rank || shift.ndim() != rank ||
      entry.ndim() != rank + 1 || entry.shape(rank) != 3 || seed.size() != count ||
      shift.size() != count || entry.size() != 3 * count) {
    PyErr_Clear();
    throw std::invalid_argument(sentence);
  }
  std::vector<RealisationMemory> out(count);
  for (py::ssize_t i = 0; i < count; ++i) {
    out[i].seed = seed.data()[i];
    const double* at = entry.data() + 3 * i;
    if (std::isfinite(shift.data()[i]))
      out[i].entry = {true, {at[0], at[1], at[2]}, {shift.data()[i], {}}};
  }
  return out;
}

py::dict realisations_dict(const std::vector<RealisationMemory>& realisations, py::ssize_t leaves) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  const auto count = static_cast<py::ssize_t>(realisations.size());
  std::vector<py::ssize_t> shape{count / leaves};
  if (leaves > 1) shape.push_back(leaves);
  py::array_t<std::uint64_t> seed(shape);
  Array shift(shape);
  shape.push_back(3);
  Array entry(shape);
  for (py::ssize_t i = 0; i < count; ++i) {
    const RealisationMemory& r = realisations[i];
    seed.mutable_data()[i] = r.seed;
    shift.mutable_data()[i] = r.entry.active ? r.entry.weight.value : nan;
    for (int k = 0; k < 3; ++k)
      entry.mutable_data()[3 * i + k] = r.entry.active ? r.entry.at[k] : nan;
  }
  return py::dict("seed"_a = seed, "entry"_a = entry, "shift"_a = shift);
}

double tolerance_argument(double tolerance) {
  if (!(tolerance > 0 && tolerance < 1))
    throw std::invalid_argument("tolerance must lie between 0 and 1, it is " +
                                std::to_string(tolerance) + ".");
  return tolerance;
}

// value (N,) and gradient (N, 3); of a tree (N, leaves) and (N, leaves, 3), NaN where nothing is
// known.
void read_start(const py::handle& values, const py::handle& gradients, std::size_t leaves,
                FirstHitsQuery& query) {
  const Array value = Array::ensure(values), gradient = Array::ensure(gradients);
  const auto rays = static_cast<py::ssize_t>(query.rays.size());
  const auto count = static_cast<py::ssize_t>(leaves);
  const bool tree = leaves > 1;
  const bool fits = value && gradient && value.ndim() == 1 + tree && gradient.ndim() == 2 + tree &&
                    value.shape(0) == rays && gradient.shape(0) == rays &&
                    gradient.shape(1 + tree) == 3 &&
                    (!tree || (value.shape(1) == count && gradient.shape(1) == count));
  if (!fits) {
    PyErr_Clear();
    const std::string n = tree ? "(N, " + std::to_string(leaves) : "(N";
    throw std::invalid_argument("start must hold value " + n + (tree ? ")" : ",)") +
                                " and gradient " + n + ", 3), one row a ray.");
  }
  const double *v = value.data(), *g = gradient.data();
  for (py::ssize_t i = 0; i < rays * count; ++i, ++v, g += 3) {
    const Vec3 at{g[0], g[1], g[2]};
    const bool nothing = tree && std::isnan(*v);
    const bool inside = !query.inside.empty() && query.inside[i / count];
    if (!nothing && (!std::isfinite(*v) || (!tree && (inside ? -*v : *v) < 0)))
      throw std::invalid_argument(
          "start['value'][" + std::to_string(i / count) +
          "] must be 0 (on the surface) or positive (outside; negative for rays inside), and "
          "finite.");
    if (!nothing && !is_finite(at))
      throw std::invalid_argument("start['gradient'][" + std::to_string(i / count) +
                                  "] is not finite: every coordinate must be a number.");
    query.start.push_back({*v, at});
  }
}

FirstHitsQuery query_argument(const py::object& origins, const py::object& directions, double t_max,
                              const py::object& start, const py::object& inside, std::size_t leaves,
                              std::uint64_t first_index, std::uint64_t seed, int threads) {
  FirstHitsQuery query;
  const auto o = points_argument(origins, "origins"), d = points_argument(directions, "directions");
  if (o.size() != d.size())
    throw std::invalid_argument("origins and directions must have as many rows, they have " +
                                std::to_string(o.size()) + " and " + std::to_string(d.size()) +
                                ".");
  for (std::size_t i = 0; i < o.size(); ++i) {
    if (std::abs(length(d[i]) - 1) > 1e-6)
      throw std::invalid_argument("directions[" + std::to_string(i) +
                                  "] must have length 1, it has " + std::to_string(length(d[i])) +
                                  ".");
    query.rays.push_back({o[i], d[i]});
  }
  if (!(t_max > 0))
    throw std::invalid_argument("t_max must be positive, it is " + std::to_string(t_max) + ".");
  if (threads < 0 || threads > kMostThreads)
    throw std::invalid_argument("threads must be 0 (all cores) to " + std::to_string(kMostThreads) +
                                ", it is " + std::to_string(threads) + ".");
  if (!inside.is_none()) {
    const auto flags = py::array_t<bool, py::array::c_style>::ensure(inside);
    if (!py::isinstance<py::array_t<bool>>(inside) || !flags || flags.ndim() != 1 ||
        static_cast<std::size_t>(flags.shape(0)) != o.size()) {
      PyErr_Clear();
      throw std::invalid_argument("inside must be an array of truth values, one a ray.");
    }
    query.inside.assign(flags.data(), flags.data() + o.size());
  }
  if (!start.is_none()) {
    if (!py::isinstance<py::dict>(start))
      throw std::invalid_argument("start must be None or a dict of value and gradient.");
    const auto s = py::reinterpret_borrow<py::dict>(start);
    for (const auto& item : s) {
      const auto key = py::str(item.first).cast<std::string>();
      if (key != "value" && key != "gradient" && key != "realisation")
        throw std::invalid_argument("start: unknown key '" + key +
                                    "' (takes value, gradient, realisation).");
    }
    if (!s.contains("value") || !s.contains("gradient"))
      throw std::invalid_argument("start must hold value (N,) and gradient (N, 3).");
    read_start(s["value"], s["gradient"], leaves, query);
    if (s.contains("realisation"))
      query.realisation = realisations_argument(s["realisation"], o.size(), leaves);
  }
  query.t_max = t_max;
  query.first_index = first_index;
  query.seed = seed;
  query.threads = threads;
  query.interrupted = [] {
    const py::gil_scoped_acquire acquire;
    return PyErr_CheckSignals() != 0;
  };
  return query;
}

py::dict first_hits_dict(const py::object& gp, const py::object& origins,
                         const py::object& directions, double t_max, const std::string& memory,
                         const py::object& start, const py::object& inside,
                         std::uint64_t first_index, const std::string& sampler, double tolerance,
                         std::uint64_t seed, int threads) {
  const TreePtr tree = tree_argument(gp, "gp");
  const FirstHitsQuery query = query_argument(origins, directions, t_max, start, inside,
                                              tree->leaves().size(), first_index, seed, threads);
  TreeSurface surface(tree, {}, memory_argument(memory, "memory"), sampler_argument(sampler),
                      tolerance_argument(tolerance));
  if (!query.inside.empty()) surface.serve_inside();
  FirstHits hits;
  {
    py::gil_scoped_release release;
    hits = first_hits(surface, query);
  }
  if (PyErr_Occurred()) throw py::error_already_set();
  const py::ssize_t n = query.rays.size();
  const auto leaves = static_cast<py::ssize_t>(surface.leaves().size());
  const bool of_tree = leaves > 1;
  Array t(n), position({n, py::ssize_t{3}}), gradient({n, py::ssize_t{3}});
  Array value(of_tree ? std::vector{n, leaves} : std::vector{n});
  Array slopes(of_tree ? std::vector{n, leaves, py::ssize_t{3}} : std::vector{n, py::ssize_t{3}});
  py::array_t<std::int32_t> part(n);
  for (py::ssize_t i = 0; i < n; ++i) {
    t.mutable_at(i) = hits.t[i];
    part.mutable_at(i) = hits.leaf[i];
    const Vec3 p = std::isinf(hits.t[i]) ? hits.gradient[i] : query.rays[i].at(hits.t[i]);
    for (int k = 0; k < 3; ++k) {
      position.mutable_at(i, k) = p[k];
      gradient.mutable_at(i, k) = hits.gradient[i][k];
    }
  }
  for (py::ssize_t i = 0; i < n * leaves; ++i) {
    value.mutable_data()[i] = hits.state[i].value;
    for (int k = 0; k < 3; ++k) slopes.mutable_data()[3 * i + k] = hits.state[i].gradient[k];
  }
  py::dict state("value"_a = value, "gradient"_a = slopes);
  if (!hits.realisation.empty()) state["realisation"] = realisations_dict(hits.realisation, leaves);
  return py::dict("t"_a = t, "position"_a = position, "gradient"_a = gradient, "part"_a = part,
                  "state"_a = state, "counters"_a = counters_dict(hits.counters));
}

Array line_values_array(const py::object& gp, const py::object& origins,
                        const py::object& directions, const std::vector<double>& t,
                        const std::string& memory, const py::object& start,
                        const py::object& inside, std::uint64_t first_index,
                        const std::string& sampler, double tolerance, std::uint64_t seed,
                        int threads) {
  if (t.empty()) throw std::invalid_argument("t must hold at least one distance.");
  const double t_max = *std::max_element(t.begin(), t.end());
  if (!(t_max > 0)) throw std::invalid_argument("t must hold a distance above 0.");
  const TreePtr tree = tree_argument(gp, "gp");
  const FirstHitsQuery query = query_argument(origins, directions, t_max, start, inside,
                                              tree->leaves().size(), first_index, seed, threads);
  TreeSurface surface(tree, {}, memory_argument(memory, "memory"), sampler_argument(sampler),
                      tolerance_argument(tolerance));
  if (!query.inside.empty()) surface.serve_inside();
  std::vector<double> values;
  {
    py::gil_scoped_release release;
    values = line_values(surface, query, t);
  }
  if (PyErr_Occurred()) throw py::error_already_set();
  std::vector<py::ssize_t> shape{static_cast<py::ssize_t>(query.rays.size()),
                                 static_cast<py::ssize_t>(t.size())};
  if (surface.leaves().size() > 1) shape.push_back(surface.leaves().size());
  Array out(shape);
  std::copy(values.begin(), values.end(), out.mutable_data());
  return out;
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
      "scales: realisations of the same seed flow from frame to frame (None: they stand still).")
      .def(py::init([](const py::object& mean, const py::object& sigma, const py::object& kernel,
                       const py::object& anisotropy, const py::object& bounds,
                       std::optional<double> time_scale, double time) {
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
             gp->time = time_argument(time_scale, time);
             if (gp->sigma->range().min < 0)
               throw std::invalid_argument("sigma must not be negative, it goes down to " +
                                           std::to_string(gp->sigma->range().min) +
                                           ": it is a standard deviation; say meaning=\"variance\" "
                                           "where a grid holds the variance.");
             return gp;
           }),
           "mean"_a, "sigma"_a, "kernel"_a, py::kw_only(), "anisotropy"_a = py::none(),
           "bounds"_a = py::none(), "time_scale"_a = py::none(), "time"_a = 0.0)
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
           "n joint samples of f at points (N, 3), N up to 4096: (n, N).")
      .def(
          "plan",
          [](const std::shared_ptr<GaussianProcess>& gp) {
            py::dict out;
            for (const auto& [key, text] :
                 ProcessSurface(gp, {}, Memory::renewal_plus, Sampler::automatic, 1e-3).plan())
              out[py::str(key)] = text;
            return out;
          },
          "What a render of this process chooses and leaves out.");

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
      "('none', 'renewal', 'renewal+', 'global').\n"
      "inside: (N,) bool, rays that travel inside the body: their first change of sign to "
      "outside.\n"
      "sampler: 'auto', 'convolution', 'markov', 'spectral', 'nystrom', 'dense' or 'realisation'. "
      "tolerance: probability of a missed root per "
      "ray. Row i uses the random\n"
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

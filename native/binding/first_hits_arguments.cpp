#include "binding/first_hits_arguments.h"

#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include <limits>

namespace gpis {
namespace py = pybind11;
using namespace py::literals;
namespace {

using Array = NumberArray;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// As render takes; TBB overflows its stack at a million.
constexpr int kMostThreads = 1024;

Sampler sampler_argument(const std::string& name) {
  if (name == "auto") return Sampler::automatic;
  if (name == "convolution") return Sampler::convolution;
  if (name == "markov") return Sampler::markov;
  if (name == "nystrom") return Sampler::nystrom;
  if (name == "spectral") return Sampler::spectral;
  if (name == "dense") return Sampler::dense;
  if (name == "realisation") return Sampler::realisation;
  if (name == "first_passage") return Sampler::first_passage;
  throw std::invalid_argument("sampler is '" + name +
                              "', it takes 'auto', 'convolution', 'markov', 'spectral', 'nystrom', "
                              "'dense', 'realisation' or 'first_passage'.");
}

double tolerance_argument(double tolerance) {
  if (!(tolerance > 0 && tolerance < 1))
    throw std::invalid_argument("tolerance must lie between 0 and 1, it is " +
                                std::to_string(tolerance) + ".");
  return tolerance;
}

// A vector as an array, which keeps it: large ones are not copied.
template <class Number, class T>
py::array_t<Number> array_of(std::vector<T> values, const std::vector<py::ssize_t>& shape) {
  static_assert(sizeof(T) % sizeof(Number) == 0);
  auto* kept = new std::vector<T>(std::move(values));
  const py::capsule owner(kept, [](void* p) { delete static_cast<std::vector<T>*>(p); });
  return py::array_t<Number>(shape, reinterpret_cast<const Number*>(kept->data()), owner);
}

// What rows have seen of their realisations, memory `global`: seed (N,), and where they were moved
// outside, point (N, 3), value (N,), NaN where they were not, by the first ray and by the last of
// the others; of a tree for each of its leaves.
std::vector<RealisationMemory> realisations_argument(const py::handle& argument, std::size_t n,
                                                     std::size_t leaves) {
  constexpr const char* sentence =
      "start['realisation'] must be a dict of seed (N,), entry (N, 3), shift (N,), moved (N, 3) "
      "and "
      "moved_shift (N,), as in the state of earlier hits.";
  if (!py::isinstance<py::dict>(argument)) throw std::invalid_argument(sentence);
  const auto dict = py::reinterpret_borrow<py::dict>(argument);
  for (const char* key : {"seed", "entry", "shift", "moved", "moved_shift"})
    if (!dict.contains(key) || py::len(dict) != 5) throw std::invalid_argument(sentence);
  const auto seed =
      py::array_t<std::uint64_t, py::array::c_style | py::array::forcecast>::ensure(dict["seed"]);
  const auto count = static_cast<py::ssize_t>(n * leaves);
  const py::ssize_t rank = leaves > 1 ? 2 : 1;
  bool good = seed && seed.ndim() == rank && seed.size() == count;
  std::vector<RealisationMemory> out(count);
  const auto read = [&](const char* where, const char* by,
                        RealisationCondition RealisationMemory::*to) {
    const Array at = Array::ensure(dict[where]), shift = Array::ensure(dict[by]);
    good = good && at && shift && shift.ndim() == rank && shift.size() == count &&
           at.ndim() == rank + 1 && at.shape(rank) == 3 && at.size() == 3 * count;
    for (py::ssize_t i = 0; good && i < count; ++i) {
      const double* x = at.data() + 3 * i;
      if (std::isfinite(shift.data()[i]))
        out[i].*to = {true, {x[0], x[1], x[2]}, {shift.data()[i], {}}, -1, {}};
    }
  };
  read("entry", "shift", &RealisationMemory::entry);
  read("moved", "moved_shift", &RealisationMemory::moved);
  if (!good) {
    PyErr_Clear();
    throw std::invalid_argument(sentence);
  }
  for (py::ssize_t i = 0; i < count; ++i) {
    out[i].seed = seed.data()[i];
    out[i].met = true;
  }
  return out;
}

py::dict realisations_dict(const std::vector<RealisationMemory>& realisations, py::ssize_t leaves) {
  const auto count = static_cast<py::ssize_t>(realisations.size());
  std::vector<py::ssize_t> shape{count / leaves};
  if (leaves > 1) shape.push_back(leaves);
  py::array_t<std::uint64_t> seed(shape);
  Array shift(shape), moved_shift(shape);
  shape.push_back(3);
  Array entry(shape), moved(shape);
  const auto write = [](const RealisationCondition& c, double* at, double& by) {
    by = c.active ? c.weight.value : kNan;
    for (int k = 0; k < 3; ++k) at[k] = c.active ? c.at[k] : kNan;
  };
  for (py::ssize_t i = 0; i < count; ++i) {
    const RealisationMemory& r = realisations[i];
    seed.mutable_data()[i] = r.seed;
    write(r.entry, entry.mutable_data() + 3 * i, shift.mutable_data()[i]);
    write(r.moved, moved.mutable_data() + 3 * i, moved_shift.mutable_data()[i]);
  }
  return py::dict("seed"_a = seed, "entry"_a = entry, "shift"_a = shift, "moved"_a = moved,
                  "moved_shift"_a = moved_shift);
}

// What rows have kept of their last segments, memory `global-n`: the functionals value·g + slope·∇g
// that are known, one after the other: row (M,), of a tree row · leaves + leaf, segment (M,), the
// oldest 0, position (M, 3), functional (M, 4), value (M,) and variance of its noise (M,).
std::vector<SegmentMemory> segments_argument(const py::handle& argument, std::size_t count) {
  constexpr const char* sentence =
      "start['segments'] must be a dict of row (M,), segment (M,), position (M, 3), functional (M, "
      "4), value (M,) and noise (M,), as in the state of earlier hits.";
  if (!py::isinstance<py::dict>(argument)) throw std::invalid_argument(sentence);
  const auto dict = py::reinterpret_borrow<py::dict>(argument);
  for (const char* key : {"row", "segment", "position", "functional", "value", "noise"})
    if (!dict.contains(key) || py::len(dict) != 6) throw std::invalid_argument(sentence);
  using Indices = py::array_t<std::int64_t, py::array::c_style | py::array::forcecast>;
  const Indices row = Indices::ensure(dict["row"]), segment = Indices::ensure(dict["segment"]);
  const Array position = Array::ensure(dict["position"]),
              functional = Array::ensure(dict["functional"]), value = Array::ensure(dict["value"]),
              noise = Array::ensure(dict["noise"]);
  if (!row || !segment || !position || !functional || !value || segment.size() != row.size() ||
      position.size() != 3 * row.size() || functional.size() != 4 * row.size() ||
      value.size() != row.size() || !noise || noise.size() != row.size()) {
    PyErr_Clear();
    throw std::invalid_argument(sentence);
  }
  std::vector<SegmentMemory> out(count);
  for (py::ssize_t i = 0; i < row.size(); ++i) {
    const double *p = position.data() + 3 * i, *f = functional.data() + 4 * i;
    const std::int64_t of = row.data()[i], number = segment.data()[i];
    if (of < 0 || of >= static_cast<std::int64_t>(count) || number < 0 ||
        number >= Memory::kMostSegments || !is_finite(Vec3{p[0], p[1], p[2]}) ||
        !is_finite(Vec3{f[1], f[2], f[3]}) || !std::isfinite(f[0] + value.data()[i]) ||
        !(noise.data()[i] >= 0 && noise.data()[i] < 1))
      throw std::invalid_argument(sentence);
    auto& segments = out[of].segments;
    if (number >= static_cast<std::int64_t>(segments.size())) segments.resize(number + 1);
    segments[number].push_back(
        {{p[0], p[1], p[2]}, {f[0], {f[1], f[2], f[3]}}, value.data()[i], noise.data()[i]});
  }
  return out;
}

py::dict segments_dict(const std::vector<SegmentMemory>& kept) {
  std::vector<std::int64_t> row, segment;
  std::vector<double> position, functional, value, noise;
  for (std::size_t i = 0; i < kept.size(); ++i)
    for (std::size_t s = 0; s < kept[i].segments.size(); ++s)
      for (const SegmentMemory::Row& r : kept[i].segments[s]) {
        row.push_back(static_cast<std::int64_t>(i));
        segment.push_back(static_cast<std::int64_t>(s));
        for (int k = 0; k < 3; ++k) position.push_back(r.at[k]);
        functional.push_back(r.what.value);
        for (int k = 0; k < 3; ++k) functional.push_back(r.what.slope[k]);
        value.push_back(r.value);
        noise.push_back(r.noise);
      }
  const auto m = static_cast<py::ssize_t>(row.size());
  const auto array = [](const auto& v, std::vector<py::ssize_t> shape) {
    return py::array_t<typename std::decay_t<decltype(v)>::value_type>(shape, v.data());
  };
  return py::dict("row"_a = array(row, {m}), "segment"_a = array(segment, {m}),
                  "position"_a = array(position, {m, 3}),
                  "functional"_a = array(functional, {m, 4}), "value"_a = array(value, {m}),
                  "noise"_a = array(noise, {m}));
}

// value (N,) and gradient (N, 3); of a tree (N, leaves) and (N, leaves, 3), NaN where nothing is
// known.
void read_states(const py::handle& values, const py::handle& gradients, std::size_t leaves,
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
  query.start.reserve(rays * count);
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

void read_start(const py::object& start, std::size_t leaves, FirstHitsQuery& query) {
  if (!py::isinstance<py::dict>(start))
    throw std::invalid_argument("start must be None or a dict of value and gradient.");
  const auto s = py::reinterpret_borrow<py::dict>(start);
  for (const auto& item : s) {
    const auto key = py::str(item.first).cast<std::string>();
    if (key != "value" && key != "gradient" && key != "realisation" && key != "segments")
      throw std::invalid_argument("start: unknown key '" + key +
                                  "' (takes value, gradient, realisation, segments).");
  }
  if (!s.contains("value") || !s.contains("gradient"))
    throw std::invalid_argument("start must hold value (N,) and gradient (N, 3).");
  read_states(s["value"], s["gradient"], leaves, query);
  if (s.contains("realisation"))
    query.realisation = realisations_argument(s["realisation"], query.rays.size(), leaves);
  if (s.contains("segments"))
    query.segments = segments_argument(s["segments"], query.rays.size() * leaves);
}

void read_rays(const py::object& origins, const py::object& directions, FirstHitsQuery& query) {
  const Array o = rows_argument(origins, "origins"), d = rows_argument(directions, "directions");
  if (o.shape(0) != d.shape(0))
    throw std::invalid_argument("origins and directions must have as many rows, they have " +
                                std::to_string(o.shape(0)) + " and " + std::to_string(d.shape(0)) +
                                ".");
  query.rays.resize(o.shape(0));
  for (std::size_t i = 0; i < query.rays.size(); ++i) {
    const Vec3 origin = point_of(o, i, "origins"), direction = point_of(d, i, "directions");
    if (std::abs(length(direction) - 1) > 1e-6)
      throw std::invalid_argument("directions[" + std::to_string(i) +
                                  "] must have length 1, it has " +
                                  std::to_string(length(direction)) + ".");
    query.rays[i] = {origin, direction};
  }
}

void read_inside(const py::object& inside, FirstHitsQuery& query) {
  const auto flags = py::array_t<bool, py::array::c_style>::ensure(inside);
  if (!py::isinstance<py::array_t<bool>>(inside) || !flags || flags.ndim() != 1 ||
      static_cast<std::size_t>(flags.shape(0)) != query.rays.size()) {
    PyErr_Clear();
    throw std::invalid_argument("inside must be an array of truth values, one a ray.");
  }
  query.inside.assign(flags.data(), flags.data() + query.rays.size());
}

FirstHitsQuery query_argument(const FirstHitsArguments& arguments, std::size_t leaves,
                              double t_max) {
  FirstHitsQuery query;
  read_rays(arguments.origins, arguments.directions, query);
  if (!(t_max > 0))
    throw std::invalid_argument("t_max must be positive, it is " + std::to_string(t_max) + ".");
  if (arguments.threads < 0 || arguments.threads > kMostThreads)
    throw std::invalid_argument("threads must be 0 (all cores) to " + std::to_string(kMostThreads) +
                                ", it is " + std::to_string(arguments.threads) + ".");
  if (!arguments.inside.is_none()) read_inside(arguments.inside, query);
  if (!arguments.start.is_none()) read_start(arguments.start, leaves, query);
  query.t_max = t_max;
  query.first_index = arguments.first_index;
  query.seed = arguments.seed;
  query.threads = arguments.threads;
  query.interrupted = [] {
    const py::gil_scoped_acquire acquire;
    return PyErr_CheckSignals() != 0;
  };
  return query;
}

}  // namespace

FirstHitsSetup first_hits_setup(const FirstHitsArguments& arguments, double t_max) {
  TreeSurface surface(tree_argument(arguments.gp, "gp"), {},
                      memory_argument(arguments.memory, "memory"),
                      sampler_argument(arguments.sampler), tolerance_argument(arguments.tolerance));
  FirstHitsQuery query = query_argument(arguments, surface.operands(), t_max);
  if (!query.inside.empty()) surface.serve_inside();
  return {std::move(surface), std::move(query)};
}

py::dict hits_dict(FirstHits hits, std::size_t leaves) {
  const auto n = static_cast<py::ssize_t>(hits.t.size());
  std::vector<py::ssize_t> of_leaves{n};
  if (leaves > 1) of_leaves.push_back(static_cast<py::ssize_t>(leaves));
  auto slopes_of_leaves = of_leaves;
  slopes_of_leaves.push_back(3);
  py::dict state("value"_a = array_of<double>(std::move(hits.state_value), of_leaves),
                 "gradient"_a = array_of<double>(std::move(hits.state_gradient), slopes_of_leaves));
  if (!hits.realisation.empty())
    state["realisation"] = realisations_dict(hits.realisation, static_cast<py::ssize_t>(leaves));
  if (!hits.segments.empty()) state["segments"] = segments_dict(hits.segments);
  return py::dict("t"_a = array_of<double>(std::move(hits.t), {n}),
                  "position"_a = array_of<double>(std::move(hits.position), {n, 3}),
                  "gradient"_a = array_of<double>(std::move(hits.gradient), {n, 3}),
                  "part"_a = array_of<std::int32_t>(std::move(hits.leaf), {n}), "state"_a = state,
                  "counters"_a = counters_dict(hits.counters));
}

}  // namespace gpis

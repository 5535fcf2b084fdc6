// Painting: dabs on the fields of a .vdb file.
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <tbb/task_arena.h>

#include "binding/arguments.h"
#include "binding/bindings.h"
#include "binding/color_field_argument.h"
#include "field/check.h"
#include "field/painted_fields.h"

namespace gpis {
namespace py = pybind11;
using namespace py::literals;
namespace {

using Triple = std::array<double, 3>;

Triple to_triple(const Vec3& v) {
  return {v.x, v.y, v.z};
}

constexpr std::pair<const char*, Channel> kChannels[] = {{"mean", Channel::mean},
                                                         {"deviation", Channel::deviation},
                                                         {"length_scale", Channel::length_scale},
                                                         {"anisotropy", Channel::anisotropy},
                                                         {"albedo", Channel::albedo}};
constexpr std::pair<const char*, Operation> kOperations[] = {
    {"inflate", Operation::inflate}, {"deflate", Operation::deflate}, {"smooth", Operation::smooth},
    {"flatten", Operation::flatten}, {"grab", Operation::grab},       {"set", Operation::set},
    {"add", Operation::add},         {"comb", Operation::comb}};

template <class Entries>
auto named(const Entries& entries, const std::string& name, const char* what) {
  std::string all;
  for (const auto& [known, entry] : entries) {
    if (name == known) return entry;
    all += (all.empty() ? "'" : ", '") + std::string(known) + "'";
  }
  refuse("", what, " is '", name, "'; it takes ", all, ".");
}

// One number for all dabs, or one for each.
std::vector<double> per_dab(const py::handle& value, std::size_t count, const char* name) {
  const auto a = NumberArray::ensure(value);
  PyErr_Clear();
  if (!a || a.ndim() > 1 || (a.ndim() == 1 && a.size() != static_cast<py::ssize_t>(count)))
    refuse("", name, " takes a number, or one for each of the ", count, " centers.");
  std::vector<double> out(count);
  for (std::size_t i = 0; i < count; ++i) out[i] = a.ndim() == 0 ? *a.data() : a.data()[i];
  return out;
}

std::vector<Dab> dabs_argument(const py::handle& centers, const py::handle& radius,
                               const py::handle& strength, const py::object& directions) {
  const std::vector<Vec3> points = points_argument(centers, "centers");
  const std::vector<double> radii = per_dab(radius, points.size(), "radius");
  const std::vector<double> strengths = per_dab(strength, points.size(), "strength");
  std::vector<Vec3> along(points.size());
  if (!directions.is_none()) along = points_argument(directions, "directions");
  if (along.size() != points.size())
    refuse("directions has ", along.size(), " rows; it takes one for each of the ", points.size(),
           " centers.");
  std::vector<Dab> dabs;
  for (std::size_t i = 0; i < points.size(); ++i)
    dabs.push_back({points[i], radii[i], strengths[i], along[i]});
  return dabs;
}

py::dict counts_dict(const PaintCounts& c) {
  return py::dict("nodes"_a = c.nodes, "leaves"_a = c.leaves, "clamped"_a = c.clamped,
                  "undirected"_a = c.undirected, "rejected"_a = c.rejected);
}

// ℓ, or the entries xx,yy,zz,xy,xz,yz of A.
SymMat3 squared_lengths(const py::object& length_scale) {
  const auto a = NumberArray::ensure(length_scale);
  PyErr_Clear();
  if (a && a.ndim() == 1 && a.size() == 6) {
    SymMat3 tensor;
    for (int i = 0; i < 6; ++i) tensor[i] = a.at(i);
    return tensor;
  }
  if (!a || a.ndim() != 0)
    refuse("length_scale takes a number, or the six entries xx,yy,zz,xy,xz,yz of A.");
  check_positive("length_scale", *a.data());
  return SymMat3::identity(*a.data() * *a.data());
}

std::unique_ptr<PaintedFields> open(const py::object& path, const std::string& mean, double sigma,
                                    const py::object& length_scale, const std::string& sigma_grid,
                                    const std::string& sigma_meaning, double sigma_factor,
                                    bool anisotropy, bool albedo) {
  if (sigma_meaning != "value" && sigma_meaning != "variance")
    refuse("sigma_meaning is '", sigma_meaning, "'; it takes 'value' or 'variance'.");
  const PaintSource source{path_argument(path, "path"),
                           mean,
                           sigma,
                           squared_lengths(length_scale),
                           sigma_grid,
                           sigma_meaning == "variance" ? GridMeaning::variance : GridMeaning::value,
                           sigma_factor,
                           anisotropy,
                           albedo};
  py::gil_scoped_release release;
  return std::make_unique<PaintedFields>(source);
}

py::dict apply(PaintedFields& fields, const std::string& channel, const std::string& operation,
               const py::object& centers, const py::object& radius, const py::object& strength,
               const py::object& directions, const py::object& value, const Triple& ratios,
               const std::string& falloff, const std::optional<std::vector<double>>& curve,
               const std::array<bool, 3>& symmetry, int threads) {
  Brush brush;
  brush.channel = named(kChannels, channel, "channel");
  brush.operation = named(kOperations, operation, "operation");
  brush.falloff = Falloff(falloff);
  if (curve) brush.falloff = Falloff(*curve);
  if (!value.is_none())
    brush.value = vec_or_number(value, "value");
  else if (brush.operation == Operation::set || brush.operation == Operation::add)
    refuse("value is missing: '", operation, "' takes ",
           brush.operation == Operation::add ? "the factor of a dab." : "what to paint.");
  brush.ratios = {ratios[0], ratios[1], ratios[2]};
  brush.symmetry = symmetry;
  if (threads < 0) refuse("threads is ", threads, "; it takes 0 (all) or more.");
  const std::vector<Dab> dabs = dabs_argument(centers, radius, strength, directions);
  PaintCounts counts;
  {
    py::gil_scoped_release release;
    tbb::task_arena arena(threads > 0 ? threads : tbb::task_arena::automatic);
    arena.execute([&] { counts = fields.apply(brush, dabs); });
  }
  return counts_dict(counts);
}

py::array_t<double> values(const PaintedFields& fields, const std::string& channel,
                           const py::object& points) {
  const std::vector<Vec3> at = points_argument(points, "points");
  const std::vector<double> v = fields.values(named(kChannels, channel, "channel"), at);
  std::vector<py::ssize_t> shape{static_cast<py::ssize_t>(at.size())};
  if (channel == "albedo") shape.push_back(3);
  if (channel == "anisotropy") shape.push_back(6);
  return py::array_t<double>(shape, v.data());
}

py::object first_surface(const PaintedFields& fields, const Triple& origin, const Triple& direction,
                         double t_max) {
  const Vec3 o{origin[0], origin[1], origin[2]}, d{direction[0], direction[1], direction[2]};
  if (!(t_max > 0)) refuse("t_max is ", t_max, "; it takes a positive number.");
  const auto [t, slope] = fields.first_surface(o, d, t_max);
  if (std::isinf(t)) return py::none();
  return py::make_tuple(t, to_triple(o + d * t), to_triple(slope));
}

Box3 bounds_argument(const py::object& bounds) {
  const std::vector<Vec3> ends = points_argument(bounds, "bounds");
  if (ends.size() != 2)
    refuse("bounds has ", ends.size(), " rows; it takes the least and the largest corner.");
  return {ends[0], ends[1]};
}

}  // namespace

ColorFieldPtr color_field_argument(const py::handle& value, const std::string& name) {
  return instance_argument<ColorField>(value, name, "a ColorField");
}

void bind_paint(py::module_& m) {
  py::class_<ColorField, std::shared_ptr<ColorField>>(
      m, "ColorField",
      R"(A colour over space, linear RGB: 'albedo' of a GPIS object in a scene multiplies the colours of its materials.)")
      .def(
          py::init([](const py::object& red, const py::object& green, const py::object& blue) {
            return std::make_shared<ColorField>(
                std::array<FieldPtr, 3>{field_argument(red, "red"), field_argument(green, "green"),
                                        field_argument(blue, "blue")});
          }),
          "red"_a, "green"_a, "blue"_a,
          R"(Three Fields, or numbers, that stay between 0 and 1: ValueError where they are not known to.)")
      .def(
          "__call__",
          [](const ColorField& field, const py::object& points) {
            const std::vector<Vec3> at = points_argument(points, "points");
            py::array_t<double> out({static_cast<py::ssize_t>(at.size()), py::ssize_t{3}});
            for (std::size_t i = 0; i < at.size(); ++i) {
              const Color c = field.value(at[i]);
              for (int k = 0; k < 3; ++k) out.mutable_at(i, k) = c[k];
            }
            return out;
          },
          "points"_a, R"(Colours (N, 3) at points (N, 3).)");
  m.def(
      "VdbColorField",
      [](const py::object& path, const std::string& grid) {
        const std::string file = path_argument(path, "path");
        py::gil_scoped_release release;
        return std::const_pointer_cast<ColorField>(load_vdb_color_field(file, grid));
      },
      "path"_a, "grid"_a = "albedo",
      R"(A ColorField from a grid of vectors of a .vdb file, trilinear between its voxels, the nearest one outside.

FileNotFoundError, or ValueError with a sentence: no grid of that name, another type, no active voxel, colours beyond 0 to 1.)");
  py::class_<PaintedFields>(
      m, "PaintedFields",
      R"(The fields of an object while they are painted on: the mean of a .vdb file and, where they were painted, the grids
'sigma', 'anisotropy_diagonal', 'anisotropy_offdiagonal' and 'albedo' on the same voxels. Not for several threads at once.)")
      .def(
          py::init(&open), "path"_a, py::kw_only(), "mean"_a = "mean", "sigma"_a = 1.0,
          "length_scale"_a = 1.0, "sigma_grid"_a = "", "sigma_meaning"_a = "value",
          "sigma_factor"_a = 1.0, "anisotropy"_a = false, "albedo"_a = false,
          R"(path: a .vdb file with the grid `mean` (its name). sigma, length_scale (or the six entries of A): the object's constants.

sigma_grid: name of the file's deviation ('' for none), a 'value' or a 'variance', times sigma_factor. anisotropy, albedo: whether
the file's grids of these names are the object's. Grids on other voxels than the mean are sampled on its nodes (an albedo is
refused). FileNotFoundError, or ValueError with a sentence.)")
      .def(
          "apply", &apply, "channel"_a, "operation"_a, "centers"_a, py::kw_only(), "radius"_a,
          "strength"_a = 1.0, "directions"_a = py::none(), "value"_a = py::none(),
          "ratios"_a = Triple{1, 1, 1}, "falloff"_a = "smooth", "curve"_a = py::none(),
          "symmetry"_a = std::array<bool, 3>{}, "threads"_a = 0,
          R"(Dabs, one after the other: centers (N, 3), radius and strength (0 to 1) each one number or N.

A dab has at x the weight a = strength · falloff(|x - c| / radius), 0 beyond; c is the nearest of its mirror images in the planes
x, y, z = 0 that `symmetry` names (several equally near are averaged). With p = 1 - distance, falloff is 'smooth' 3p²-2p³,
'smoother' 6p⁵-15p⁴+10p³, 'sphere' √(2p-p²), 'root' √p, 'sharp' p², 'sharper' p⁴, 'inverse_square' 2p-p², 'linear' p, 'constant'
1, or `curve`: values at equal distances from centre to rim, linear between. m6 is the mean over the six neighbouring nodes, the
nearest node beyond the grid's box.

  mean          inflate (deflate)  μ -+ a·value·radius           smooth  μ + a (m6 μ - μ)
                flatten            μ + a (P(x) - μ), P the plane of the mean's value and slope averaged under the brush
                grab               μ(x - a·direction)
  deviation     set   ln σ + a (ln value - ln σ)      add  ln σ + a ln value      smooth  ln σ + a (m6 ln σ - ln σ)
  length_scale  the same on ln ℓ, ℓ = |A|^(1/6): A scales with ℓ²
  anisotropy    comb  s ((1-a) A + a B), s keeping |A|; B has the axes e₁ (direction, made normal to e₃), e₂ and e₃ = ∇μ/|∇μ|,
                their lengths in `ratios`, and the size of A.      smooth  (1-a) A + a m6 A
  albedo        set   c + a (value - c)                                              smooth  c + a (m6 c - c)

Every dab writes single precision and reads what those before it wrote. value: displacement in radii (.1) | σ | factor | ℓ |
colour (3,). Returns counts: nodes and leaves written, clamped, undirected (no normal to comb about), rejected (not positive
definite when rounded).)")
      .def(
          "extend",
          [](PaintedFields& f, const py::object& bounds) {
            const Box3 box = bounds_argument(bounds);
            py::gil_scoped_release release;
            f.extend(box);
          },
          "bounds"_a,
          R"(Adds nodes, by leaves of 8³, until the grid holds bounds (2, 3): the least and the largest corner.

The mean goes on with its nearest value and slope (positive stays positive), the others with their nearest value.)")
      .def(
          "reset",
          [](PaintedFields& f, const std::string& channel) {
            return counts_dict(f.reset(named(kChannels, channel, "channel")));
          },
          "channel"_a,
          R"(The channel as it was before it was painted on: 'length_scale' keeps the shape of A, 'anisotropy' its size.)")
      .def(
          "mirror",
          [](PaintedFields& f, const std::string& channel, int axis, bool from_positive) {
            py::gil_scoped_release release;
            const PaintCounts counts =
                f.mirror(named(kChannels, channel, "channel"), axis, from_positive);
            py::gil_scoped_acquire acquire;
            return counts_dict(counts);
          },
          "channel"_a, "axis"_a, "from_positive"_a = true,
          R"(Makes the negative half along axis (0, 1, 2) the image of the positive one, or the other way round.)")
      .def(
          "copy",
          [](PaintedFields& f, const PaintedFields& other, const std::string& channel) {
            py::gil_scoped_release release;
            const PaintCounts counts = f.copy(other, named(kChannels, channel, "channel"));
            py::gil_scoped_acquire acquire;
            return counts_dict(counts);
          },
          "other"_a, "channel"_a,
          R"(The channel of other PaintedFields in the same coordinates; `reset` goes back to it from now on.)")
      .def("restart", &PaintedFields::restart, py::call_guard<py::gil_scoped_release>(),
           R"(All as it was before anything was painted, mirrored or extended.)")
      .def(
          "resample", &PaintedFields::resample, "voxel_size"_a,
          py::call_guard<py::gil_scoped_release>(),
          R"(Cubic voxels of another size over the same box, trilinear; `restart` then goes back to these.)")
      .def(
          "values", &values, "channel"_a, "points"_a,
          R"(Trilinear values at points (N, 3): (N,), of the albedo (N, 3), of the anisotropy (N, 6), of the length scale ℓ = |A|^(1/6).)")
      .def(
          "first_surface", &first_surface, "origin"_a, "direction"_a, "t_max"_a = kInfinity,
          R"(Where origin + t·direction first enters the mean's inside: (t, position, gradient of the mean), or None.)")
      .def(
          "bounds",
          [](const PaintedFields& f) {
            return std::pair(to_triple(f.bounds().min), to_triple(f.bounds().max));
          },
          R"(The least and the largest corner of the grid's nodes.)")
      .def(
          "voxel_size", [](const PaintedFields& f) { return to_triple(f.voxel_size()); },
          R"(Edges of a voxel.)")
      .def("memory", &PaintedFields::memory, R"(Bytes of all grids and of what they were.)")
      .def("painted", &PaintedFields::painted,
           R"(Names of the grids that `write` adds to the mean.)")
      .def(
          "write",
          [](const PaintedFields& f, const py::object& path, const py::bytes& strokes) {
            const std::string file = path_argument(path, "path");
            check_replaceable(file, "path");
            const std::string content = strokes;
            py::gil_scoped_release release;
            f.write(file, content);
          },
          "path"_a, "strokes"_a = py::bytes(),
          R"(Writes a new .vdb file: the grids, what they were before ('gpis_base_' and their names), all else the source held.

strokes: bytes, kept in the file's metadata. Another name is written first and renamed: nobody ever sees half a file.)");
  m.def(
      "read_strokes",
      [](const py::object& path) { return py::bytes(read_strokes(path_argument(path, "path"))); },
      "path"_a,
      R"(The bytes that PaintedFields.write put into a file's metadata; empty where there are none.)");
}

}  // namespace gpis

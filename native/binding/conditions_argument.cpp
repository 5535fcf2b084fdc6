#include "binding/conditions_argument.h"

namespace gpis {
namespace py = pybind11;
namespace {

constexpr const char* kKeys[] = {"points", "values", "normals", "slopes", "noise"};
constexpr std::size_t kMostPoints = 1'000'000;

std::string row_of(const char* key, std::size_t i) {
  return "conditions['" + std::string(key) + "'][" + std::to_string(i) + "]";
}

// An array of one number a point, or three; empty where the key is not there.
NumberArray column(const py::dict& dict, const char* key, std::size_t points, int width) {
  if (!dict.contains(key) || dict[key].is_none()) return NumberArray(0);
  const NumberArray array = NumberArray::ensure(dict[key]);
  const auto n = static_cast<py::ssize_t>(points);
  const bool fits =
      array && (width == 1 ? array.ndim() == 1 && array.shape(0) == n
                           : array.ndim() == 2 && array.shape(0) == n && array.shape(1) == width);
  if (!fits) {
    PyErr_Clear();
    throw std::invalid_argument("conditions['" + std::string(key) + "'] must be an array (" +
                                std::to_string(points) + (width == 1 ? ",)" : ", 3)") +
                                ", one row a point.");
  }
  return array;
}

}  // namespace

std::shared_ptr<const Conditions> conditions_argument(const py::object& value) {
  if (value.is_none()) return nullptr;
  if (!py::isinstance<py::dict>(value))
    throw std::invalid_argument(
        "conditions must be None or a dict of points, values, normals, slopes and noise.");
  const auto dict = py::reinterpret_borrow<py::dict>(value);
  for (const auto& item : dict) {
    const auto key = py::str(item.first).cast<std::string>();
    if (std::find(std::begin(kKeys), std::end(kKeys), key) == std::end(kKeys))
      throw std::invalid_argument("conditions: unknown key '" + key +
                                  "' (takes points, values, normals, slopes, noise).");
  }
  if (!dict.contains("points")) throw std::invalid_argument("conditions must hold points (C, 3).");
  const auto points = points_argument(dict["points"], "conditions['points']");
  const std::size_t n = points.size();
  if (n > kMostPoints)
    throw std::invalid_argument("conditions takes up to " + std::to_string(kMostPoints) +
                                " points, these are " + std::to_string(n) + ".");
  const NumberArray values = column(dict, "values", n, 1), normals = column(dict, "normals", n, 3),
                    slopes = column(dict, "slopes", n, 1), noise = column(dict, "noise", n, 1);
  auto out = std::make_shared<Conditions>();
  for (std::size_t i = 0; i < n; ++i) {
    Conditions::Point p{points[i], {}, {}, 0};
    if (values.size() && !std::isnan(values.data()[i])) {
      p.value = values.data()[i];
      if (!std::isfinite(*p.value))
        throw std::invalid_argument(row_of("values", i) + " is infinite; NaN means none.");
    }
    if (noise.size()) p.noise = noise.data()[i];
    if (!(p.noise >= 0) || !std::isfinite(p.noise))
      throw std::invalid_argument(row_of("noise", i) +
                                  " must be a standard deviation, 0 or positive, it is " +
                                  std::to_string(p.noise) + ".");
    if (normals.size()) {
      const double* at = normals.data() + 3 * i;
      const Vec3 normal{at[0], at[1], at[2]};
      const bool none = std::isnan(at[0]) && std::isnan(at[1]) && std::isnan(at[2]);
      if (!none && !(is_finite(normal) && length(normal) > 0))
        throw std::invalid_argument(row_of("normals", i) +
                                    " must be a direction, or three NaN for none.");
      const double slope = slopes.size() ? slopes.data()[i] : 1;
      if (!none && !(slope > 0 && std::isfinite(slope)))
        throw std::invalid_argument(row_of("slopes", i) + " must be positive, it is " +
                                    std::to_string(slope) +
                                    ": the length of the gradient along the normal.");
      if (!none) p.gradient = normalize(normal) * slope;
    }
    if (!p.value && !p.gradient)
      throw std::invalid_argument("conditions['points'][" + std::to_string(i) +
                                  "] has neither a value nor a normal.");
    out->points.push_back(p);
  }
  return out->points.empty() ? nullptr : out;
}

}  // namespace gpis

#include "binding/arguments.h"

#include <charconv>
#include <filesystem>

#include "binding/reader.h"
#include "field/constant_field.h"

namespace gpis {

FieldPtr field_argument(const py::handle& value, const std::string& name) {
  if (py::isinstance<Field>(value)) return value.cast<std::shared_ptr<Field>>();
  if (PyNumber_Check(value.ptr())) {
    const auto number = py::reinterpret_steal<py::object>(PyNumber_Float(value.ptr()));
    if (number) return std::make_shared<ConstantField>(number.cast<double>());
    PyErr_Clear();
  }
  throw std::invalid_argument(name + " must be a field or a number, it is " + shown(value) + ".");
}

Memory memory_argument(const std::string& value, const std::string& name) {
  if (value == "none") return Memory::none;
  if (value == "renewal") return Memory::renewal;
  if (value == "renewal+") return Memory::renewal_plus;
  if (value == "global") return Memory::global;
  int count = 0;
  const char *first = value.data() + 7, *last = value.data() + value.size();
  if (value.starts_with("global-") && std::from_chars(first, last, count).ptr == last &&
      count >= 1 && count <= Memory::kMostSegments)
    return {Memory::segments, count};
  throw std::invalid_argument(name + " is '" + value +
                              "', it takes 'none', 'renewal', 'renewal+', 'global-1' to 'global-" +
                              std::to_string(Memory::kMostSegments) + "' or 'global'.");
}

TreePtr tree_argument(const py::handle& value, const std::string& name) {
  if (py::isinstance<ProcessTree>(value)) return value.cast<std::shared_ptr<ProcessTree>>();
  return ProcessTree::single(
      instance_argument<GaussianProcess>(value, name, "a GaussianProcess or a CSG tree of them"));
}

std::string path_argument(const py::handle& value, const std::string& name) {
  PyObject* encoded = nullptr;
  if (!PyUnicode_FSConverter(value.ptr(), &encoded)) {
    PyErr_Clear();
    throw std::invalid_argument(name + " must be the path of a file, it is " +
                                py::repr(value).cast<std::string>() + ".");
  }
  return py::reinterpret_steal<py::bytes>(encoded);
}

void check_replaceable(const std::string& path, const std::string& name) {
  std::error_code error;
  if (path.empty()) throw std::invalid_argument(name + " is empty; it takes the path of a file.");
  if (std::filesystem::exists(path, error) && !std::filesystem::is_regular_file(path, error))
    throw std::invalid_argument(
        name + " is \"" + path +
        "\", which is there and is not a file; it takes the path of a file.");
}

Vec3 vec_or_number(const py::handle& value, const std::string& name) {
  const auto a = NumberArray::ensure(value);
  if (a && a.ndim() == 0) return Vec3{1, 1, 1} * *a.data();
  if (a && a.ndim() == 1 && a.shape(0) == 3) return {a.at(0), a.at(1), a.at(2)};
  PyErr_Clear();
  throw std::invalid_argument(name + " must be a number or three numbers, it is " +
                              py::repr(value).cast<std::string>() + ".");
}

NumberArray rows_argument(const py::handle& value, const std::string& name) {
  const auto a = NumberArray::ensure(value);
  if (!a || a.ndim() != 2 || a.shape(1) != 3) {
    PyErr_Clear();
    throw std::invalid_argument(name + " must be an array of shape (N, 3).");
  }
  return a;
}

Vec3 point_of(const NumberArray& rows, std::size_t i, const char* name) {
  const double* at = rows.data() + 3 * i;
  const Vec3 point{at[0], at[1], at[2]};
  if (!is_finite(point))
    throw std::invalid_argument(std::string(name) + "[" + std::to_string(i) +
                                "] is not finite: every coordinate must be a number.");
  return point;
}

std::vector<Vec3> points_argument(const py::handle& value, const char* name) {
  const auto rows = rows_argument(value, name);
  std::vector<Vec3> points(rows.shape(0));
  for (std::size_t i = 0; i < points.size(); ++i) points[i] = point_of(rows, i, name);
  return points;
}

Affine affine_argument(const NumberArray& m) {
  if (m.ndim() != 2 || m.shape(0) != 4 || m.shape(1) != 4)
    throw std::invalid_argument("transformed: the matrix has the shape " +
                                py::str(py::tuple(m.attr("shape"))).cast<std::string>() +
                                "; it takes (4, 4).");
  if (m.at(3, 0) != 0 || m.at(3, 1) != 0 || m.at(3, 2) != 0 || m.at(3, 3) != 1)
    throw std::invalid_argument(
        "transformed: the last row of the matrix is not (0, 0, 0, 1): it takes an affine map.");
  Affine a;
  for (int i = 0; i < 3; ++i) a.linear.row[i] = {m.at(i, 0), m.at(i, 1), m.at(i, 2)};
  a.translation = {m.at(0, 3), m.at(1, 3), m.at(2, 3)};
  return a;
}

NumberArray numbers_argument(const py::handle& value, py::ssize_t count, const char* sentence) {
  const auto a = NumberArray::ensure(value);
  if (!a || a.ndim() != 1 || a.shape(0) != count) {
    PyErr_Clear();
    throw std::invalid_argument(sentence);
  }
  return a;
}

py::dict counters_dict(const Counters& counters) {
  py::dict out;
#define X(name, meaning) out[#name] = counters.name;
  GPIS_COUNTERS(X)
#undef X
  return out;
}

}  // namespace gpis

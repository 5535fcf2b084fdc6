#include "binding/reader.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <stdexcept>

namespace gpis {

namespace {

std::string shape_text(const std::vector<int>& shape) {
  static const char* const kLetters = "NM";
  std::string s = "(";
  int unknown = 0;
  for (std::size_t i = 0; i < shape.size(); ++i) {
    s += (i ? ", " : "") +
         (shape[i] < 0 ? std::string(1, kLetters[unknown++]) : std::to_string(shape[i]));
  }
  return s + (shape.size() == 1 ? ",)" : ")");
}

std::string shape_text(const py::array& array) {
  return shape_text(std::vector<int>(array.shape(), array.shape() + array.ndim()));
}

bool fits(const py::array& array, const std::vector<int>& shape) {
  if (array.ndim() != static_cast<py::ssize_t>(shape.size())) return false;
  for (std::size_t i = 0; i < shape.size(); ++i)
    if (shape[i] >= 0 && array.shape(i) != shape[i]) return false;
  return true;
}

// Anything numpy makes an array of booleans, integers or floats of; nothing otherwise.
py::object numeric_array(const py::handle& value) {
  py::object array;
  try {
    array = py::module_::import("numpy").attr("asarray")(value);
  } catch (const py::error_already_set&) {  // ragged lists
    return py::none();
  }
  const auto kind = py::cast<py::array>(array).dtype().kind();
  return kind == 'b' || kind == 'i' || kind == 'u' || kind == 'f' ? array : py::none();
}

py::array numeric_array(const py::handle& value, const std::string& path, const std::string& takes,
                        const std::vector<int>& shape) {
  const py::object object = numeric_array(value);
  if (object.is_none())
    refuse(path, "takes " + takes + " of shape " + shape_text(shape) + ", got " + shown(value));
  const py::array array = object;
  if (!fits(array, shape))
    refuse(path, "takes " + takes + " of shape " + shape_text(shape) + ", got shape " +
                     shape_text(array));
  return array;
}

std::string listed(const std::vector<std::string>& words) {
  std::string s;
  for (const std::string& w : words) s += (s.empty() ? "" : ", ") + w;
  return s;
}

}  // namespace

void refuse(const std::string& path, const std::string& sentence) {
  throw std::invalid_argument((path.empty() ? "description" : path) + ": " + sentence);
}

std::string shown(const py::handle& value) {
  const bool short_list =
      (py::isinstance<py::tuple>(value) || py::isinstance<py::list>(value)) && py::len(value) <= 6;
  if (value.is_none() || py::isinstance<py::bool_>(value) || py::isinstance<py::int_>(value) ||
      py::isinstance<py::float_>(value) || py::isinstance<py::str>(value) || short_list) {
    const py::str text = py::repr(value);
    if (py::len(text) <= 80) return text;
    return std::string(py::str(text[py::slice(0, 77, 1)])) + "…";
  }
  if (py::isinstance<py::array>(value))
    return "an array of shape " + shape_text(py::cast<py::array>(value));
  return "a value of type " + std::string(py::str(py::type::of(value).attr("__name__")));
}

double to_number(const py::handle& value, const std::string& path) {
  const py::object object = py::isinstance<py::str>(value) ? py::none() : numeric_array(value);
  if (object.is_none() || py::cast<py::array>(object).ndim() != 0)
    refuse(path, "takes a number, got " + shown(value));
  const double v = py::cast<double>(object.attr("item")());
  if (std::isnan(v)) refuse(path, "is NaN; give a number");
  return v;
}

std::string to_text(const py::handle& value, const std::string& path) {
  if (!py::isinstance<py::str>(value)) refuse(path, "takes a text, got " + shown(value));
  return py::cast<std::string>(value);
}

DoubleArray to_numbers(const py::handle& value, const std::string& path,
                       const std::vector<int>& shape) {
  const auto array = DoubleArray::ensure(numeric_array(value, path, "numbers", shape));
  if (!array) throw py::error_already_set();
  for (py::ssize_t i = 0; i < array.size(); ++i)
    if (!std::isfinite(array.data()[i]))
      refuse(path, "number " + std::to_string(i) + " (counted from 0, in order) is " +
                       (std::isnan(array.data()[i]) ? "NaN" : "infinite") +
                       "; every number must be finite");
  return array;
}

std::vector<std::int64_t> to_integers(const py::handle& value, const std::string& path,
                                      const std::vector<int>& shape) {
  const py::array array = numeric_array(value, path, "integers", shape);
  if (array.size() > 0 && array.dtype().kind() != 'i' && array.dtype().kind() != 'u')
    refuse(path, "takes integers, got numbers of type " + std::string(py::str(array.dtype())));
  const auto integers =
      py::array_t<std::int64_t, py::array::c_style | py::array::forcecast>::ensure(array);
  if (!integers) throw py::error_already_set();
  return {integers.data(), integers.data() + integers.size()};
}

Affine to_affine(const py::handle& value, const std::string& path) {
  const py::object array = numeric_array(value);
  if ((array.is_none() || py::cast<py::array>(array).ndim() != 2) &&
      py::isinstance<py::sequence>(value) && py::len(value) > 0 &&
      py::isinstance<py::tuple>(py::object(value[py::int_(0)])))
    refuse(path,
           "motion (a list of time and matrix) is not supported by this version; give one (4, 4) "
           "matrix");
  const DoubleArray m = to_numbers(value, path, {4, 4});
  const double* e = m.data();
  if (e[12] != 0 || e[13] != 0 || e[14] != 0 || e[15] != 1)
    refuse(path, "must be affine: its last row must be 0 0 0 1 (translation in the last column)");
  return {{{Vec3{e[0], e[1], e[2]}, Vec3{e[4], e[5], e[6]}, Vec3{e[8], e[9], e[10]}}},
          {e[3], e[7], e[11]}};
}

Mat3 to_mat3(const py::handle& value, const std::string& path) {
  const DoubleArray m = to_numbers(value, path, {3, 3});
  const double* e = m.data();
  return {{Vec3{e[0], e[1], e[2]}, Vec3{e[3], e[4], e[5]}, Vec3{e[6], e[7], e[8]}}};
}

std::vector<py::object> to_items(const py::handle& value, const std::string& path) {
  if (!py::isinstance<py::sequence>(value) || py::isinstance<py::str>(value))
    refuse(path, "takes a list, got " + shown(value));
  std::vector<py::object> items;
  for (const auto& item : py::cast<py::sequence>(value))
    items.push_back(py::reinterpret_borrow<py::object>(item));
  return items;
}

Reader::Reader(const py::handle& dict, std::string path) : path_(std::move(path)) {
  if (!py::isinstance<py::dict>(dict)) refuse(path_, "takes a dict, got " + shown(dict));
  dict_ = py::reinterpret_borrow<py::dict>(dict);
}

bool Reader::has(const char* key) {
  if (std::find(known_.begin(), known_.end(), key) == known_.end()) known_.push_back(key);
  return dict_.contains(key);
}

py::object Reader::required(const char* key) {
  if (!has(key)) {
    std::vector<std::string> present;
    for (const auto& item : dict_) present.push_back(py::str(item.first));
    refuse(path_, "key '" + std::string(key) + "' is missing (got " +
                      (present.empty() ? "none" : listed(present)) + ")");
  }
  return dict_[key];
}

double Reader::number(const char* key) {
  return to_number(required(key), path_of(key));
}

bool Reader::flag(const char* key, bool otherwise) {
  if (!has(key)) return otherwise;
  const py::object value = dict_[key];
  const bool numpy_bool =
      std::string(py::str(py::type::of(value).attr("__name__"))).starts_with("bool");
  if (!numpy_bool) refuse(path_of(key), "takes True or False, got " + shown(value));
  return py::cast<bool>(value);
}

std::string Reader::text(const char* key, const std::string& otherwise) {
  return has(key) ? to_text(dict_[key], path_of(key)) : otherwise;
}

int Reader::choice(const char* key, const std::vector<const char*>& choices) {
  const std::string value = to_text(required(key), path_of(key));
  for (std::size_t i = 0; i < choices.size(); ++i)
    if (value == choices[i]) return static_cast<int>(i);
  refuse(path_of(key),
         "takes " + listed({choices.begin(), choices.end()}) + ", got '" + value + "'");
}

Color Reader::color(const char* key) {
  const DoubleArray v = to_numbers(required(key), path_of(key), {3});
  return {v.at(0), v.at(1), v.at(2)};
}

void Reader::finish(const std::string& what) {
  for (const auto& [key, value] : dict_) {
    const std::string name = py::str(key);
    if (!py::isinstance<py::str>(key) ||
        std::find(known_.begin(), known_.end(), name) == known_.end())
      refuse(path_, "unknown key '" + name + "' (" + what + " takes " + listed(known_) + ")");
  }
}

void Reader::unsupported(const char* key, const std::string& sentence) {
  if (dict_.contains(key) && !py::object(dict_[key]).is_none()) refuse(path_of(key), sentence);
}

}  // namespace gpis

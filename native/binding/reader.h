// Typed reading of a description's dicts. Every value knows its path (`objects[2].matrix`), every
// refusal says the path, what was there and what it takes. A Reader remembers the keys that were
// asked for; finish() refuses any other.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <cstdint>
#include <string>
#include <vector>

#include "core/vec.h"

namespace gpis {

namespace py = pybind11;
using DoubleArray = py::array_t<double, py::array::c_style | py::array::forcecast>;

// Throws std::invalid_argument "path: sentence".
[[noreturn]] void refuse(const std::string& path, const std::string& sentence);
// What a value is, for messages: a number, text or short list itself, of other things the type
// (and shape).
std::string shown(const py::handle& value);

// Conversions of one value; they refuse what is of another type or shape, and NaN.
double to_number(const py::handle& value, const std::string& path);
std::string to_text(const py::handle& value, const std::string& path);
// `shape` entries of -1 take any length.
DoubleArray to_numbers(const py::handle& value, const std::string& path,
                       const std::vector<int>& shape);
std::vector<std::int64_t> to_integers(const py::handle& value, const std::string& path,
                                      const std::vector<int>& shape);
Affine to_affine(const py::handle& value, const std::string& path);
Mat3 to_mat3(const py::handle& value, const std::string& path);
// The items of a list, tuple or array.
std::vector<py::object> to_items(const py::handle& value, const std::string& path);

class Reader {
 public:
  Reader(const py::handle& dict, std::string path);

  const std::string& path() const { return path_; }
  std::string path_of(const char* key) const { return path_.empty() ? key : path_ + "." + key; }
  const py::dict& dict() const { return dict_; }

  // Whether the key is there. Every access below marks its key as known.
  bool has(const char* key);
  py::object required(const char* key);

  double number(const char* key);
  double number(const char* key, double otherwise) { return has(key) ? number(key) : otherwise; }
  bool flag(const char* key, bool otherwise);
  std::string text(const char* key, const std::string& otherwise);
  // The index of the value in `choices`.
  int choice(const char* key, const std::vector<const char*>& choices);
  int choice(const char* key, const std::vector<const char*>& choices, int otherwise) {
    return has(key) ? choice(key, choices) : otherwise;
  }
  Color color(const char* key);
  Affine affine(const char* key) {
    return has(key) ? to_affine(required(key), path_of(key)) : Affine{};
  }

  // Refuses keys that nobody asked for. `what` names the thing in the message ("a sun light").
  void finish(const std::string& what);
  // Refuses a key that the format has and this version does not read.
  void unsupported(const char* key, const std::string& sentence);

 private:
  py::dict dict_;
  std::string path_;
  std::vector<std::string> known_;
};

}  // namespace gpis

// Python arguments that several bindings take, and results that several give.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <string>
#include <vector>

#include "core/counters.h"
#include "field/field.h"
#include "process/gaussian_process.h"
#include "process/tree.h"

namespace gpis {

using NumberArray =
    pybind11::array_t<double, pybind11::array::c_style | pybind11::array::forcecast>;

// A field, or a number as a constant field. `name` says in the error whose argument it was.
FieldPtr field_argument(const pybind11::handle& value, const std::string& name);

// 'none', 'renewal', 'renewal+' or 'global'.
Memory memory_argument(const std::string& value, const std::string& name);

// An instance of a class of this module, never None: a null pointer in C++. `takes` is its name
// with an article.
template <class T>
std::shared_ptr<T> instance_argument(const pybind11::handle& value, const std::string& name,
                                     const std::string& takes) {
  if (pybind11::isinstance<T>(value)) return value.cast<std::shared_ptr<T>>();
  throw std::invalid_argument(
      name + " must be " + takes + ", it is a " +
      pybind11::str(pybind11::type::handle_of(value).attr("__name__")).cast<std::string>() + ".");
}

// A GaussianProcess, as a tree of one leaf, or a CSG tree.
TreePtr tree_argument(const pybind11::handle& value, const std::string& name);

// A path as Python's open takes it (str, bytes, os.PathLike).
std::string path_argument(const pybind11::handle& value, const std::string& name);

// Refuses a path to write to that holds something else than a file: renaming the new file onto it
// would remove it.
void check_replaceable(const std::string& path, const std::string& name);

// Three numbers, or one that stands for all three.
Vec3 vec_or_number(const pybind11::handle& value, const std::string& name);

// An array (N, 3), and its row i: finite numbers.
NumberArray rows_argument(const pybind11::handle& value, const std::string& name);
Vec3 point_of(const NumberArray& rows, std::size_t i, const char* name);

// All of them.
std::vector<Vec3> points_argument(const pybind11::handle& value, const char* name);

// A matrix (4, 4) whose last row is (0, 0, 0, 1).
Affine affine_argument(const NumberArray& matrix);

// An array of `count` numbers; `sentence` refuses anything else.
NumberArray numbers_argument(const pybind11::handle& value, pybind11::ssize_t count,
                             const char* sentence);

pybind11::dict counters_dict(const Counters& counters);

}  // namespace gpis
